#include "sprag/detail/identification/record_errors.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <memory>
#include <optional>
#include <random>

#include "sprag/detail/identification/search.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

// The scene with its records replaced; `change` may return the record itself.
using ChangeRecord = std::function<SampledInputPointer(const SampledInputPointer&)>;

Scene with_records(const Scene& scene, const ChangeRecord& change) {
  Scene changed = scene;
  for (const RecordedInput& record : recorded_inputs(scene)) {
    const SampledInputPointer input = change(record.input);
    replace_input(record, input, changed);
  }
  return changed;
}

// Every other sample, and the last one.
std::optional<SampledInput> thinned(const SampledInput& input) {
  std::vector<double> t, values;
  const std::size_t n = input.sample_times().size();
  for (std::size_t k = 0; k < n; ++k) {
    if (k % 2 == 1 && k + 1 < n) continue;
    t.push_back(input.sample_times()[k]);
    values.push_back(input.sample_values()[k]);
  }
  constexpr std::size_t fewest = 4;
  if (t.size() < fewest) return std::nullopt;
  SampledInput::Settings settings = input.settings();
  settings.gain = 1.0;
  settings.delay = 0.0;
  return SampledInput(t, values, settings);
}

// The record moved away from itself at half of the sampling rate by its estimated error.
SampledInputPointer coarser(const SampledInputPointer& input) {
  const std::optional<SampledInput> half = thinned(*input);
  if (!half) return input;
  const SampledInput::Settings& settings = input->settings();
  // The acceleration of a displacement's spline has the order 2.
  const bool fourth = settings.interpolation == Interpolation::spline && !settings.displacement;
  const double share = fourth ? 1.0 / 15.0 : 1.0 / 3.0;
  const std::vector<double>& t = input->sample_times();
  std::vector<double> errors(t.size(), 0.0);
  for (std::size_t k = 1; k + 1 < t.size(); k += 2) {
    const double of_half = settings.displacement ? half->displacement(t[k]) : half->value(t[k]);
    errors[k] = share * (of_half - input->sample_values()[k]);
  }
  return std::make_shared<const SampledInput>(with_errors(*input, errors));
}

SampledInputPointer interpolated_otherwise(const SampledInputPointer& input) {
  SampledInput::Settings settings = input->settings();
  if (settings.displacement) return input;
  settings.interpolation = settings.interpolation == Interpolation::linear ? Interpolation::spline
                                                                           : Interpolation::linear;
  return std::make_shared<const SampledInput>(input->sample_times(), input->sample_values(),
                                              settings);
}

struct Refit {
  EventFit fit;
  Eigen::VectorXd changes;  // of the unknowns' coordinates
  State start;              // change of the start
};

class RecordTrials {
 public:
  RecordTrials(const Scene& scene, const std::vector<Parameter>& unknowns, bool strictly_within,
               const EventFit& optimum)
      : scene_(&scene),
        unknowns_(&unknowns),
        strictly_within_(strictly_within),
        optimum_(&optimum) {
    GaussNewton solver(scene, unknowns, strictly_within);
    start_ = state_at_start(solver.flight(), optimum);
  }

  // To first order.
  Refit with(const ChangeRecord& change) const {
    check_interrupt();
    GaussNewton solver(with_records(*scene_, change), *unknowns_, strictly_within_);
    Refit refit{.fit = solver.stepped(*optimum_), .changes = {}, .start = {}};
    refit.changes = refit.fit.point.c - optimum_->point.c;
    const State start = state_at_start(solver.flight(), refit.fit);
    refit.start = {start.q - start_.q, start.u - start_.u};
    return refit;
  }

  // Scatter of the times by the change of the records, if it causes `share` of the added squares.
  double scatter_of(double squares, double share) const {
    return std::sqrt(share * std::max(squares - optimum_->squares, 0.0) / optimum_->freedom);
  }

 private:
  const Scene* scene_;
  const std::vector<Parameter>* unknowns_;
  bool strictly_within_;
  const EventFit* optimum_;
  State start_;
};

void add_noise(const Scene& scene, const RecordTrials& trials, RecordErrors& errors) {
  // The standard deviation of a result is then known within 15 %.
  constexpr int draws = 24;
  constexpr std::uint64_t seed = 1;
  const std::vector<RecordedInput> records = recorded_inputs(scene);
  const bool noisy = std::any_of(records.begin(), records.end(), [](const RecordedInput& record) {
    return record.input->noise() > 0.0;
  });
  if (!noisy) return;
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(errors.noise.size());
  State start{errors.start.q.cwiseAbs2(), errors.start.u.cwiseAbs2()};
  double of_times = 0.0;
  for (int draw = 0; draw < draws; ++draw) {
    const Refit refit = trials.with([&](const SampledInputPointer& input) {
      std::vector<double> of_samples(input->sample_values().size());
      for (double& error : of_samples) error = input->settings().noise * normal(engine);
      return std::make_shared<const SampledInput>(with_errors(*input, of_samples));
    });
    squares += refit.changes.cwiseAbs2() / draws;
    start.q += refit.start.q.cwiseAbs2() / draws;
    start.u += refit.start.u.cwiseAbs2() / draws;
    of_times += square(trials.scatter_of(refit.fit.squares, 1.0)) / draws;
  }
  errors.noise = squares.cwiseSqrt();
  errors.start = {start.q.cwiseSqrt(), start.u.cwiseSqrt()};
  errors.noise_scatter = std::sqrt(of_times);
}

void add_resolution(const EventFit& optimum, double sigma, const RecordTrials& trials,
                    RecordErrors& errors) {
  const auto add = [&](const Refit& refit) {
    errors.resolution = errors.resolution.cwiseMax(refit.changes.cwiseAbs());
    errors.start.q = errors.start.q.cwiseMax(refit.start.q.cwiseAbs());
    errors.start.u = errors.start.u.cwiseMax(refit.start.u.cwiseAbs());
  };
  const Refit of_coarser = trials.with(coarser);
  add(of_coarser);
  // The change adds to an error of its own size: 4 times the squares.
  errors.resolution_scatter = trials.scatter_of(of_coarser.fit.squares, 1.0 / 3.0);
  // In standard deviations: the events rule out an interpolation whose fit is worse by that.
  constexpr double far_smaller = 0.5;
  const Refit other = trials.with(interpolated_otherwise);
  if (other.fit.squares - optimum.squares > square(ruled_out * sigma)) return;
  add(other);
  const double scatter = std::sqrt(optimum.variance());
  const double other_scatter = std::sqrt(other.fit.variance());
  if (other_scatter < far_smaller * scatter) {
    errors.other_scatter = other_scatter;
    errors.resolution_scatter = std::max(errors.resolution_scatter, scatter);
  }
}

}  // namespace

double RecordErrors::of(std::size_t k) const {
  const auto i = static_cast<Eigen::Index>(k);
  return empty() ? 0.0 : std::hypot(noise[i], resolution[i]);
}

State state_at_start(FamilyFlight& flight, const EventFit& fit) {
  flight.set(fit.point.c, false);
  State start{Eigen::VectorXd(flight.n()), Eigen::VectorXd(flight.n())};
  flight.state(fit.point.starts.front(), fit.stretches.front().start, start.q, start.u);
  return start;
}

RecordErrors estimate_record_errors(const Scene& scene, const std::vector<Parameter>& unknowns,
                                    bool strictly_within, const EventFit& optimum, double sigma) {
  RecordErrors errors;
  if (recorded_inputs(scene).empty()) return errors;
  errors.noise.setZero(optimum.point.c.size());
  errors.resolution.setZero(optimum.point.c.size());
  const Eigen::Index n = scene.model.coordinates();
  errors.start = {Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  const RecordTrials trials(scene, unknowns, strictly_within, optimum);
  add_resolution(optimum, sigma, trials, errors);
  add_noise(scene, trials, errors);
  return errors;
}

}  // namespace sprag
