#include "sprag/observer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <utility>

#include "sprag/confidence.h"
#include "sprag/detail/bound/guarantee.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/drive.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/mechanics/state_size.h"
#include "sprag/detail/replica/penetration.h"

namespace sprag {
namespace {

// Sets n rows; the columns are those of the first estimate.
void resize(Eigen::Index n, const Estimate& first, Estimates& all) {
  all.t.resize(n);
  all.q.resize(n, first.q.size());
  all.u.resize(n, first.u.size());
  all.sigma_q.resize(n, first.sigma_q.size());
  all.sigma_u.resize(n, first.sigma_u.size());
  all.sigma_gap.resize(n, first.sigma_gap.size());
  all.outputs.resize(n, first.outputs.size());
  all.sigma_outputs.resize(n, first.sigma_outputs.size());
  all.bound.resize(n);
  all.bound_q.resize(n, first.bound_q.size());
  all.bound_gap.resize(n, first.bound_gap.size());
  all.bound_outputs.resize(n, first.bound_outputs.size());
  all.of_filter.resize(static_cast<std::size_t>(n));
  all.penetrating.resize(static_cast<std::size_t>(n));
  all.parameters.resize(n, first.parameters.values.size());
  all.sigma_parameters.resize(n, first.parameters.sigmas.size());
  if (first.parameters.any()) all.keys = *first.parameters.keys;
}

void require_tick(double tick) {
  if (!(tick > 0.0) || !std::isfinite(tick)) {
    throw std::invalid_argument("tick is " + std::to_string(tick) + "; must be > 0");
  }
}

}  // namespace

// A TimeLine up to the horizon, the events after it, and a copy of both that runs ahead.
class Observer::Core {
 public:
  Core(const Scene& scene, const ObserverSettings& settings)
      : supports_(scene.model.contacts),
        length_(length_scale(scene.model, scene.prior.start)),
        contacts_(static_cast<int>(scene.model.contacts.size())),
        outputs_(scene.model.outputs),
        estimator_(scene, settings.tick, settings.estimator),
        time_line_(estimator_, contacts_, scene.prior.start, history),
        confidence_(estimator_.no_confidence()),
        q_(scene.model.coordinates()),
        u_(scene.model.coordinates()) {
    guarantee_ = guarantee_of(scene, estimator_);
    if (guarantee_) {
      guarantee_->prepare(confidence_);
      time_line_.set_lag(guarantee_->lag());
    }
    time_line_.restart(0, 0, 0, no_horizon);
  }

  bool take(const ContactEvent& event) {
    // The history refuses the event and counts the reason.
    if (!(event.t >= 0.0) || !std::isfinite(event.t) || event.contact < 0 ||
        event.contact >= contacts_ || event.t <= time_line_.events().horizon()) {
      time_line_.receive(event);
      return false;
    }
    const auto later = std::upper_bound(waiting_.begin(), waiting_.end(), event, earlier);
    if (ahead_ && (later != waiting_.end() || event.t <= time_of(ahead_->now()))) ahead_.reset();
    if (ahead_) ahead_->receive(event);
    waiting_.insert(later, event);
    return true;
  }

  void set_horizon(double t) {
    if (!(t > time_line_.events().horizon())) return;
    const auto end =
        std::upper_bound(waiting_.begin(), waiting_.end(), ContactEvent{t, 0, {}}, earlier);
    for (auto event = waiting_.begin(); event != end; ++event) time_line_.receive(*event);
    waiting_.erase(waiting_.begin(), end);
    time_line_.set_horizon(t);
  }

  std::vector<Estimate> settle(const std::stop_token& stop) {
    std::vector<Estimate> estimates;
    const auto take = [&](const TrackingState& state) {
      estimates.push_back(estimate(state, true));
      return true;
    };
    while (!stop.stop_requested() &&
           !sprag::settle(time_line_, max_tick, take, ticks_between_checks)) {
    }
    if (!estimates.empty()) ahead_.reset();
    return estimates;
  }

  Estimate at(double t, const std::stop_token& stop) {
    if (!(t >= time_of(std::max<std::int64_t>(time_line_.handed_out(), 0))) || !std::isfinite(t)) {
      throw std::invalid_argument("no estimate at t = " + std::to_string(t) +
                                  ": it must be at or after the last settled tick");
    }
    const std::int64_t last = last_tick(t, tick());
    if (!ahead_ || ahead_->now() > last) {
      ahead_.emplace(time_line_);
      for (const ContactEvent& event : waiting_) ahead_->receive(event);
    }
    if (ahead_->now() == last) return estimate(ahead_->present(), false);
    Estimate of_last;
    const auto on_tick = [&](const TrackingState& state) {
      if (state.tick == last) of_last = estimate(state, false);
    };
    const auto pass = [](const TrackingState&) { return true; };
    while (!ahead_->run(last, on_tick, pass, ticks_between_checks)) {
      if (stop.stop_requested()) throw Interrupted();
    }
    return of_last;
  }

  void set_end(double t) {
    if (guarantee_) guarantee_->set_end(t, time_line_);
  }

  double tick() const { return estimator_.h(); }
  const EventHistory& events() const { return time_line_.events(); }

 private:
  // Settled ticks are never rolled back.
  static constexpr std::int64_t history = 1;
  static constexpr std::int64_t ticks_between_checks = 16;  // of the stop token

  static bool earlier(const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; }

  double time_of(std::int64_t k) const { return tick_instant(k, estimator_.h()).hi; }

  Estimate estimate(const TrackingState& state, bool settled) {
    estimator_.output(state, q_, u_);
    estimator_.confidence(state, confidence_);
    const double t = time_of(state.tick);
    if (guarantee_) {
      guarantee_->complete(time_line_, t, settled, estimator_, state, q_, u_, confidence_);
    }
    Estimate estimate;
    estimate.tick = state.tick;
    estimate.t = t;
    estimate.q = q_;
    estimate.u = u_;
    estimate.closed = state.chi;
    estimate.settled = settled;
    estimate.of_filter = confidence_.from_filter;
    // An adaptive filter has its own clearances.
    estimate.penetrating =
        !(confidence_.parameters.any() && confidence_.from_filter) &&
        penetration(supports_, q_, estimate.t, confidence_.sigma_g, length_) > 0.0;
    estimate.sigma_q = confidence_.sigma_q;
    estimate.sigma_u = confidence_.sigma_u;
    estimate.sigma_gap = confidence_.sigma_g;
    const auto outputs = static_cast<Eigen::Index>(outputs_.size());
    estimate.outputs.resize(outputs);
    for (Eigen::Index i = 0; i < outputs; ++i) {
      estimate.outputs[i] = value(outputs_[static_cast<std::size_t>(i)], q_, u_);
    }
    if (confidence_.has_filter) {
      estimate.sigma_outputs = confidence_.sigma_outputs;
    } else {
      estimate.sigma_outputs.setConstant(outputs, std::numeric_limits<double>::infinity());
    }
    estimate.bound = confidence_.bound;
    estimate.bound_q = confidence_.bound_q;
    estimate.bound_gap = confidence_.bound_g;
    estimate.bound_outputs = confidence_.bound_outputs;
    estimate.parameters = confidence_.parameters;
    estimate.inconsistencies = confidence_.inconsistencies;
    estimate.last = confidence_.last;
    return estimate;
  }

  std::vector<Contact> supports_;
  double length_;
  int contacts_;
  std::vector<Output> outputs_;
  TrackingEstimator estimator_;
  TimeLine time_line_;
  Confidence confidence_;
  std::unique_ptr<Guarantee> guarantee_;
  Eigen::VectorXd q_, u_;
  std::vector<ContactEvent> waiting_;  // events after the horizon, in order
  std::optional<TimeLine> ahead_;      // of the provisional estimates; empty: copy time_line_ anew
};

Observer::Observer(const Scene& scene, const ObserverSettings& settings) {
  require_tick(settings.tick);
  require_size(scene.prior.start, scene.model.coordinates(), "the replica's start");
  core_ = std::make_unique<Core>(scene, settings);
}

Observer::~Observer() = default;
Observer::Observer(Observer&&) noexcept = default;
Observer& Observer::operator=(Observer&&) noexcept = default;

bool Observer::take(const ContactEvent& event) { return core_->take(event); }
void Observer::set_horizon(double t) { core_->set_horizon(t); }
std::vector<Estimate> Observer::settle(std::stop_token stop) { return core_->settle(stop); }
Estimate Observer::at(double t, std::stop_token stop) { return core_->at(t, stop); }
void Observer::set_end(double t) { core_->set_end(t); }
double Observer::tick() const { return core_->tick(); }
const EventCounts& Observer::counts() const { return core_->events().counts(); }

const std::vector<DegradedInterval>& Observer::degraded() const {
  return core_->events().degraded();
}

Estimates observe(const Scene& scene, std::span<const ContactEvent> events, double duration,
                  const ObserverSettings& settings, std::stop_token stop) {
  const StopScope scope(std::move(stop));
  return observe(Observer(scene, settings), events, duration);
}

Estimates observe(Observer observer, std::span<const ContactEvent> events, double duration,
                  std::stop_token stop) {
  const StopScope scope(std::move(stop));
  if (!(duration >= 0.0) || !std::isfinite(duration)) {
    throw std::invalid_argument("duration is " + std::to_string(duration) + "; must be >= 0");
  }
  const double h = observer.tick();
  const Eigen::Index n = last_tick(duration, h) + 1;
  Estimates all;
  for (const ContactEvent& event : events) {
    if (event.t <= duration) observer.take(event);
  }
  observer.set_end(duration);
  // In pieces, to limit the memory of estimates held twice.
  constexpr Eigen::Index piece = 4096;
  Eigen::Index last = -1;
  std::int64_t inconsistencies = 0;
  for (Eigen::Index k = 0; k < n;) {
    check_interrupt();
    last = std::min(last + piece, n - 1);
    observer.set_horizon(last == n - 1 ? duration : tick_instant(last, h).hi);
    for (const Estimate& estimate : observer.settle()) {
      if (k == 0) resize(n, estimate, all);
      all.t[k] = estimate.t;
      all.q.row(k) = estimate.q;
      all.u.row(k) = estimate.u;
      all.sigma_q.row(k) = estimate.sigma_q;
      all.sigma_u.row(k) = estimate.sigma_u;
      all.sigma_gap.row(k) = estimate.sigma_gap;
      all.parameters.row(k) = estimate.parameters.values;
      all.sigma_parameters.row(k) = estimate.parameters.sigmas;
      all.outputs.row(k) = estimate.outputs;
      all.sigma_outputs.row(k) = estimate.sigma_outputs;
      all.bound[k] = estimate.bound;
      all.bound_q.row(k) = estimate.bound_q;
      all.bound_gap.row(k) = estimate.bound_gap;
      all.bound_outputs.row(k) = estimate.bound_outputs;
      all.of_filter[static_cast<std::size_t>(k)] = estimate.of_filter ? 1 : 0;
      all.penetrating[static_cast<std::size_t>(k)] = estimate.penetrating ? 1 : 0;
      if (estimate.inconsistencies > inconsistencies) {
        all.inconsistencies.push_back(estimate.last);
        inconsistencies = estimate.inconsistencies;
      }
      ++k;
    }
  }
  all.counts = observer.counts();
  return all;
}

}  // namespace sprag
