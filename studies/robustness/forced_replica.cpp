#include "studies/robustness/forced_replica.h"

namespace sprag::robustness {

void ForcedReplica::start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state) {
  state.tick = k;
  enter(start, chi, tick_instant(k, h_), state);
}

void ForcedReplica::enter(const sprag::State& x, ContactSet locked, Instant t, State& state) {
  const Contact& contact = flows_.dynamics().model().contacts[0];
  const Eigen::VectorXd held =
      Eigen::VectorXd::Constant(locked == 0 ? 0 : 1, gap(contact, x.q, t.hi));
  flows_[locked].enter(x.q, x.u, t, held, state.motion);
}

void ForcedReplica::tick(std::span<const ContactEvent> events, State& state) {
  const Dynamics& dynamics = flows_.dynamics();
  const Contact& contact = dynamics.model().contacts[0];
  Motion& motion = state.motion;
  ++state.tick;
  for (const ContactEvent& event : events) {
    motion.flow->propagate(motion, at(event.t), motion);
    sprag::State x{Eigen::VectorXd(dynamics.coordinates()),
                   Eigen::VectorXd(dynamics.coordinates())};
    motion.flow->state(motion, x.q, x.u);
    if (event.kind != ContactEventKind::opens) {
      const double epsilon = event.kind == ContactEventKind::pulse ? contact.restitution : 0.0;
      const double gamma = gap_velocity(contact, x.u, event.t);
      x.u -= (1.0 + epsilon) * gamma / dynamics.G()(0, 0) * dynamics.MinvW().col(0);
    }
    enter(x, after(motion.flow->locked(), event), at(event.t), state);
  }
  motion.flow->propagate(motion, tick_instant(state.tick, h_), motion);
}

void ForcedReplica::output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                           Eigen::Ref<Eigen::VectorXd> u) const {
  state.motion.flow->state(state.motion, q, u);
}

}  // namespace sprag::robustness
