#include "mechanics/error_bound.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "mechanics/impact_law.h"

namespace sprag {
namespace {

constexpr double epsilon_machine = std::numeric_limits<double>::epsilon();

// Roundings of a state from one event to the next, in ulps: generous.
constexpr double state_ulps = 64.0;
// Of an event's time, which moves a state by omega times as much.
constexpr double time_ulps = 4.0;

// The master completes a chatter with a velocity left that is of the size of its acceleration times
// chatter_time: generous.
constexpr double chatter_remainders = 8.0;

bool law_is_monotone(const Model& model) {
  if (model.contacts.size() <= 1) return true;
  return model.law == ImpactLaw::poisson &&
         std::all_of(model.contacts.begin(), model.contacts.end(), [&](const Contact& contact) {
           return contact.restitution == model.contacts.front().restitution;
         });
}

double quadratic_form(const Eigen::MatrixXd& A, bool diagonal, const Eigen::VectorXd& x) {
  if (diagonal) return (A.diagonal().array() * x.array().square()).sum();
  double sum = 0.0;
  for (Eigen::Index j = 0; j < x.size(); ++j) sum += x[j] * A.col(j).dot(x);
  return sum;
}

}  // namespace

double ErrorBoundState::bound(double initial) const {
  return std::pow(std::sqrt(initial * share) + rounding, 2);
}

ErrorBound::ErrorBound(const Flows& flows)
    : flows_(&flows), guaranteed_(law_is_monotone(flows.dynamics().model())) {
  const Flow& free = flows[0];
  const Eigen::Index n = free.size();
  omega_max_ = n > 0 ? free.oscillators().root_kappa().maxCoeff() : 0.0;
  unit_z_ = {Eigen::ArrayXd::Ones(n), Eigen::ArrayXd::Zero(n)};
  unit_v_ = {Eigen::ArrayXd::Zero(n), Eigen::ArrayXd::Ones(n)};
  from_z_ = unit_z_;
  from_v_ = unit_v_;
  no_alpha_.setZero(n);
  q_.setZero(flows.dynamics().coordinates());
  u_.setZero(flows.dynamics().coordinates());
}

void ErrorBound::start(Instant t, ErrorBoundState& state) const {
  state = {};
  state.free_since = t;
}

double ErrorBound::contraction(double tau) {
  const Flow& free = (*flows_)[0];
  if (free.path() == FlowPath::dense) return 1.0;
  const Oscillators& o = free.oscillators();
  const Eigen::Index nf = free.frequencies();
  o.propagate(unit_z_, no_alpha_, tau, nf, free.modes(), from_z_);
  o.propagate(unit_v_, no_alpha_, tau, nf, free.modes(), from_v_);
  double largest = 0.0;
  for (Eigen::Index i = nf; i < nf + free.modes(); ++i) {
    const double omega = o.root_kappa()[i];
    // In (omega z, v), whose length is the energy; without stiffness in v alone.
    const bool rigid = omega == 0.0;
    const double zz = rigid ? 0.0 : from_z_.z[i];
    const double vz = rigid ? 0.0 : from_z_.v[i] / omega;
    const double zv = from_v_.z[i] * omega;
    const double vv = from_v_.v[i];
    const double a = zz * zz + vz * vz;
    const double d = zv * zv + vv * vv;
    const double b = zz * zv + vz * vv;
    largest = std::max(largest, 0.5 * (a + d) + std::hypot(0.5 * (a - d), b));
  }
  return std::min(1.0, largest + state_ulps * epsilon_machine);
}

void ErrorBound::land(const Motion& motion, ErrorBoundState& state) {
  const double sigma2 = contraction(motion.t - state.free_since);
  state.share *= sigma2;
  state.rounding *= std::sqrt(sigma2);
}

void ErrorBound::strike(ContactSet closed, ContactSet staying, std::span<const double> epsilon,
                        const Motion& motion, ErrorBoundState& state) {
  add_rounding(motion, state);
  if (std::popcount(closed) < 2) return;
  if (closed == staying) {
    const double chatter_time = flows_->dynamics().model().chatter_time;
    state.rounding += chatter_remainders * omega_max_ * chatter_time * std::sqrt(state.energy);
    return;
  }
  const double growth = this->growth(closed, epsilon);
  state.share *= growth * growth;
  state.rounding *= growth;
}

// With the largest restitution for all, an impact expands nothing. What the others lack, D =
// epsilon_max - E, takes M^-1 W D Lambda_C from it, and |M^-1 W Lambda_C|_M <= |u-|_M. So distances
// grow by 1 + sqrt(trace(G^-1 D G D)) at most.
double ErrorBound::growth(ContactSet closed, std::span<const double> epsilon) const {
  const auto of = [&](int i) { return epsilon[static_cast<std::size_t>(i)]; };
  double largest = 0.0;
  for_each(closed, [&](int i) { largest = std::max(largest, of(i)); });
  const ContactMatrix G = of_contacts(flows_->dynamics().G(), closed);
  ContactVector column(G.rows()), solved;
  double trace = 0.0;
  Eigen::Index j = 0;
  for_each(closed, [&](int contact) {
    const double lacks = largest - of(contact);
    if (lacks > 0.0) {
      Eigen::Index i = 0;
      for_each(closed, [&](int other) {
        column[i] = -(largest - of(other)) * G(i, j) * lacks;
        ++i;
      });
      const bool independent = arrest(G, column, solved) == Solved::yes;
      trace += independent ? solved[j] : std::numeric_limits<double>::infinity();
    }
    ++j;
  });
  return 1.0 + std::sqrt(std::max(trace, 0.0));
}

void ErrorBound::add_rounding(const Motion& motion, ErrorBoundState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = dynamics.model();
  motion.flow->state(motion, q_, u_);
  state.energy = std::max(state.energy, 0.5 * (quadratic_form(model.M, dynamics.diagonal(), u_) +
                                               quadratic_form(model.K, dynamics.diagonal(), q_)));
  const double ulps = state_ulps + time_ulps * omega_max_ * motion.t.hi;
  state.rounding += epsilon_machine * ulps * std::sqrt(state.energy);
}

}  // namespace sprag
