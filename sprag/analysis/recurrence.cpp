#include "sprag/analysis/recurrence.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include "sprag/analysis/lyapunov.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/master.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// A motion that is smaller than this share of its start is none.
constexpr double at_rest = 1e-6;
// Entries of a cycle's points are equal up to so many times what points that repeat may be apart.
constexpr double equal_in_cycle = 4.0;

void check_settings(const RecurrenceSettings& settings) {
  const auto check = [](bool right, const std::string& name, const std::string& allowed) {
    if (!right) throw std::invalid_argument(name + " must be " + allowed);
  };
  check(settings.period >= 0.0 && std::isfinite(settings.period), "period", ">= 0");
  check(settings.transient >= 0, "transient", ">= 0");
  check(settings.periods >= 1, "periods", ">= 1");
  check(settings.longest >= 1, "longest", ">= 1");
  check(settings.tolerance > 0.0, "tolerance", "> 0");
}

// The point of one cycle that comes first by its entries, those closer than the tolerance being
// equal.
Eigen::VectorXd first_of_cycle(const Eigen::Ref<const Simulation::Rows>& cycle,
                               const Eigen::VectorXd& tolerance) {
  Eigen::Index first = 0;
  for (Eigen::Index k = 1; k < cycle.rows(); ++k) {
    for (Eigen::Index j = 0; j < cycle.cols(); ++j) {
      const double difference = cycle(k, j) - cycle(first, j);
      if (std::abs(difference) <= tolerance[j]) continue;
      if (difference < 0.0) first = k;
      break;
    }
  }
  return cycle.row(first).transpose();
}

double largest_norm(const Eigen::Ref<const Simulation::Rows>& points,
                    const Eigen::Ref<const Eigen::VectorXd>& weights) {
  double largest = 0.0;
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    largest = std::max(largest, std::sqrt(points.row(k).cwiseAbs2().dot(weights)));
  }
  return largest;
}

}  // namespace

double excitation_period(const Dynamics& dynamics) {
  const Eigen::VectorXd& Omega = dynamics.frequencies();
  if (Omega.size() == 1) return 2.0 * std::numbers::pi / Omega[0];
  throw std::invalid_argument(
      Omega.size() == 0
          ? "nothing drives the machine periodically: the period of the stroboscope must be given"
          : "the machine is driven with " + std::to_string(Omega.size()) +
                " frequencies: the period of the stroboscope must be given");
}

Recurrence recurrence(const Model& model, const State& start, const RecurrenceSettings& settings) {
  const Flows flows(model);
  return recurrence(flows, start, settings);
}

Recurrence recurrence(const Flows& flows, const State& start, const RecurrenceSettings& settings) {
  check_settings(settings);
  const Dynamics& dynamics = flows.dynamics();
  const double T = settings.period > 0.0 ? settings.period : excitation_period(dynamics);
  const double Omega = 2.0 * std::numbers::pi / T;
  const Eigen::Index f = dynamics.coordinates();
  const long n = settings.periods;

  Recurrence found;
  found.period = T;
  found.points.resize(n, 2 * f);
  Master master(flows, start, 0.0, 0);
  std::vector<ContactEvent> events;
  const auto advance = [&](long k) {
    events.clear();
    master.advance(stroboscope_instant(k, T), events);
  };
  for (long k = 0; k <= settings.transient; ++k) advance(k);
  Eigen::VectorXd q(f), u(f);
  long closings = 0;
  for (long k = 0; k < n; ++k) {
    const Instant t = tick_instant(settings.transient + k, T);
    const Instant last = master.motion().t;
    master.state(last - t > 0.0 ? last : t, q, u);
    found.points.row(k) << q.transpose(), u.transpose();
    advance(settings.transient + k + 1);
    closings += std::count_if(events.begin(), events.end(), [](const ContactEvent& event) {
      return event.kind != ContactEventKind::opens;
    });
  }
  found.impacts_per_period = static_cast<double>(closings) / static_cast<double>(n);

  Eigen::VectorXd weights(2 * f);
  weights.tail(f) = dynamics.model().M.diagonal();
  weights.head(f) = square(Omega) * weights.tail(f);
  // What comes to rest at zero has no size of its own.
  const double largest = std::max(largest_norm(found.points.bottomRows(n - n / 2), weights),
                                  at_rest * std::sqrt(start.q.cwiseAbs2().dot(weights.head(f)) +
                                                      start.u.cwiseAbs2().dot(weights.tail(f))));
  const double close = settings.tolerance * largest;
  const int p = period_of_points(found.points, weights, settings.longest, close);
  found.attractor_period = p;
  found.attractor.setConstant(2 * f, std::numeric_limits<double>::quiet_NaN());
  if (p > 0) {
    found.attractor = first_of_cycle(found.points.bottomRows(p),
                                     equal_in_cycle * close * weights.cwiseSqrt().cwiseInverse());
  }
  if (settings.lyapunov) {
    const long now = settings.transient + n;
    found.lyapunov =
        p > 0 ? std::log(spectral_radius(monodromy(master, T, now, now + p, events))) / (p * T)
              : largest_exponent(master, T, now, now + n, events);
  }
  return found;
}

int period_of_points(const Eigen::Ref<const Simulation::Rows>& points,
                     const Eigen::Ref<const Eigen::VectorXd>& weights, int longest, double close) {
  const Eigen::Index n = points.rows();
  const Eigen::Index from = n / 2;
  for (Eigen::Index p = 1; p <= std::min<Eigen::Index>(longest, n / 4); ++p) {
    bool repeats = true;
    for (Eigen::Index k = from; repeats && k + p < n; ++k) {
      const auto difference = points.row(k + p) - points.row(k);
      repeats = std::sqrt(difference.cwiseAbs2().dot(weights)) <= close;
    }
    if (repeats) return static_cast<int>(p);
  }
  return 0;
}

std::vector<int> label_attractors(std::span<const int> periods,
                                  const Eigen::Ref<const Simulation::Rows>& points,
                                  double tolerance) {
  const Eigen::Index f = points.cols() / 2;
  std::vector<Eigen::Index> order;
  double largest_q = 0.0;
  double largest_u = 0.0;
  const auto period = [&](Eigen::Index i) { return periods[static_cast<std::size_t>(i)]; };
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (period(i) == 0) continue;
    order.push_back(i);
    largest_q = std::max(largest_q, points.row(i).head(f).cwiseAbs().maxCoeff());
    largest_u = std::max(largest_u, points.row(i).tail(f).cwiseAbs().maxCoeff());
  }
  const double zero = 1e-9 * std::max(largest_q, largest_u);
  const double same_q = std::max(tolerance * largest_q, zero);
  const double same_u = std::max(tolerance * largest_u, zero);
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    if (period(a) != period(b)) return period(a) < period(b);
    const auto x = points.row(a);
    const auto y = points.row(b);
    return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
  });
  const auto equal = [&](Eigen::Index a, Eigen::Index b) {
    const auto difference = (points.row(a) - points.row(b)).cwiseAbs();
    return period(a) == period(b) && difference.head(f).maxCoeff() <= same_q &&
           difference.tail(f).maxCoeff() <= same_u;
  };
  std::vector<Eigen::Index> firsts;
  std::vector<std::size_t> which(periods.size(), 0);
  for (const Eigen::Index i : order) {
    const auto known = std::find_if(firsts.begin(), firsts.end(),
                                    [&](Eigen::Index first) { return equal(i, first); });
    which[static_cast<std::size_t>(i)] = static_cast<std::size_t>(known - firsts.begin());
    if (known == firsts.end()) firsts.push_back(i);
  }
  // Entries that differ by roundings do not order them.
  const auto before = [&](Eigen::Index a, Eigen::Index b) {
    if (period(a) != period(b)) return period(a) < period(b);
    for (Eigen::Index j = 0; j < 2 * f; ++j) {
      const double difference = points(a, j) - points(b, j);
      if (std::abs(difference) > (j < f ? same_q : same_u)) return difference < 0.0;
    }
    return false;
  };
  // One by one, since closeness is not transitive.
  std::vector<std::size_t> sorted;
  for (std::size_t k = 0; k < firsts.size(); ++k) {
    auto place = sorted.end();
    while (place != sorted.begin() && before(firsts[k], firsts[*std::prev(place)])) --place;
    sorted.insert(place, k);
  }
  std::vector<int> label_of(firsts.size());
  for (std::size_t k = 0; k < sorted.size(); ++k) label_of[sorted[k]] = static_cast<int>(k) + 1;
  std::vector<int> labels(periods.size(), 0);
  for (const Eigen::Index i : order) {
    const auto place = static_cast<std::size_t>(i);
    labels[place] = label_of[which[place]];
  }
  return labels;
}

}  // namespace sprag
