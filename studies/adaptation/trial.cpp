#include "studies/adaptation/trial.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/machine_adaptation.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/energy.h"
#include "studies/common/later.h"
#include "studies/common/random.h"

namespace sprag::adaptation_study {
namespace {

using common::Random;

double share(Random& draw, double least) {
  return (draw.uniform() < 0.5 ? -1.0 : 1.0) * draw.uniform(least, 1.0);
}

// The scene that the observer receives.
Scene wrong_scene(const Scene& machine, const Trial& trial, Random& draw) {
  const SceneValues family(machine, trial.only.empty()
                                        ? unknowns_to_adapt(machine)
                                        : std::vector{parameter_of(machine, trial.only)});
  Eigen::VectorXd values = nominal_values(family.unknowns());
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const Parameter& unknown = family.unknowns()[k];
    double& value = values[static_cast<Eigen::Index>(k)];
    const double off = trial.off * share(draw, trial.only.empty() ? 0.5 : 1.0);
    if (quantity(unknown.key) == "phase") {
      value += off;
    } else if (quantity(unknown.key) == "clearance") {
      value += off * (family.groups().empty() ? unknown.unit_step : family.groups()[0].amplitude);
    } else {
      value *= 1.0 + off;
      value = std::min(value, 0.99 * unknown.upper_limit);
    }
  }
  Scene scene = with(machine, family.unknowns(), values);
  scene.prior.jitter = trial.jitter;
  const std::vector<Parameter> free = unknowns_to_adapt(scene);
  scene.prior.adaptation.within[0] = std::max(scene.prior.adaptation.within[0], trial.off);
  scene.prior.adaptation.walk.setZero(static_cast<Eigen::Index>(free.size()));
  for (std::size_t k = 0; k < free.size(); ++k) {
    for (const Move& move : trial.moves) {
      if (move.key == free[k].key) {
        scene.prior.adaptation.walk[static_cast<Eigen::Index>(k)] = trial.walk;
      }
    }
  }
  return scene;
}

// A machine whose parameters move, in small steps.
class MovingMaster {
 public:
  MovingMaster(const Scene& scene, const Trial& trial)
      : family_(scene, unknowns(scene, trial)), trial_(trial), state_(scene.truth.start) {
    next();
  }

  void advance(Instant t, std::vector<ContactEvent>& events) {
    while (piece_ + 1 < pieces() && end(piece_) < t.hi) {
      advance_piece(at(end(piece_)), events);
      state(at(end(piece_)), state_.q, state_.u);
      ++piece_;
      next();
    }
    advance_piece(t, events);
  }

  void state(Instant t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u) {
    master_->state(at(t - at(begin_)), q, u);
  }

 private:
  static std::vector<Parameter> unknowns(const Scene& scene, const Trial& trial) {
    std::vector<Parameter> all;
    for (const Move& move : trial.moves) all.push_back(parameter_of(scene, move.key));
    return all;
  }
  int pieces() const { return trial_.moves.empty() ? 1 : 400; }
  double end(int piece) const { return trial_.duration * (piece + 1) / pieces(); }

  void next() {
    Eigen::VectorXd values = nominal_values(family_.unknowns());
    for (std::size_t k = 0; k < trial_.moves.size(); ++k) {
      values[static_cast<Eigen::Index>(k)] *=
          1.0 + trial_.moves[k].share * (piece_ + 0.5) / pieces();
    }
    begin_ = piece_ == 0 ? 0.0 : end(piece_ - 1);
    master_.emplace(
        common::later(with(family_.nominal(), family_.unknowns(), values).model, begin_), state_);
  }

  void advance_piece(Instant t, std::vector<ContactEvent>& events) {
    const std::size_t first = events.size();
    master_->advance(at(t - at(begin_)), events);
    for (std::size_t i = first; i < events.size(); ++i) events[i].t += begin_;
  }

  SceneValues family_;
  const Trial& trial_;
  State state_;
  int piece_ = 0;
  double begin_ = 0.0;
  std::optional<Master> master_;
};

// Reports of a machine's events: with jitter and spurious pulses, and some of them lost.
class Reports {
 public:
  Reports(const Scene& machine, const Trial& trial, Random& draw)
      : trial_(trial), draw_(&draw), master_(machine, trial) {}

  // Reports up to t, into `reported`.
  void advance(Instant t, std::vector<ContactEvent>& reported) {
    // Jittered times may cross ticks, so the machine runs ahead by six standard deviations.
    const double lead = 6.0 * trial_.jitter + trial_.tick;
    drawn_.clear();
    master_.advance(at(t.hi + lead), drawn_);
    for (const ContactEvent& event : drawn_) report(event);
    reported.clear();
    while (!ahead_.empty() && ahead_.front().t <= t.hi) {
      reported.push_back(ahead_.front());
      ahead_.erase(ahead_.begin());
    }
  }

 private:
  void report(ContactEvent event) {
    if (draw_->uniform() < trial_.spurious) {
      const double before = last_ + draw_->uniform() * std::max(event.t - last_, 0.0);
      last_ = std::max(last_, before);
      if (chi_ == 0) ahead_.push_back({last_, event.contact, ContactEventKind::pulse});
    }
    // Reports keep their order.
    event.t = last_ = std::max(event.t + trial_.jitter * draw_->normal(), last_);
    const bool contradicts =
        contains(chi_, event.contact) != (event.kind == ContactEventKind::opens);
    if (contradicts || draw_->uniform() < trial_.lost) return;
    chi_ = after(chi_, event);
    ahead_.push_back(event);
  }

  Trial trial_;
  Random* draw_;
  MovingMaster master_;
  std::vector<ContactEvent> drawn_, ahead_;
  double last_ = 0.0;
  ContactSet chi_ = 0;
};

// True values at the end, as the trial has moved them.
Eigen::VectorXd final_values(const Scene& machine, const Trial& trial) {
  const SceneValues family(machine, unknowns_to_adapt(machine));
  Eigen::VectorXd values = nominal_values(family.unknowns());
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    for (const Move& move : trial.moves) {
      if (move.key == family.unknowns()[k].key) {
        values[static_cast<Eigen::Index>(k)] *= 1.0 + move.share;
      }
    }
  }
  return values;
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double Outcome::floor(double from, double Tick::*of) const {
  std::vector<double> of_ticks;
  for (const Tick& tick : ticks) {
    if (tick.t >= from) of_ticks.push_back(tick.*of);
  }
  return median(std::move(of_ticks));
}

double Outcome::worse_than_replica(double factor) const {
  const auto worse = std::count_if(ticks.begin(), ticks.end(), [&](const Tick& tick) {
    return tick.V > factor * tick.V_replica;
  });
  return static_cast<double>(worse) / static_cast<double>(ticks.size());
}

Outcome run(const Scene& machine, const Trial& trial, std::uint64_t seed) {
  Random draw(seed);
  const Scene scene = wrong_scene(machine, trial, draw);
  MovingMaster master(machine, trial);
  const ErrorEnergy energy(machine.model);
  TrackingEstimator adaptive(scene, trial.tick, EstimatorKind::adaptive);
  Replica replica(scene, trial.tick);
  TrackingEstimator both(scene, trial.tick, EstimatorKind::both);
  TrackingState of_both;
  both.start(scene.prior.start, 0, 0, of_both);
  TrackingState state;
  ReplicaState of_replica;
  adaptive.start(scene.prior.start, 0, 0, state);
  replica.start(scene.prior.start, 0, 0, of_replica);
  const Eigen::Index f = machine.model.coordinates();
  Eigen::VectorXd q_m(f), u_m(f), q(f), u(f);
  Confidence confidence = adaptive.no_confidence();
  MachineAdaptation adaptation(adaptive);
  adaptation.start(0.0, 0);
  Outcome outcome;
  Reports reports(machine, trial, draw);
  const auto ticks = last_tick(trial.duration, trial.tick);
  std::vector<ContactEvent> drawn, reported;
  for (std::int64_t k = 1; k <= ticks; ++k) {
    const Instant t = tick_instant(k, trial.tick);
    const std::clock_t begin = std::clock();
    if (adaptation.settle(reported, state)) {
      adaptation.identify(state);
      outcome.longest_identification =
          std::max(outcome.longest_identification,
                   static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    reports.advance(t, reported);
    for (const ContactEvent& event : reported) outcome.events.push_back(event.t);
    adaptive.tick(reported, state);
    replica.tick(reported, of_replica);
    both.tick(reported, of_both);
    drawn.clear();
    master.advance(t, drawn);
    master.state(t, q_m, u_m);
    adaptive.output(state, q, u);
    adaptive.confidence(state, confidence);
    Tick tick{.t = t.hi, .V = energy(q_m, u_m, q, u)[0]};
    tick.of_filter = confidence.from_filter;
    tick.energy = 0.5 * (machine.model.M.diagonal().dot(confidence.sigma_u.cwiseAbs2()) +
                         machine.model.K.diagonal().dot(confidence.sigma_q.cwiseAbs2()));
    replica.output(of_replica, q, u);
    tick.V_replica = energy(q_m, u_m, q, u)[0];
    both.output(of_both, q, u);
    tick.V_both = energy(q_m, u_m, q, u)[0];
    outcome.ticks.push_back(tick);
    const double accepted = confidence.parameters.accepted;
    if (accepted >= 0.0 && (outcome.accepted.empty() || outcome.accepted.back() != accepted)) {
      outcome.accepted.push_back(accepted);
    }
  }
  outcome.identifications = confidence.parameters.identifications;
  outcome.inconsistencies = confidence.inconsistencies;
  outcome.values = confidence.parameters.values;
  outcome.sigmas = confidence.parameters.sigmas;
  outcome.truth = final_values(machine, trial);
  return outcome;
}

}  // namespace sprag::adaptation_study
