// The observer as a library (observer.h) with any estimator: TimeLine, what waits behind the
// horizon, and a provisional state ahead of what is settled.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sprag/bound/guarantee.h"
#include "sprag/estimation/confidence.h"
#include "sprag/estimation/observer.h"
#include "sprag/estimation/penetration.h"
#include "sprag/estimation/time_line.h"
#include "sprag/mechanics/scalars.h"
#include "sprag/mechanics/scale.h"

namespace sprag {

/// What an Observer is made of.
class Observer::Core {
 public:
  virtual ~Core() = default;
  virtual bool take(const ContactEvent& event) = 0;
  virtual void set_horizon(double t) = 0;
  virtual std::vector<Estimate> settle() = 0;
  virtual Estimate at(double t) = 0;
  virtual void set_end(double t) = 0;
  virtual double tick() const = 0;
  virtual const EventHistory& events() const = 0;
};

/// What an Observer does with an estimator of type E. After each settled tick `between` may give
/// the estimator what its next one waits for.
template <Estimator E>
class ObserverCore final : public Observer::Core {
 public:
  using Between = std::function<void(E&, const typename E::State&)>;

  ObserverCore(const Scene& scene, const ObserverSettings& settings, double bound,
               Between between = {})
      : supports_(scene.model.contacts),
        length_(length_scale(scene.model, scene.replica)),
        contacts_(static_cast<int>(scene.model.contacts.size())),
        outputs_(scene.model.outputs),
        estimator_(scene, settings.tick, settings.estimator, settings.stepper),
        time_line_(estimator_, contacts_, scene.replica, history),
        initial_bound_(bound),
        between_(std::move(between)),
        confidence_(estimator_.no_confidence()),
        q_(scene.model.coordinates()),
        u_(scene.model.coordinates()) {
    guarantee_ = guarantee_of(scene, estimator_);
    if (guarantee_) {
      if (std::isfinite(bound)) guarantee_->prepare(confidence_);
      time_line_.set_lag(guarantee_->lag());
    }
    time_line_.restart(0, 0, 0, no_horizon);
    settled_ = time_line_.present();
  }

  bool take(const ContactEvent& event) override {
    // The history refuses it and says why.
    if (!(event.t >= 0.0) || !std::isfinite(event.t) || event.contact < 0 ||
        event.contact >= contacts_ || event.t <= time_line_.events().horizon()) {
      time_line_.receive(event);
      return false;
    }
    insert(event, waiting_);
    if (ahead_ && event.t <= time_of(ahead_->tick)) ahead_.reset();
    if (ahead_) insert(event, known_);
    return true;
  }

  void set_horizon(double t) override {
    if (!(t > time_line_.events().horizon())) return;
    const auto end =
        std::upper_bound(waiting_.begin(), waiting_.end(), ContactEvent{t, 0, {}}, earlier);
    for (auto event = waiting_.begin(); event != end; ++event) time_line_.receive(*event);
    waiting_.erase(waiting_.begin(), end);
    time_line_.set_horizon(t);
  }

  std::vector<Estimate> settle() override {
    std::vector<Estimate> estimates;
    time_line_.run(
        0, [](const auto&) {},
        [&](const State& state) {
          const bool complete = time_line_.complete_to(time_of(state.tick));
          estimates.push_back(estimate(state, true, complete ? initial_bound_ : infinity));
          settled_ = state;
          if (between_) between_(estimator_, state);
          return true;
        });
    if (!estimates.empty()) ahead_.reset();
    return estimates;
  }

  Estimate at(double t) override {
    if (!(t >= time_of(settled_.tick)) || !std::isfinite(t)) {
      throw std::invalid_argument("no estimate at t = " + std::to_string(t) +
                                  ": it must be at or after the last settled tick");
    }
    const std::int64_t last = last_tick(t, tick());
    if (!ahead_ || ahead_->tick > last) start_ahead();
    while (ahead_->tick < last) step_ahead();
    return estimate(*ahead_, false, infinity);
  }

  void set_end(double t) override {
    if (guarantee_) guarantee_->set_end(t, time_line_);
  }

  double tick() const override { return estimator_.h(); }
  const EventHistory& events() const override { return time_line_.events(); }

 private:
  using State = typename E::State;
  // What is settled is never gone back behind.
  static constexpr std::int64_t history = 1;

  static bool earlier(const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; }
  // Behind those of the same instant.
  static void insert(const ContactEvent& event, std::vector<ContactEvent>& ordered) {
    ordered.insert(std::upper_bound(ordered.begin(), ordered.end(), event, earlier), event);
  }

  double time_of(std::int64_t k) const { return tick_instant(k, estimator_.h()).hi; }

  // The next events up to this tick; what contradicts those before it is left out.
  std::span<const ContactEvent> events_of(std::int64_t tick, ContactSet chi) {
    of_tick_.clear();
    for (; next_ < known_.size() && first_tick_after(known_[next_].t, estimator_.h()) <= tick;
         ++next_) {
      const ContactEvent& event = known_[next_];
      if (contains(chi, event.contact) != (event.kind == ContactEventKind::opens)) continue;
      chi = after(chi, event);
      of_tick_.push_back(event);
    }
    return of_tick_;
  }

  // From the last tick handed out, with all that is known behind it.
  void start_ahead() {
    const auto& history_events = time_line_.events().events();
    const bool from_start = time_line_.handed_out() < 0;
    known_.clear();
    for (const ContactEvent& event : history_events) {
      const bool behind = first_tick_after(event.t, estimator_.h()) > settled_.tick;
      if (behind || from_start) known_.push_back(event);
    }
    known_.insert(known_.end(), waiting_.begin(), waiting_.end());
    next_ = 0;
    ahead_ = settled_;
    if (!from_start) return;
    for_each_instant(
        events_of(settled_.tick, ahead_->chi),
        [&](std::span<const ContactEvent> of_one) { estimator_.apply(of_one, *ahead_); });
  }

  void step_ahead() {
    const std::span<const ContactEvent> events = events_of(ahead_->tick + 1, ahead_->chi);
    if constexpr (requires { estimator_.most_ahead(); }) {
      if (next_ > estimator_.most_ahead()) {
        ahead_.reset();
        throw std::invalid_argument("more than " + std::to_string(estimator_.most_ahead()) +
                                    " events behind what is settled: settle some first");
      }
    }
    estimator_.tick(events, *ahead_);
  }

  Estimate estimate(const State& state, bool settled, double bound) {
    estimator_.output(state, q_, u_);
    estimator_.confidence(state, bound, confidence_);
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
    // An adaptive filter has supports of its own.
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
    return estimate;
  }

  std::vector<Contact> supports_;
  double length_;
  int contacts_;
  std::vector<Output> outputs_;
  E estimator_;
  TimeLine<E> time_line_;
  double initial_bound_;
  Between between_;
  Confidence confidence_;
  std::unique_ptr<Guarantee> guarantee_;
  Eigen::VectorXd q_, u_;
  State settled_;                      // at the last tick handed out; at first, at tick 0
  std::vector<ContactEvent> waiting_;  // behind the horizon, in order
  std::optional<State> ahead_;         // and further, provisional
  std::vector<ContactEvent> known_;    // what ahead_ goes through, `next_` comes next
  std::size_t next_ = 0;
  std::vector<ContactEvent> of_tick_;
};

}  // namespace sprag
