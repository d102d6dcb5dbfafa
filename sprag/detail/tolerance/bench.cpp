#include "sprag/detail/tolerance/bench.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/study/design.h"
#include "sprag/energy.h"

namespace sprag::tolerance {
namespace {

constexpr std::uint64_t seed = 1;
constexpr int samples = 400;
constexpr double energy_of_starts = 0.1;   // of the energy of the motion
constexpr double wanted_closings = 60.0;   // of the first trial run
constexpr double most_closings = 5000.0;   // largest number in a run
constexpr double enough_closings = 200.0;  // after the replica's convergence

double closings(const std::vector<ContactEvent>& events) {
  return static_cast<double>(std::count_if(
      events.begin(), events.end(),
      [](const ContactEvent& event) { return event.kind != ContactEventKind::opens; }));
}

// A characteristic time of the machine: period of its excitation, or else of its slowest mode.
double first_guess(const Scene& scene) {
  double slowest = std::numeric_limits<double>::infinity();
  const auto look_at = [&](const Harmonic& harmonic) {
    if (harmonic.amplitude != 0.0 && harmonic.frequency > 0.0)
      slowest = std::min(slowest, harmonic.frequency);
  };
  for (const Force& force : scene.model.forces) look_at(force.harmonic);
  for (const Contact& contact : scene.model.contacts) look_at(contact.motion);
  return std::isfinite(slowest) ? 20.0 / slowest : 1.0;
}

// Closings per unit of time, from a run that is long enough.
double look_at_closings(const Scene& scene) {
  const double end = end_of_inputs(scene.model);
  double duration = std::min(first_guess(scene), end);
  for (int attempt = 0; attempt < 12; ++attempt, duration = std::min(2.0 * duration, end)) {
    const Trial trial = run_trial(scene, duration, {});
    if (!trial.error.empty()) throw Error(trial.error);
    if (static_cast<double>(trial.closings) >= wanted_closings || attempt == 11 ||
        duration >= end) {
      if (trial.closings == 0) break;
      return trial.closings_per_time();
    }
  }
  throw Error("no contact of the machine closes: an observer would receive no events");
}

double motion_energy_of(const study::Truth& truth) {
  const Eigen::Index half = truth.q.cols() / 2;
  const Eigen::MatrixXd q = truth.q.rightCols(half), u = truth.u.rightCols(half);
  const Eigen::VectorXd mean_q = q.rowwise().mean(), mean_u = u.rowwise().mean();
  const ErrorEnergy energy(truth.model);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < half; ++i) sum += energy(q.col(i), u.col(i), mean_q, mean_u)[0];
  return sum / static_cast<double>(half);
}

}  // namespace

Bench::Bench(const Scene& scene, const Settings& settings, int threads)
    : scene_(scene), settings_(settings) {
  if (!scene_.truth.given) scene_.truth.start = scene_.prior.start;
  if (settings.jitter > 0.0) scene_.prior.jitter = settings.jitter;
  if (settings.drift > 0.0) scene_.prior.drift = settings.drift;
  for (const EstimatorKind kind : settings.estimators) {
    if (kind == EstimatorKind::adaptive) const TrackingEstimator possible(scene_, 1.0, kind);
  }
  closings_per_time_ = look_at_closings(scene_);
  duration_ = settings.duration > 0.0 ? settings.duration : enough_closings / closings_per_time_;
  const double end = end_of_inputs(scene_.model);
  duration_ = std::min(duration_, end);
  study::Truth first = study::run_machine(scene_, duration_, 0.0, samples);
  motion_energy_ = motion_energy_of(first);
  target_ = settings.target > 0.0 ? settings.target : usual_target * motion_energy_;
  // Twice the time that the replica needs to fall a decade below the target.
  while (!(settings.duration > 0.0)) {
    const study::Figures figures =
        study::follow(EstimatorKind::replica, scene_, first.events, first, 0.1 * target_);
    const double needed = 2.0 * figures.time_below + enough_closings / closings_per_time_;
    const double longest = std::min(most_closings / closings_per_time_, end);
    const bool down = std::isfinite(figures.time_below);
    if (down && needed <= duration_) break;
    if (duration_ >= longest) break;
    duration_ = down ? std::min(needed, longest) : std::min(2.0 * duration_, longest);
    first = study::run_machine(scene_, duration_, 0.0, samples);
  }
  closings_per_time_ = closings(first.events) / duration_;

  truths_.resize(static_cast<std::size_t>(settings.runs));
  truths_.front() = std::move(first);
  in_parallel(threads, settings.runs - 1, [&](int i) {
    study::Study of_starts;
    of_starts.seed = seed;
    study::Setting setting;
    setting.machine = setting.observer = scene_;
    setting.start_machine = energy_of_starts * motion_energy_;
    const auto run = static_cast<std::size_t>(i + 1);
    study::draw_starts(of_starts, run, setting);
    truths_[run] = study::run_machine(setting.machine, duration_, 0.0, samples);
  });
}

std::vector<ContactEvent> Bench::arrived(const study::Disturbance& disturbance, int run) const {
  return study::disturb(truth(run).events, disturbance,
                        static_cast<int>(scene_.model.contacts.size()), duration_, seed,
                        static_cast<std::uint64_t>(run));
}

std::vector<study::Figures> Bench::figures(const Deviation* deviation, double amount,
                                           int run) const {
  using Kind = Deviation::Kind;
  study::Disturbance disturbance{.jitter = scene_.prior.jitter};
  Scene given = scene_;
  study::Figures none;
  none.V_floor = std::numeric_limits<double>::infinity();
  none.V.assign(static_cast<std::size_t>(truth(run).q.cols()), none.V_floor);
  std::vector<study::Figures> figures(settings_.estimators.size(), none);
  if (deviation != nullptr) {
    const bool other_way = run % 2 == 1;
    switch (deviation->kind) {
      case Kind::jitter:
        disturbance.jitter = given.prior.jitter = amount;
        break;
      case Kind::offset:
        disturbance.offset = other_way ? -amount : amount;
        break;
      case Kind::lost:
        disturbance.lost = amount;
        break;
      case Kind::spurious:
        disturbance.spurious = amount;
        break;
      case Kind::parameter:
        try {
          given = with_wrong_parameter(scene_, *deviation, amount, other_way);
        } catch (const ModelError&) {
          return figures;
        }
        break;
    }
  }
  const std::vector<ContactEvent> events = arrived(disturbance, run);
  for (std::size_t e = 0; e < figures.size(); ++e) {
    try {
      figures[e] = study::follow(settings_.estimators[e], given, events, truth(run), target_);
    } catch (const ModelError&) {
      // This observer does not exist and gives no figures.
    }
  }
  study::add_worse(settings_.estimators, figures);
  return figures;
}

}  // namespace sprag::tolerance
