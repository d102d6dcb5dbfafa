#include "observer/timing_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

constexpr std::size_t kept_bytes = 64 << 20;
// A restart takes this multiple of the squares by which two estimates differ, and not nothing.
constexpr double reserve = 4.0;
constexpr double least_share = 1e-12;

}  // namespace

TimingFilter::TimingFilter(Model model, double h, Uncertainty uncertainty)
    : TimingFilter(std::make_shared<Flows>(std::move(model)), h, std::move(uncertainty)) {}

TimingFilter::TimingFilter(std::shared_ptr<Flows> flows, double h, Uncertainty uncertainty)
    : flows_(std::move(flows)), h_(h), uncertainty_(std::move(uncertainty)) {
  build_foreseeable(*flows_);
  flight_ = TickedFlight((*flows_)[0], h);
  const int m = flows_->dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(flows_->dynamics().free_acceleration(i));
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  const Eigen::Index columns = 4 * f() + of_drift + 2 + 2 * m + 1;
  now_.q.setZero(f(), columns);
  now_.u.setZero(f(), columns);
  event_.setZero(2 + 2 * m, columns);
  event_mean_.setZero(2 + 2 * m);
  no_gaps_.setZero(m);
  if (m > 0) largest_w_ = flows_->dynamics().W().cwiseAbs().maxCoeff();
  (*flows_)[0].enter(Eigen::VectorXd::Zero(f()), Eigen::VectorXd::Zero(f()), Instant{},
                     no_gaps_.head(0), now_.mean);
  sample_ = now_.mean;
  // As many columns as merge_columns() leaves. Not initialized: memory that is never used stays
  // the system's.
  const auto bytes = static_cast<std::size_t>(8 * f() * f()) * sizeof(double);
  covariances_.resize(std::clamp<std::size_t>(kept_bytes / bytes, 16, 1024));
  for (Covariance& S : covariances_) {
    S.q.resize(f(), 4 * f());
    S.u.resize(f(), 4 * f());
    S.mean = now_.mean;
  }
  q_.setZero(f());
  u_.setZero(f());
  u_before_.setZero(f());
  jump_.setZero(f());
  on_q_.setZero(f());
  on_u_.setZero(f());
  first_on_q_.setZero(f());
  first_on_u_.setZero(f());
  const Model& of = flows_->dynamics().model();
  MinvC_ = of.M.llt().solve(of.C);
  MinvK_ = of.M.llt().solve(of.K);
  from_start_q_ = uncertainty_.q.inverse();
  from_start_u_ = uncertainty_.u.inverse();
  closings_.reserve(static_cast<std::size_t>(m));
  phi_.setZero(columns);
  z_.setZero(f(), columns);
  v_.setZero(f(), columns);
  directions_.setZero(f(), m);
  const Eigen::Index n = (*flows_)[0].size();
  unit_z_ = {Eigen::ArrayXd::Ones(n), Eigen::ArrayXd::Zero(n)};
  unit_v_ = {Eigen::ArrayXd::Zero(n), Eigen::ArrayXd::Ones(n)};
  from_z_ = unit_z_;
  from_v_ = unit_v_;
  no_alpha_.setZero(n);
  merged_.setZero(columns, 2 * f());
}

void TimingFilter::set_start(Covariance& S) const {
  S.columns = 2 * f();
  S.q.leftCols(S.columns).setZero();
  S.u.leftCols(S.columns).setZero();
  S.q.leftCols(f()) = uncertainty_.q;
  S.u.middleCols(f(), f()) = uncertainty_.u;
}

void TimingFilter::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                         TimingState& state) {
  state.tick = k;
  state.chi = chi;
  state.instants = 0;
  state.inside = 0;
  state.redundancy = {};
  state.refused_impacts = 0;
  state.ambiguous_impacts = 0;
  state.lost = 0;
  state.innovation = {};
  state.consistency = {};
  state.length = state.speed = 0.0;
  start_ = start;
  q_ = start.q;
  u_ = start.u;
  enter(independent_of(flows_->dynamics().G(), 0, chi), tick_instant(k, h_), state);
  state.covariance_time = state.motion.t;
  slot(0).instants = 0;
  slot(0).mean = state.motion;
  set_start(slot(0));
}

void TimingFilter::restart(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& u, std::int64_t believed,
                           TimingState& state) {
  const Instant t = tick_instant(state.tick, h_);
  const Covariance& from = slot(believed);
  on_q_.setOnes();
  on_u_.setOnes();
  if (from.instants == believed) {
    load(from, t);
    from.mean.flow->propagate(from.mean, t, sample_);
    sample_.flow->state(sample_, q_, u_);
    // In terms of the modes' deviations at a start.
    const Eigen::Index c = now_.columns;
    first_on_q_ = q - q_;
    first_on_u_ = u - u_;
    q_.noalias() = from_start_q_.lazyProduct(first_on_q_);
    u_.noalias() = from_start_u_.lazyProduct(first_on_u_);
    z_.leftCols(c).noalias() = from_start_q_.lazyProduct(now_.q.leftCols(c));
    v_.leftCols(c).noalias() = from_start_u_.lazyProduct(now_.u.leftCols(c));
    for (Eigen::Index i = 0; i < f(); ++i) {
      const double unsure = z_.row(i).head(c).squaredNorm() + v_.row(i).head(c).squaredNorm();
      const double apart = q_[i] * q_[i] + u_[i] * u_[i];
      const double share = std::clamp(0.5 * std::max(unsure, reserve * apart), least_share, 1.0);
      on_q_[i] = std::sqrt(share);
    }
    on_u_ = on_q_;
  }
  set_start(now_);
  for (Eigen::Index i = 0; i < f(); ++i) {
    now_.q.col(i) *= on_q_[i];
    now_.u.col(f() + i) *= on_u_[i];
  }
  q_ = q;
  u_ = u;
  state.motion.t = t;
  state.consistency = {};
  go_on(state);
}

// Mean and covariance, q_, u_ and now_, go on from the motion's instant.
void TimingFilter::go_on(TimingState& state) {
  const Instant t = state.motion.t;
  ++state.instants;
  Covariance& S = slot(state.instants);
  S.instants = state.instants;
  S.columns = now_.columns;
  S.q.leftCols(S.columns) = now_.q.leftCols(S.columns);
  S.u.leftCols(S.columns) = now_.u.leftCols(S.columns);
  state.covariance_time = t;
  const ContactSet closed = state.chi & ~state.inside;
  const ContactSet kept = state.motion.flow->locked() & closed;
  enter(kept | independent_of(flows_->dynamics().G(), kept, closed), t, state);
  S.mean = state.motion;
}

// The mean (q_, u_) goes on from t with these contacts locked at g = 0.
void TimingFilter::enter(ContactSet locked, Instant t, TimingState& state) {
  const Flow* flow = flows_->find(locked);
  if (flow == nullptr) {
    ++state.refused_impacts;
    locked = 0;
    flow = &(*flows_)[0];
  }
  flow->enter(q_, u_, t, no_gaps_.head(std::popcount(locked)), state.motion);
  TickedFlight::set_anchor(state.motion, state.anchor);
}

void TimingFilter::tick(std::span<const ContactEvent> events, TimingState& state) {
  ++state.tick;
  if (events.empty() && state.chi == 0) {
    flight_.step(state.tick, state.motion, state.anchor);
    return;
  }
  const Instant t = tick_instant(state.tick, h_);
  Motion& motion = state.motion;
  motion.t = tick_instant(state.tick - 1, h_);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    motion.flow->propagate(motion, at(of_one.front().t), motion);
    apply_group(of_one, state);
  });
  if (t - motion.t > 0.0) motion.flow->propagate(motion, t, motion);
  TickedFlight::set_anchor(motion, state.anchor);
}

void TimingFilter::apply(std::span<const ContactEvent> events, TimingState& state) {
  apply_group(events, state);
}

void TimingFilter::follow(std::span<const ContactEvent> events, TimingState& state) {
  state.motion.flow->propagate(state.motion, at(events.front().t), state.motion);
  apply_group(events, state);
}

void TimingFilter::output(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                          Eigen::Ref<Eigen::VectorXd> u) const {
  state.motion.flow->state(state.motion, q, u);
}

// The covariance of a state, moved to t.
void TimingFilter::load(const TimingState& state, Instant t) {
  const Covariance& S = slot(state.instants);
  if (S.instants == state.instants) {
    load(S, t);
    return;
  }
  set_start(now_);  // gone: as if nothing had been learnt
  move(*state.motion.flow, t - state.covariance_time);
}

void TimingFilter::load(const Covariance& from, Instant t) {
  const double tau = t - from.mean.t;
  now_.columns = from.columns;
  now_.q.leftCols(from.columns) = from.q.leftCols(from.columns);
  now_.u.leftCols(from.columns) = from.u.leftCols(from.columns);
  move(*from.mean.flow, tau);
  if (tau > 0.0) add_drift(tau);
}

void TimingFilter::add_drift(double tau) {
  const auto add = [&](const Eigen::MatrixXd& drift, Eigen::MatrixXd& to, Eigen::MatrixXd& other) {
    to.middleCols(now_.columns, drift.cols()) = std::sqrt(tau) * drift;
    other.middleCols(now_.columns, drift.cols()).setZero();
    now_.columns += drift.cols();
  };
  if (uncertainty_.drift_q.size() == 0) return;
  add(uncertainty_.drift_q, now_.q, now_.u);
  add(uncertainty_.drift_u, now_.u, now_.q);
}

void TimingFilter::move(const Flow& flow, double tau) {
  if (!(tau > 0.0)) return;
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  const Eigen::Index c = now_.columns;
  auto q = now_.q.leftCols(c);
  auto u = now_.u.leftCols(c);
  auto z = z_.topLeftCorner(n, c);
  auto v = v_.topLeftCorner(n, c);
  flow.enter_differences(q, u, z, v);
  flow.oscillators().propagate(unit_z_, no_alpha_, tau, nf, n, from_z_);
  flow.oscillators().propagate(unit_v_, no_alpha_, tau, nf, n, from_v_);
  for (Eigen::Index k = 0; k < c; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const double z_k = z(i, k);
      z(i, k) = from_z_.z[nf + i] * z_k + from_v_.z[nf + i] * v(i, k);
      v(i, k) = from_z_.v[nf + i] * z_k + from_v_.v[nf + i] * v(i, k);
    }
  }
  flow.state_differences(z, v, q, u);
}

void TimingFilter::deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> u, Eigen::Ref<Eigen::VectorXd> gap) {
  load(state, tick_instant(state.tick, h_));
  const Eigen::Index c = now_.columns;
  const double unseen_q = rounding * state.length / largest_w_;
  const double unseen_u = rounding * state.speed / largest_w_;
  for (Eigen::Index i = 0; i < f(); ++i) {
    q[i] = std::hypot(now_.q.row(i).head(c).norm(), unseen_q);
    u[i] = std::hypot(now_.u.row(i).head(c).norm(), unseen_u);
  }
  for (Eigen::Index i = 0; i < gap.size(); ++i) {
    auto phi = phi_.head(c);
    phi.noalias() = now_.q.leftCols(c).transpose().lazyProduct(flows_->dynamics().W().col(i));
    gap[i] = std::hypot(phi.norm(), rounding * state.length);
  }
}

TimingFilter::LastFlight TimingFilter::last_flight(int contact, const TimingState& state) {
  constexpr int samples = 64;
  LastFlight flight;
  if (state.instants < 1) return flight;
  const Covariance& from = slot(state.instants - 1);
  if (from.instants != state.instants - 1 || from.mean.flow == nullptr ||
      contains(from.mean.flow->locked(), contact)) {
    return flight;
  }
  const double tau = state.covariance_time - from.mean.t;
  for (int i = 1; i < samples; ++i) {
    from.mean.flow->propagate(from.mean, from.mean.t + tau * i / samples, sample_);
    const double gap = value(from.mean.flow->gap(contact), sample_);
    if (gap < 0.0) flight.inside += 1.0 / samples;
    flight.lowest = std::min(flight.lowest, gap);
  }
  return flight;
}

Eigen::MatrixXd TimingFilter::covariance(const TimingState& state) {
  load(state, tick_instant(state.tick, h_));
  Eigen::MatrixXd S(2 * f(), now_.columns);
  S << now_.q.leftCols(now_.columns), now_.u.leftCols(now_.columns);
  return S * S.transpose();
}

}  // namespace sprag
