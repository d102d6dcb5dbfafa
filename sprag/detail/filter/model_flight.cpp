#include "sprag/detail/filter/model_flight.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {

ModelFlight::ModelFlight(std::shared_ptr<Flows> flows)
    : flows_(std::move(flows)), f_(flows_->dynamics().coordinates()), impact_(flows_->dynamics()) {
  build_foreseeable(*flows_);
  const Dynamics& dynamics = flows_->dynamics();
  const Flow& flow = free();
  first_ = flow.frequencies();
  q_.setZero(f_);
  u_.setZero(f_);
  flow.enter(q_, u_, Instant{}, Eigen::VectorXd(0), motion_);
  closed_ = motion_;
  double slowest = infinity;
  for (Eigen::Index i = 0; i < f_; ++i) {
    const double frequency = flow.oscillators().root_kappa()[first_ + i];
    fastest_ = std::max(fastest_, frequency);
    if (frequency > 0.0) slowest = std::min(slowest, frequency);
  }
  if (slowest < infinity) slowest_ = slowest;
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(2 * f_, 2 * f_);
  to_state_.setZero(2 * f_, 2 * f_);
  from_state_ = to_state_;
  flow.state_differences(unit.topRows(f_), unit.bottomRows(f_), to_state_.topRows(f_),
                         to_state_.bottomRows(f_));
  flow.enter_differences(unit.topRows(f_), unit.bottomRows(f_), from_state_.topRows(f_),
                         from_state_.bottomRows(f_));
  kicks_ = product(from_state_.rightCols(f_), dynamics.MinvW());
  const Model& model = this->model();
  energy_ =
      congruent(to_state_.topRows(f_), model.K) + congruent(to_state_.bottomRows(f_), model.M);
  for (OscillatorKernels* of : {&kernels_, &turn_}) of->resize(flow.size());
  for (Eigen::MatrixXd* of : {&Q_, &U_, &Z_, &V_, &deflection_}) of->setZero(f_, 2 * f_);
  x_.setZero(2 * f_);
  by_c_.resize(2 * f_, 0);
  for (Eigen::VectorXd* of : {&u_before_, &difference_}) of->setZero(f_);
  gaps_.setZero(contacts());
  if (has_curves(model)) bend_.setZero(2 * f_);
  restitution_.resize(contacts());
  for (int i = 0; i < contacts(); ++i) restitution_[i] = restitution(i);
  closings_.reserve(static_cast<std::size_t>(contacts()));
  for (int i = 0; i < contacts(); ++i) gaps_to_watch_.push_back({&flow.gap(i), 1.0, 0, i});
  search_.reserve(gaps_to_watch_.size(), flow.size());
  for (Eigen::VectorXd* of : {&direction_, &by_velocity_, &by_time_, &rates_}) of->setZero(2 * f_);
}

void ModelFlight::set(const ConstVector&, bool) {}
void ModelFlight::carry_by_unknown(Eigen::Index, Vector) {}
bool ModelFlight::changes_flow(Eigen::Index) const { return false; }
void ModelFlight::differences(int, bool, Vector, Vector) const {}

bool ModelFlight::can_hold(ContactSet held) const {
  return held == 0 || flows_->find(held) != nullptr;
}

ContactSet ModelFlight::independent(ContactSet first, ContactSet closed) const {
  return first | independent_of(flows_->dynamics().G(), first, closed & ~first);
}

void ModelFlight::set_motion(const ConstVector& x, double t) {
  motion_.x.z.segment(first_, f_) = x.head(f_).array();
  motion_.x.v.segment(first_, f_) = x.tail(f_).array();
  // A streamed input may have new samples at the same time.
  if (motion_.t.hi == t && motion_.t.lo == 0.0 && free().sampled() == nullptr) return;
  motion_.t = at(t);
  free().set_phases(motion_.t, motion_.x);
}

// Moves motion_ by tau with these contacts closed.
void ModelFlight::move(double tau, ContactSet held) {
  tau_ = tau;
  held_ = held;
  kernels_known_ = false;
  const Instant end = at(motion_.t.hi + tau);
  const Flow* flow = held == 0 ? nullptr : flows_->find(held);
  if (flow == nullptr) {
    held_ = 0;
    if (tau != 0.0) free().propagate(motion_, end, motion_);
  } else {
    free().state(motion_, q_, u_);
    // A held gap that is not exactly zero keeps its value.
    Eigen::Index k = 0;
    for_each(held, [&](int i) {
      gaps_[k++] = sprag::gap(model().contacts[static_cast<std::size_t>(i)], q_, motion_.t.hi);
    });
    flow->enter(q_, u_, motion_.t, gaps_.head(k), closed_);
    flow->propagate(closed_, end, closed_);
    flow->state(closed_, q_, u_);
    free().enter(q_, u_, end, no_gaps_, motion_);
  }
  x_.head(f_) = motion_.x.z.segment(first_, f_).matrix();
  x_.tail(f_) = motion_.x.v.segment(first_, f_).matrix();
}

void ModelFlight::fly(const ConstVector& x, double t, double tau, ContactSet held) {
  set_motion(x, t);
  move(tau, held);
}

void ModelFlight::fly_on(double tau, ContactSet held) { move(tau, held); }

void ModelFlight::carry(Columns dx) {
  const Flow& flow = held_ == 0 ? free() : *closed_.flow;
  if (!kernels_known_) {
    flow.oscillators().kernels(tau_, first_, flow.modes(), kernels_);
    kernels_known_ = true;
  }
  carry(flow, kernels_, dx);
}

void ModelFlight::turn(double tau, ContactSet held, Columns dx) {
  const Flow* found = held == 0 ? nullptr : flows_->find(held);
  const Flow& flow = found == nullptr ? free() : *found;
  flow.oscillators().kernels(tau, first_, flow.modes(), turn_);
  carry(flow, turn_, dx);
}

void ModelFlight::carry(const Flow& flow, const OscillatorKernels& kernels, Columns dx) {
  if (flow.locked() == 0) {
    kernels.apply(first_, dx.topRows(f_), dx.bottomRows(f_));
    return;
  }
  // In blocks of the scratch matrices' width.
  for (Eigen::Index first = 0; first < dx.cols(); first += Q_.cols()) {
    const Eigen::Index columns = std::min(dx.cols() - first, Q_.cols());
    carry_held(flow, kernels, dx.middleCols(first, columns));
  }
}

void ModelFlight::carry_held(const Flow& flow, const OscillatorKernels& kernels, Columns dx) {
  const Eigen::Index columns = dx.cols(), modes = flow.modes();
  auto Q = Q_.leftCols(columns), U = U_.leftCols(columns);
  auto Z = Z_.topLeftCorner(modes, columns), V = V_.topLeftCorner(modes, columns);
  free().state_differences(dx.topRows(f_), dx.bottomRows(f_), Q, U);
  // A deviation of a held gap is a static deflection and does not change.
  auto deflection = deflection_.leftCols(columns);
  deflection = Q;
  flow.close_gap_differences(Q);
  deflection -= Q;
  flow.enter_differences(Q, U, Z, V);
  kernels.apply(first_, Z, V);
  flow.state_differences(Z, V, Q, U);
  Q += deflection;
  free().enter_differences(Q, U, dx.topRows(f_), dx.bottomRows(f_));
}

Flight::Gap ModelFlight::gap(int contact) const {
  const Signal& g = free().gap(contact);
  const Signal& gamma = free().gap_velocity(contact);
  Gap gap{value(g, motion_), value(gamma, motion_), rate(gamma, motion_), largest_terms(g, motion_),
          0.0};
  gap.rounding = gap.length;
  return gap;
}

double ModelFlight::open_for() {
  constexpr int most_expansions = 16;
  // Under a sampled input the search stops at every sample.
  if (free().sampled() != nullptr) return 0.0;
  search_.begin(motion_, gaps_to_watch_);
  for (int i = 0; i < most_expansions; ++i) {
    const double open = search_.certified();
    if (search_.found() || open == infinity) return open;
    search_.advance(open);
  }
  return search_.certified();
}

Flight::Gap ModelFlight::force(int contact) const {
  const Signal& lambda = closed_.flow->force(contact);
  Gap gap{value(lambda, closed_), rate(lambda, closed_), 0.0, largest_terms(lambda, closed_), 0.0};
  // Rounding of the terms of lambda = -G^-1 (a + ...), which are larger than the terms in modes.
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = this->model();
  double terms = dynamics.force_constant().cwiseAbs().maxCoeff();
  free().state(motion_, q_, u_);
  const auto d = dynamics.MinvW().col(contact).cwiseAbs();
  terms *= d.maxCoeff();
  for (Eigen::Index i = 0; i < f_; ++i) {
    terms += d[i] * (model.K.row(i).cwiseAbs().dot(q_.cwiseAbs()) +
                     model.C.row(i).cwiseAbs().dot(u_.cwiseAbs()));
  }
  gap.rounding = std::max(gap.length, terms / dynamics.G()(contact, contact));
  return gap;
}

void ModelFlight::gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const {
  if (!of_force) {
    const Signal& g = free().gap(contact);
    const Signal& gamma = free().gap_velocity(contact);
    of_g << g.p.segment(first_, f_).matrix(), g.r.segment(first_, f_).matrix();
    of_velocity << gamma.p.segment(first_, f_).matrix(), gamma.r.segment(first_, f_).matrix();
    return;
  }
  // For the locked set L: lambda = G_LL^-1 W_L^T M^-1 (C u + K q - f) + ...
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = this->model();
  const ContactMatrix G = of_contacts(dynamics.G(), held_);
  ContactVector unit(G.rows()), share;
  Eigen::Index row = 0;
  for_each(held_, [&](int i) { unit[row++] = i == contact ? -1.0 : 0.0; });
  arrest(G, unit, share);
  auto direction = rates_.head(f_);
  direction.setZero();
  row = 0;
  for_each(held_, [&](int i) { direction += share[row++] * dynamics.MinvW().col(i); });
  for (Eigen::Index j = 0; j < f_; ++j) {
    q_[j] = model.K.col(j).dot(direction);
    u_[j] = model.C.col(j).dot(direction);
  }
  for (Eigen::Index j = 0; j < 2 * f_; ++j) {
    of_g[j] = to_state_.col(j).head(f_).dot(q_) + to_state_.col(j).tail(f_).dot(u_);
  }
  of_velocity.setZero();
}

void ModelFlight::acceleration_gradient(int contact, Vector of) const {
  const Oscillators& o = free().oscillators();
  const Signal& gamma = free().gap_velocity(contact);
  for (Eigen::Index i = 0; i < f_; ++i) {
    const Eigen::Index k = first_ + i;
    of[i] = -o.kappa()[k] * gamma.r[k];
    of[f_ + i] = gamma.p[k] - 2.0 * o.delta()[k] * gamma.r[k];
  }
}

// Sets `of` to x' of the free flow at motion_.
void ModelFlight::find_rates(Vector of) const {
  const Oscillators& o = free().oscillators();
  for (Eigen::Index i = 0; i < f_; ++i) {
    const Eigen::Index k = first_ + i;
    const double z = motion_.x.z[k], v = motion_.x.v[k];
    of[i] = v;
    of[f_ + i] = motion_.alpha[k] - 2.0 * o.delta()[k] * v - o.kappa()[k] * z;
  }
  for (const Drive& drive : free().drives().all()) {
    of[f_ + drive.mode - first_] += drive.force(motion_.x);
  }
}

// Impact of a contact with restitution `epsilon` while `others` are held.
ModelFlight::Jump ModelFlight::jump_of(int contact, double epsilon, bool ends_chatter,
                                       ContactSet others, Vector direction) const {
  const Dynamics& dynamics = flows_->dynamics();
  Jump jump{1.0 + epsilon, others};
  direction = kicks_.col(contact) / dynamics.G()(contact, contact);
  if (others == 0) return jump;
  const SingleImpact impact =
      single_impact(dynamics.G(), model().law, restitution_, contact, epsilon, others);
  if (impact.solved != Solved::yes) return jump;
  jump.change = impact.change;
  direction.setZero();
  Eigen::Index row = 0;
  for_each(others | bit(contact),
           [&](int i) { direction += impact.Lambda[row++] * kicks_.col(i); });
  // The end of a completed chatter releases no contact.
  if (!ends_chatter) jump.staying = impact.staying;
  return jump;
}

ContactSet ModelFlight::strike(int contact, bool stays, ContactSet held, double sigma) {
  const ContactSet own = bit(contact), others = held & ~own;
  const Signal& gamma = free().gap_velocity(contact);
  const double velocity = value(gamma, motion_);
  const auto [epsilon, slope, scatter] =
      stays ? ImpactRestitution{} : restitution_over(this->contact(contact), velocity, sigma);
  const bool ends_chatter = stays && restitution(contact) > 0.0;
  const Jump jump = jump_of(contact, epsilon, ends_chatter, others, direction_);
  x_ -= (jump.change * velocity) * direction_;
  change_ = jump.change;
  if (bend_.size() > 0) {
    // The jump is linear in epsilon, which depends on gamma-.
    const Jump next = jump_of(contact, epsilon + difference_step, ends_chatter, others, bend_);
    direction_ *= jump.change;
    change_ = 1.0;
    bend_ = (next.change * bend_ - direction_) / difference_step;
    direction_ -= (slope * velocity) * bend_;
    bend_ *= scatter;
  }
  by_velocity_ << gamma.p.segment(first_, f_).matrix(), gamma.r.segment(first_, f_).matrix();
  find_rates(by_time_);
  by_time_ -= (change_ * rate(gamma, motion_)) * direction_;
  motion_.x.z.segment(first_, f_) = x_.head(f_).array();
  motion_.x.v.segment(first_, f_) = x_.tail(f_).array();
  find_rates(rates_);
  by_time_ -= rates_;
  held_ = 0;
  return stays ? jump.staying | own : jump.staying;
}

void ModelFlight::carry_through(Columns dx) const {
  for (auto column : dx.colwise()) {
    column -= (change_ * by_velocity_.dot(column)) * direction_;
  }
}

bool ModelFlight::strike_together(ContactSet closing, ContactSet staying, ContactSet kept,
                                  ContactSet leaving, Vector x, Columns dx, Vector unknown) {
  set_motion(x, motion_.t.hi);
  const auto of = [&](int i, const auto& column) {
    const Signal& gamma = free().gap_velocity(i);
    return gamma.p.segment(first_, f_).matrix().dot(column.head(f_)) +
           gamma.r.segment(first_, f_).matrix().dot(column.tail(f_));
  };
  closings_.clear();
  bool bends = false;
  for_each(closing, [&](int i) {
    Closing next{i, {}, value(free().gap_velocity(i), motion_)};
    if (!contains(staying, i)) {
      double variance = 0.0;
      if (bend_.size() > 0) {
        for (const auto column : dx.colwise()) variance += square(of(i, column));
      }
      next.restitution = restitution_over(contact(i), next.gamma, std::sqrt(variance));
      bends = bends || next.restitution.scatter > 0.0;
    }
    closings_.push_back(next);
  });
  impact_.set(closings_, kept, leaving);
  for (auto column : dx.colwise()) {
    u_.setZero();
    const auto d_gamma = [&](Eigen::Index k) {
      return of(closings_[static_cast<std::size_t>(k)].contact, column);
    };
    if (!impact_.add_change(d_gamma, u_)) return false;
    column.noalias() += from_state_.rightCols(f_).lazyProduct(u_);
  }
  free().state(motion_, q_, u_before_);
  u_ = u_before_;
  impact_.add_jump(u_);
  const auto decision = impact_.decide(u_before_, u_, motion_.t.hi, difference_);
  u_ -= u_before_;
  if (decision == ActiveImpact::Decision::same) {
    unknown.setZero();
  } else {
    unknown.noalias() = from_state_.rightCols(f_).lazyProduct(difference_);
    if (decision == ActiveImpact::Decision::as_reported) u_ += difference_;
  }
  x.noalias() += from_state_.rightCols(f_).lazyProduct(u_);
  if (!bends) return true;
  for (const Closing& of_one : closings_) {
    unknown +=
        (of_one.restitution.scatter / flows_->dynamics().G()(of_one.contact, of_one.contact)) *
        kicks_.col(of_one.contact);
  }
  return true;
}

void ModelFlight::along(int contact, Vector dx) const {
  dx = kicks_.col(contact) / flows_->dynamics().G()(contact, contact);
}

double ModelFlight::restitution(int contact) const { return this->contact(contact).restitution; }

double ModelFlight::restitution(int contact, double gamma) const {
  return restitution_at(this->contact(contact), gamma).epsilon;
}

void ModelFlight::enter(const ConstVector& q, const ConstVector& u, double t, Vector x) {
  free().enter(q, u, at(t), no_gaps_, motion_);
  x << motion_.x.z.segment(first_, f_).matrix(), motion_.x.v.segment(first_, f_).matrix();
}

void ModelFlight::state(const ConstVector& x, double t, Vector q, Vector u) {
  set_motion(x, t);
  free().state(motion_, q, u);
}

double ModelFlight::twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const {
  double sum = 0.0;
  for (Eigen::Index j = 0; j < dx.cols(); ++j) {
    for (Eigen::Index i = 0; i < 2 * f_; ++i) sum += dx(i, j) * energy_.col(i).dot(dx.col(j));
  }
  return sum;
}

}  // namespace sprag
