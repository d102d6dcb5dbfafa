#include "sprag/detail/tolerance/search.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <set>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/analysis/quantile.h"
#include "sprag/detail/tolerance/guaranteed.h"

namespace sprag::tolerance {
namespace {

// One amount of one deviation; null: no deviation.
struct Attempt {
  const Deviation* deviation = nullptr;
  double amount = 0.0;
};

std::vector<Point> run(const Bench& bench, const std::vector<Attempt>& attempts, int threads,
                       const std::function<void(double)>& progress) {
  const int runs = bench.settings().runs;
  const std::size_t estimators = bench.settings().estimators.size();
  const int count = runs * static_cast<int>(attempts.size());
  struct Left {
    double V = 0.0, worse = 0.0;
  };
  std::vector<std::vector<Left>> left(static_cast<std::size_t>(count));
  std::mutex mutex;
  int done = 0;
  in_parallel(threads, count, [&](int i) {
    const Attempt& attempt = attempts[static_cast<std::size_t>(i / runs)];
    for (const study::Figures& of : bench.figures(attempt.deviation, attempt.amount, i % runs))
      left[static_cast<std::size_t>(i)].push_back({of.V_floor, of.worse});
    const std::lock_guard lock(mutex);
    progress(static_cast<double>(++done) / count);
  });
  std::vector<Point> points;
  for (std::size_t t = 0; t < attempts.size(); ++t) {
    Point point{attempts[t].amount, {}, {}};
    for (std::size_t e = 0; e < estimators; ++e) {
      std::vector<double> values;
      double worse = 0.0;
      for (std::size_t r = 0; r < static_cast<std::size_t>(runs); ++r) {
        const Left& of = left[t * static_cast<std::size_t>(runs) + r][e];
        values.push_back(of.V);
        worse += of.worse;
      }
      point.V.push_back(spread_of(values));
      point.worse.push_back(worse / runs);
    }
    points.push_back(std::move(point));
  }
  return points;
}

// Index of the first point at which this estimator's median is not below the target; points.size()
// if there is none.
std::size_t first_above(const std::vector<Point>& points, std::size_t estimator, double target) {
  const auto first = std::find_if(points.begin(), points.end(), [&](const Point& point) {
    return !(point.V[estimator].median < target);
  });
  return static_cast<std::size_t>(first - points.begin());
}

Limit limit_of(const Point& undisturbed, const std::vector<Point>& points, std::size_t estimator,
               double target) {
  if (!(undisturbed.V[estimator].median < target)) return {};
  const std::size_t first = first_above(points, estimator, target);
  if (first == points.size()) return {Limit::Kind::beyond_all, points.back().amount};
  if (first == 0) return {Limit::Kind::below_all, points.front().amount};
  const Point &low = points[first - 1], &high = points[first];
  const double V_low = low.V[estimator].median, V_high = high.V[estimator].median;
  if (!std::isfinite(V_high) || !(V_low > 0.0)) return {Limit::Kind::within, low.amount};
  const double part = std::log(target / V_low) / std::log(V_high / V_low);
  return {Limit::Kind::within, low.amount * std::pow(high.amount / low.amount, part)};
}

}  // namespace

const char* name(Limit::Kind kind) {
  switch (kind) {
    case Limit::Kind::within:
      return "within";
    case Limit::Kind::beyond_all:
      return "beyond_all";
    case Limit::Kind::below_all:
      return "below_all";
    case Limit::Kind::never:
      break;
  }
  return "never";
}

Spread spread_of(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {quantile(values, 0.5), *low, *high};
}

Tolerances search(const Bench& bench, std::vector<Deviation> deviations, int threads,
                  const std::function<void(int round, double done)>& progress) {
  const std::size_t estimators = bench.settings().estimators.size();
  Tolerances result;
  for (Deviation& deviation : deviations)
    result.found.push_back({std::move(deviation), {}, {}, {}});

  std::vector<Attempt> coarse = {{}};
  for (const Found& found : result.found) {
    for (const double amount : amounts(found.deviation, true))
      coarse.push_back({&found.deviation, amount});
  }
  std::vector<Point> points = run(bench, coarse, threads, [&](double done) { progress(1, done); });
  result.undisturbed = std::move(points.front());
  for (std::size_t t = 1; t < coarse.size(); ++t) {
    const auto of = std::find_if(result.found.begin(), result.found.end(), [&](const Found& found) {
      return &found.deviation == coarse[t].deviation;
    });
    of->points.push_back(std::move(points[t]));
  }

  // Refine between the last tolerated power of ten and the next one.
  std::vector<Attempt> fine;
  for (const Found& found : result.found) {
    std::set<double> wanted;
    for (std::size_t e = 0; e < estimators; ++e) {
      const std::size_t above = first_above(found.points, e, bench.target());
      const double from = above == 0 ? 0.0 : found.points[above - 1].amount;
      const double to =
          above == found.points.size() ? found.deviation.most + 1e-9 : found.points[above].amount;
      for (const double amount : amounts(found.deviation, false))
        if (amount > from && amount < to) wanted.insert(amount);
    }
    for (const Point& point : found.points) wanted.erase(point.amount);
    for (const double amount : wanted) fine.push_back({&found.deviation, amount});
  }
  points = run(bench, fine, threads, [&](double done) { progress(2, done); });
  for (Found& found : result.found) {
    for (std::size_t t = 0; t < fine.size(); ++t)
      if (fine[t].deviation == &found.deviation) found.points.push_back(points[t]);
    std::sort(found.points.begin(), found.points.end(),
              [](const Point& a, const Point& b) { return a.amount < b.amount; });
    for (std::size_t e = 0; e < estimators; ++e)
      found.limits.push_back(limit_of(result.undisturbed, found.points, e, bench.target()));
    found.guaranteed = guaranteed_limit(bench, found.deviation);
  }
  return result;
}

}  // namespace sprag::tolerance
