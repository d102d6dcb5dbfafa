#include "sprag/detail/identification/record_errors.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <memory>
#include <optional>
#include <random>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"

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
// `times` that error, for a fit that does not converge under all of it.
SampledInputPointer coarser(const SampledInputPointer& input, double times) {
  const std::optional<SampledInput> half = thinned(*input);
  if (!half) return input;
  const SampledInput::Settings& settings = input->settings();
  // The acceleration of a displacement's spline has the order 2.
  const bool fourth = settings.interpolation == Interpolation::spline && !settings.displacement;
  const double share = times * (fourth ? 1.0 / 15.0 : 1.0 / 3.0);
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
  Likelihood solution;
  Eigen::VectorXd changes;  // of the unknowns' coordinates
  State start;              // change of the start
};

class RecordTrials {
 public:
  RecordTrials(const MachineFamily& family, const Stretches& stretches, const Likelihood& optimum,
               std::span<const std::size_t> held)
      : family_(family),
        stretches_(stretches),
        optimum_(optimum),
        held_(held),
        start_(state_at_start(family, optimum)) {}

  // Empty if the fit with these records does not converge.
  std::optional<Refit> with(const ChangeRecord& change) const {
    check_interrupt();
    const MachineFamily family(with_records(family_.scene(), change), family_.unknowns());
    Refit refit;
    refit.solution = maximize_likelihood(family, stretches_, optimum_, held_);
    if (!refit.solution.converged || !refit.solution.values.allFinite()) return std::nullopt;
    const std::vector<Unknown>& unknowns = family_.unknowns();
    refit.changes.resize(optimum_.values.size());
    for (std::size_t k = 0; k < unknowns.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      refit.changes[i] = unknowns[k].coordinate(refit.solution.values[i]) -
                         unknowns[k].coordinate(optimum_.values[i]);
    }
    const State start = state_at_start(family, refit.solution);
    refit.start = {start.q - start_.q, start.u - start_.u};
    return refit;
  }

  // Scatter of the times by the change of the records, if it causes `share` of the added squares.
  double scatter_of(double squares, double share) const {
    const double added = std::max(squares - optimum_.squares, 0.0);
    return std::sqrt(share * added / std::max(1, optimum_.freedom));
  }

 private:
  const MachineFamily& family_;
  const Stretches& stretches_;
  const Likelihood& optimum_;
  std::span<const std::size_t> held_;
  State start_;
};

void add_noise(const MachineFamily& family, const RecordTrials& trials, RecordErrors& errors) {
  // The standard deviation of a result is then known within 15 %.
  constexpr int draws = 24;
  constexpr std::uint64_t seed = 1;
  const std::vector<RecordedInput>& records = family.records();
  const bool noisy = std::any_of(records.begin(), records.end(), [](const RecordedInput& record) {
    return record.input->noise() > 0.0;
  });
  if (!noisy) return;
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(errors.noise.size());
  State start{errors.start.q.cwiseAbs2(), errors.start.u.cwiseAbs2()};
  double of_times = 0.0;
  int done = 0;
  for (int draw = 0; draw < draws; ++draw) {
    const auto refit = trials.with([&](const SampledInputPointer& input) {
      std::vector<double> of_samples(input->sample_values().size());
      for (double& error : of_samples) error = input->settings().noise * normal(engine);
      return std::make_shared<const SampledInput>(with_errors(*input, of_samples));
    });
    if (!refit) continue;
    ++done;
    squares += refit->changes.cwiseAbs2();
    start.q += refit->start.q.cwiseAbs2() / draws;
    start.u += refit->start.u.cwiseAbs2() / draws;
    of_times += square(trials.scatter_of(refit->solution.squares, 1.0));
  }
  // Fits that do not converge under this noise determine nothing.
  if (2 * done < draws) {
    errors.noise.setConstant(infinity);
    return;
  }
  errors.noise = (squares / done).cwiseSqrt();
  errors.start = {start.q.cwiseSqrt(), start.u.cwiseSqrt()};
  errors.noise_scatter = std::sqrt(of_times / done);
}

void add_resolution(const Likelihood& optimum, double sigma, const RecordTrials& trials,
                    RecordErrors& errors) {
  const auto add = [&](const Refit& refit, double factor) {
    errors.resolution = errors.resolution.cwiseMax(factor * refit.changes.cwiseAbs());
    errors.start.q = errors.start.q.cwiseMax(factor * refit.start.q.cwiseAbs());
    errors.start.u = errors.start.u.cwiseMax(factor * refit.start.u.cwiseAbs());
  };
  bool done = false;
  for (const double times : {1.0, 0.25, 0.0625}) {
    const auto refit =
        trials.with([&](const SampledInputPointer& input) { return coarser(input, times); });
    if (!refit) continue;
    add(*refit, 1.0 / times);
    // The change adds to an error of 1 / times the size: (1 + times)^2 times the squares.
    errors.resolution_scatter =
        trials.scatter_of(refit->solution.squares, 1.0 / (times * (2.0 + times)));
    done = true;
    break;
  }
  if (!done) errors.resolution.setConstant(infinity);
  // In standard deviations: the events rule out an interpolation whose fit is worse by that.
  constexpr double ruled_out = 4.0, far_smaller = 0.5;
  const auto other = trials.with(interpolated_otherwise);
  if (!other) return;
  if (other->solution.squares - optimum.squares > square(ruled_out * sigma)) return;
  add(*other, 1.0);
  if (other->solution.scatter() < far_smaller * optimum.scatter()) {
    errors.other_scatter = other->solution.scatter();
    errors.resolution_scatter = std::max(errors.resolution_scatter, optimum.scatter());
  }
}

}  // namespace

double RecordErrors::of(std::size_t k) const {
  const auto i = static_cast<Eigen::Index>(k);
  return empty() ? 0.0 : std::hypot(noise[i], resolution[i]);
}

State state_at_start(const MachineFamily& family, const Likelihood& solution) {
  const Machine machine = family.at(solution.values);
  const Eigen::VectorXd inputs = family.inputs(solution.values);
  const Eigen::Index n = family.n();
  const double t = solution.path.front().start;
  Eigen::VectorXd y = solution.x0.front().head(n), u = solution.x0.front().tail(n);
  add_driven_motion(machine, inputs, t, y, u);
  return {family.V() * y, family.V() * u};
}

RecordErrors estimate_record_errors(const MachineFamily& family, const Stretches& stretches,
                                    const Likelihood& optimum, std::span<const std::size_t> held,
                                    double sigma) {
  RecordErrors errors;
  if (family.records().empty()) return errors;
  errors.noise.setZero(optimum.values.size());
  errors.resolution.setZero(optimum.values.size());
  errors.start = {Eigen::VectorXd::Zero(family.n()), Eigen::VectorXd::Zero(family.n())};
  const RecordTrials trials(family, stretches, optimum, held);
  add_resolution(optimum, sigma, trials, errors);
  add_noise(family, trials, errors);
  return errors;
}

}  // namespace sprag
