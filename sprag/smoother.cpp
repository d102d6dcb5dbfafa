#include "sprag/smoother.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/drive.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {
namespace {

// Ticks that precede an impact by more than this many deviations of its time are before it. Closer
// ticks get the covariance of the state after it.
constexpr double around_impact = 3.0;
// Passes end when no estimate moves by more than this share of its deviation.
constexpr int most_passes = 8;
constexpr double settled_move = 0.05;

// Smoothed beliefs from `from` on; each has the state at its own time.
struct Chain {
  double from = 0.0;
  double misfit = 0.0;
  bool fits = true;
  std::vector<FilterBelief> beliefs;
  // Time from which on each belief, or a later one, applies; ascending.
  std::vector<double> begins;
};

// Square root of A A^T + B B^T.
Eigen::MatrixXd root_of_sum(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  Eigen::MatrixXd both(A.rows(), A.cols() + B.cols());
  both << A, B;
  return QR(both.transpose()).R().transpose();
}

// Sets the time of a step's impact from the smoothed belief before it. For a grazing impact the
// time of the step stays.
void set_impact(EventFilter& filter, const FilterBelief& before, int contact, FilterBelief& after) {
  ImpactEstimate& impact = after.impact;
  if (!(impact.time_sigma > 0.0)) return;
  // Without the impact the path is that of the belief before.
  impact.jump = after.z.head(2 * filter.n()) - filter.mean(after.t, before);
  double t = impact.time, sigma = infinity;
  for (int i = 0; i < 2; ++i) {
    const EventFilter::Crossing crossing = filter.crossing(contact, t, before);
    if (!(crossing.velocity < 0.0)) return;
    t -= crossing.gap / crossing.velocity;
    sigma = crossing.deviation / -crossing.velocity;
    // Smoothing must not increase the deviation.
    const double off = std::abs(t - impact.time);
    if (!(sigma <= impact.time_sigma && off < around_impact * impact.time_sigma)) return;
  }
  impact.time = t;
  impact.time_sigma = sigma;
}

// Runs the filter forward; `about`: smoothed beliefs of the last pass to linearize about, or empty.
std::vector<FilterStep> forward(EventFilter& filter, const TrackingEstimator::FilterRun& run,
                                const std::vector<FilterBelief>& about) {
  std::vector<FilterStep> steps;
  steps.push_back({});
  steps.back().after = run.start;
  filter.record_in(&steps);
  FilterBelief belief = run.start;
  for (std::size_t i = 0; i < run.events.size(); ++i) {
    const double sigma = belief.sigma;
    belief.sigma = run.sigmas[i];
    if (belief.sigma > sigma) belief.reported[run.events[i].contact] = -infinity;
    // The end of a burst is a separate step.
    filter.expire(run.events[i].t, belief);
    const std::size_t k = steps.size() - 1;
    const bool known = k < about.size();
    if (!filter.take(run.events[i], belief, known ? &about[k] : nullptr)) break;
    belief.sigma = sigma;
  }
  filter.record_in(nullptr);
  return steps;
}

// Runs backward from the last step to the start, the first step.
std::vector<FilterBelief> backward(const std::vector<FilterStep>& steps) {
  std::vector<FilterBelief> beliefs(steps.size());
  const Eigen::Index size = steps.front().after.z.size();
  Eigen::VectorXd a = Eigen::VectorXd::Zero(size);
  Eigen::MatrixXd B = Eigen::MatrixXd::Identity(size, size);
  for (std::size_t k = steps.size(); k-- > 0;) {
    FilterBelief& belief = beliefs[k];
    belief = steps[k].after;
    belief.z += belief.S * a;
    belief.S = product(belief.S, B);
    if (k == 0) break;
    a = steps[k].mean + steps[k].on_next * a;
    B = root_of_sum(product(steps[k].on_next, B), steps[k].rest);
  }
  return beliefs;
}

// The largest move of the parameters and of the state, in deviations.
double largest_move(EventFilter& filter, const std::vector<FilterBelief>& from,
                    const std::vector<FilterBelief>& to) {
  if (from.size() != to.size()) return infinity;
  double largest = 0.0;
  for (std::size_t k = 0; k < to.size(); ++k) {
    const Eigen::VectorXd x = filter.mean(to[k].t, from[k]);
    for (Eigen::Index i = 0; i < to[k].z.size(); ++i) {
      const double before = i < x.size() ? x[i] : from[k].z[i];
      const double sigma = std::max(to[k].S.row(i).norm(), 1e-12 * std::abs(to[k].z[i]));
      if (sigma > 0.0) largest = std::max(largest, std::abs(to[k].z[i] - before) / sigma);
    }
  }
  return largest;
}

// Sets from when on each belief applies: after an impact slightly before its time, after a burst
// that ends in a sustained contact only when the contact is certainly closed.
void find_begins(Chain& chain) {
  chain.begins.resize(chain.beliefs.size());
  double least = infinity;
  for (std::size_t k = chain.beliefs.size(); k-- > 0;) {
    const FilterBelief& belief = chain.beliefs[k];
    const double sigma = belief.impact.time_sigma;
    double begins = sigma > 0.0 ? belief.impact.time - around_impact * sigma : belief.t;
    if (k > 0 && (chain.beliefs[k - 1].bursting & belief.held & ~belief.bursting) != 0) {
      begins = belief.t + around_impact * belief.sigma;
    }
    least = std::min(least, begins);
    chain.begins[k] = least;
  }
}

// Runs forward and backward, linearized about the path of the last pass, until the path converges.
// Without convergence the run is not smoothed.
Chain smoothed(EventFilter& filter, const TrackingEstimator::FilterRun& run) {
  Chain chain;
  chain.from = run.start.t;
  chain.fits = !run.failed;
  if (!chain.fits) return chain;
  std::vector<FilterStep> steps = forward(filter, run, {});
  chain.beliefs = backward(steps);
  double move = infinity;
  for (int pass = 0; pass < most_passes && !(move < settled_move); ++pass) {
    steps = forward(filter, run, chain.beliefs);
    std::vector<FilterBelief> next = backward(steps);
    move = largest_move(filter, chain.beliefs, next);
    chain.beliefs = std::move(next);
  }
  chain.fits = move < settled_move;
  for (std::size_t k = 1; k < steps.size(); ++k) chain.misfit += steps[k].after.square;
  chain.misfit /= static_cast<double>(std::max<std::size_t>(steps.size() - 1, 1));
  for (std::size_t k = 1; k < steps.size(); ++k) {
    set_impact(filter, chain.beliefs[k - 1], steps[k].contact, chain.beliefs[k]);
  }
  find_begins(chain);
  // All reports have been received, so that none can be late.
  for (FilterBelief& belief : chain.beliefs) belief.sigma = 0.0;
  return chain;
}

// Last belief that applies at t.
const FilterBelief& at(const Chain& chain, double t) {
  const auto later = std::upper_bound(chain.begins.begin() + 1, chain.begins.end(), t);
  return chain.beliefs[static_cast<std::size_t>(later - chain.begins.begin()) - 1];
}

// Runs the estimator forward and smooths each of its filter's runs.
std::vector<Chain> chains_of(TrackingEstimator& estimator, const Scene& scene,
                             std::span<const ContactEvent> events, double end) {
  std::vector<TrackingEstimator::FilterRun> runs;
  estimator.record_runs(&runs);
  std::vector<bool> confirmed;  // per run: the track was confirmed
  drive(estimator, scene, events, end, [&](const TrackingState& state) {
    confirmed.resize(runs.size(), false);
    if (state.track.status == TrackStatus::confirmed && !runs.empty()) confirmed.back() = true;
  });
  std::vector<Chain> chains;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    check_interrupt();
    // A run whose track was never confirmed claims no estimate.
    runs[i].failed = runs[i].failed || !confirmed[i];
    chains.push_back(smoothed(estimator.filter()->filter, runs[i]));
  }
  return chains;
}

std::size_t events_between(std::span<const ContactEvent> events, double from, double to) {
  return static_cast<std::size_t>(
      std::count_if(events.begin(), events.end(),
                    [&](const ContactEvent& event) { return event.t >= from && event.t <= to; }));
}

}  // namespace

std::vector<SmoothedStretch> smooth(
    const Scene& given, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const SmoothedEstimate&, bool)>& take,
    std::stop_token stop) {
  const StopScope scope(std::move(stop));
  if (given.prior.jitter == 0.0 && given.prior.parameters.empty()) {
    throw SmoothingError("event times are exact ([events] jitter is 0): the filter knows all");
  }
  if (is_homogeneous(given.model)) {
    throw SmoothingError("no force and no clearance sets the scale of the machine's motion");
  }
  Scene scene = given;
  scene.prior.parameters.consider.assign(scene.prior.parameters.consider.size(), false);
  const auto f = scene.model.coordinates();
  const double end = tick_instant(last, h).hi;
  TrackingEstimator forward_pass(scene, h, EstimatorKind::both);
  const std::vector<Chain> chains = chains_of(forward_pass, scene, events, end);
  // Second forward pass: its estimate applies between chains.
  TrackingEstimator again(scene, h, EstimatorKind::both);
  Confidence confidence = again.no_confidence();
  SmoothedEstimate estimate;
  estimate.q.setZero(f);
  estimate.u.setZero(f);
  std::vector<SmoothedStretch> stretches;
  std::size_t chain = 0;
  drive(again, scene, events, end, [&](const TrackingState& at_tick) {
    const double t = tick_instant(at_tick.tick, h).hi;
    while (chain + 1 < chains.size() && chains[chain + 1].from <= t) ++chain;
    const bool smooth = at_tick.track.status != TrackStatus::lost && !chains.empty() &&
                        chains[chain].from <= t && chains[chain].fits;
    again.note(at_tick, confidence);
    if (smooth) {
      const FilterBelief& belief = at(chains[chain], t);
      again.filter()->publish(t, belief, estimate.q, estimate.u);
      again.filter()->fill_deviations(t, belief, confidence);
      if (stretches.empty() || stretches.back().to < t - 1.5 * h || at_tick.tick == 0) {
        stretches.push_back({t, t, 0, chains[chain].misfit});
      }
      stretches.back().to = t;
    } else {
      again.output(at_tick, estimate.q, estimate.u);
      again.confidence(at_tick, confidence);
    }
    estimate.sigma_q = confidence.sigma_q;
    estimate.sigma_u = confidence.sigma_u;
    estimate.sigma_gap = confidence.sigma_g;
    estimate.sigma_outputs = confidence.sigma_outputs;
    take(at_tick.tick, estimate, smooth);
  });
  for (SmoothedStretch& stretch : stretches) {
    stretch.events = events_between(events, stretch.from, stretch.to);
  }
  return stretches;
}

}  // namespace sprag
