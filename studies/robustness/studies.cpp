#include "studies/robustness/studies.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "command_line/in_parallel.h"
#include "sprag/estimation/replica_sweep.h"
#include "studies/robustness/machines.h"

namespace sprag::robustness {
namespace {

constexpr double rounding = 1e-20;  // of V
constexpr double saturated = 1e-3;  // V is about to become that of another motion
constexpr double much_worse = 10.0;
constexpr int all_runs = std::numeric_limits<int>::max();

// 0, then 1, 2 and 5 times each power of ten up to `last`, and `last`.
std::vector<double> series(int first_power, double last) {
  std::vector<double> amounts{0.0};
  for (int power = first_power;; ++power) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double amount = digit * std::pow(10.0, power);
      if (amount > last * (1.0 - 1e-9)) {
        amounts.push_back(last);
        return amounts;
      }
      amounts.push_back(amount);
    }
  }
}

std::vector<Method> usual_methods() {
  return {Method::replica, Method::moreau, Method::forced, Method::timing, Method::both};
}

void add_event_studies(const Scene& scene, std::vector<Study>& all) {
  Study jitter{"jitter",
               3,
               all_runs,
               true,
               series(-8, 1e-2),
               usual_methods(),
               [scene](double amount, double) {
                 Setting setting{scene, {}};
                 setting.believed.jitter = setting.disturbance.jitter = amount;
                 return setting;
               }};
  jitter.methods.push_back(Method::timing_untold);
  jitter.methods.push_back(Method::both_untold);
  all.push_back(jitter);
  const auto add = [&](const char* what, std::vector<double> amounts, double Disturbance::*of,
                       bool both_ways) {
    all.push_back({what, 3, all_runs, true, std::move(amounts), usual_methods(),
                   [scene, of, both_ways](double amount, double sign) {
                     Setting setting{scene, {}};
                     setting.believed.jitter = setting.disturbance.jitter = usual_jitter;
                     setting.disturbance.*of = both_ways ? sign * amount : amount;
                     return setting;
                   }});
  };
  add("offset", series(-6, 1e-1), &Disturbance::offset, true);
  add("missed", series(-3, 0.5), &Disturbance::missed, false);
  add("spurious", series(-3, 3.0), &Disturbance::spurious, false);
}

std::vector<Method> methods_with_drift() {
  std::vector<Method> methods = usual_methods();
  methods.push_back(Method::timing_drift);
  methods.push_back(Method::both_drift);
  return methods;
}

void add_mismatch_studies(const Scene& scene, std::vector<Study>& all) {
  const auto add = [&](const char* what, Wrong wrong, double last) {
    all.push_back({what, 3, all_runs, true, series(-5, last), methods_with_drift(),
                   [scene, wrong](double amount, double sign) {
                     Setting setting{with_wrong(scene, wrong, sign * amount), {}};
                     setting.believed.jitter = setting.disturbance.jitter = usual_jitter;
                     return setting;
                   }});
  };
  add("restitution", Wrong::restitution, 0.3);
  add("damping", Wrong::damping, 0.3);
  add("stiffness", Wrong::stiffness, 0.3);
  add("position", Wrong::position, 0.1);  // the beam ends at 0.15
  add("clearance", Wrong::clearance, 0.1);
  add("amplitude", Wrong::amplitude, 0.3);
  add("phase", Wrong::phase, 1.0);
}

void add_mode_studies(const Scene& scene, std::vector<Study>& all) {
  for (const int modes : {3, 5, 8, 20}) {
    // The outer ones, and some between.
    std::vector<double> left_out;
    for (int n = 0; n<modes; n += modes> 10 && n >= 2 && n < modes - 4 ? 4 : 1) {
      left_out.push_back(n);
    }
    all.push_back({"modes_" + std::to_string(modes), modes, modes > 10 ? 10 : all_runs, false,
                   left_out, methods_with_drift(), [scene, modes](double amount, double) {
                     const int kept = modes - static_cast<int>(std::lround(amount));
                     Setting setting{with_modes(scene, kept), {}};
                     setting.believed.jitter = setting.disturbance.jitter = usual_jitter;
                     return setting;
                   }});
  }
}

double share_worse(const std::vector<double>& V, const std::vector<double>& V_replica) {
  double worse = 0.0;
  for (std::size_t i = 0; i < V.size(); ++i) {
    if (V[i] > rounding && V[i] > much_worse * V_replica[i]) worse += 1.0;
  }
  return worse / static_cast<double>(V.size());
}

}  // namespace

std::vector<Study> studies(const Scene& scene) {
  std::vector<Study> all;
  add_event_studies(scene, all);
  add_mismatch_studies(scene, all);
  add_mode_studies(scene, all);
  return all;
}

std::vector<Point> measure(const Study& study, const Scene& scene, const Options& options,
                           const std::function<void()>& progress) {
  const int of_study = std::min(options.runs, study.most_runs);
  const auto runs = static_cast<std::size_t>(of_study);
  const auto seed_of = [](int run) { return static_cast<std::uint64_t>(run) + 1; };
  std::vector<Truth> truths(runs);
  in_parallel(options.threads, of_study, [&](int run) {
    truths[static_cast<std::size_t>(run)] =
        simulate(with_random_start(with_modes(scene, study.modes), seed_of(run)), options.sampling);
  });

  std::vector<Point> points;
  for (const double amount : study.amounts) {
    points.push_back({amount,
                      {study.methods.size(), std::vector<double>(runs)},
                      std::vector<double>(study.methods.size())});
  }
  // Replicas go side by side, eight runs of a point at a time.
  const std::size_t groups = (runs + ReplicaSweep::lanes - 1) / ReplicaSweep::lanes;
  std::mutex mutex;
  in_parallel(options.threads, static_cast<int>(points.size() * groups), [&](int i) {
    Point& point = points[static_cast<std::size_t>(i) / groups];
    const std::size_t first = static_cast<std::size_t>(i) % groups * ReplicaSweep::lanes;
    const auto of_group =
        std::span<const Truth>(truths).subspan(first, std::min(ReplicaSweep::lanes, runs - first));
    std::vector<Told> told;
    for (std::size_t r = 0; r < of_group.size(); ++r) {
      const Truth& truth = of_group[r];
      const Setting setting = study.setting(point.amount, (first + r) % 2 == 0 ? 1.0 : -1.0);
      told.push_back(
          {setting.believed,
           disturb(truth.events, setting.disturbance, static_cast<int>(truth.model.contacts.size()),
                   options.sampling.duration, seed_of(static_cast<int>(first + r)))});
    }
    const auto of_replicas = replica_energies(told, of_group, options.sampling);
    for (std::size_t r = 0; r < told.size(); ++r) {
      std::vector<double> worse;
      for (std::size_t j = 0; j < study.methods.size(); ++j) {
        const auto V = study.methods[j] == Method::replica
                           ? of_replicas[r]
                           : error_energies(study.methods[j], told[r].believed, told[r].events,
                                            of_group[r], options.sampling);
        point.floors[j][first + r] = quantile(V, 0.5);
        worse.push_back(share_worse(V, of_replicas[r]));
      }
      const std::lock_guard lock(mutex);
      for (std::size_t j = 0; j < worse.size(); ++j) {
        point.share_worse[j] += worse[j] / static_cast<double>(runs);
      }
      progress();
    }
  });
  return points;
}

Slope slope(const Study& study, const std::vector<Point>& points, std::size_t method) {
  Slope slope;
  if (!study.power_law) return slope;
  const double floor = std::max(10.0 * points[0].median(method), rounding);
  std::vector<double> x, y;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double V = points[i].median(method);
    if (!(V > floor && V < saturated)) continue;
    x.push_back(points[i].amount);
    y.push_back(V);
  }
  slope.points = static_cast<int>(x.size());
  if (slope.points < 3) return slope;
  slope.law = fit_power_law(x, y);
  slope.from = x.front();
  slope.to = x.back();
  return slope;
}

Threshold tolerance(const std::vector<Point>& points, std::size_t method) {
  std::vector<double> x, y;
  for (std::size_t i = 1; i < points.size(); ++i) {
    x.push_back(points[i].amount);
    y.push_back(points[i].median(method));
  }
  return stays_below(tolerable, x, y);
}

}  // namespace sprag::robustness
