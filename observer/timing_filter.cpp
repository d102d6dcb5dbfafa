#include "observer/timing_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "mechanics/energy.h"

namespace sprag {
namespace {

// A measurement whose deviation is below this share of its terms tells nothing but their rounding.
constexpr double rounding = 32.0 * std::numeric_limits<double>::epsilon();
// Times of events are not known better than to so many ulps.
constexpr double time_rounding = 16.0 * std::numeric_limits<double>::epsilon();
constexpr std::size_t kept_bytes = 64 << 20;
constexpr double consistency_window = 16.0;
// Roundings of a run are not in the covariance: an innovation below this share of its terms is no
// sign of anything.
constexpr double insignificant = 1e-10;
// A restart takes this multiple of the squares by which two estimates differ, and not nothing.
constexpr double reserve = 4.0;
constexpr double least_share = 1e-12;
// Impulses that differ by more than this share are different decisions.
constexpr double same_impact = 1e-9;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// Nothing shorter than this is seen of a machine whose rigid motions have no scale of their own.
double longest_length(const Scene& scene) {
  double length = scene.replica.q.cwiseAbs().maxCoeff();
  for (const Contact& contact : scene.model.contacts) {
    length = std::max({length, std::abs(contact.clearance), std::abs(contact.motion.amplitude)});
  }
  return length > 0.0 ? length : 1.0;
}

}  // namespace

Uncertainty uncertainty_of(const Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  const NaturalModes modes = natural_modes(scene.model);
  const Eigen::VectorXd one_each = Eigen::VectorXd::Constant(f, 1.0 / static_cast<double>(f));
  const Eigen::VectorXd energy = scene.uncertainty.size() == f ? scene.uncertainty : one_each;
  const auto of_u = [&](const Eigen::VectorXd& of) {
    return Eigen::VectorXd(of.cwiseQuotient(modes.mass).cwiseSqrt());
  };
  const auto of_q = [&](const Eigen::VectorXd& of, bool rigid) {
    Eigen::VectorXd q(f);
    for (Eigen::Index i = 0; i < f; ++i) {
      const double length = longest_length(scene) / modes.Phi.col(i).cwiseAbs().maxCoeff();
      q[i] =
          modes.stiffness[i] > 0.0 ? std::sqrt(of[i] / modes.stiffness[i]) : (rigid ? length : 0.0);
    }
    return q;
  };
  Uncertainty uncertainty{modes.Phi * of_q(energy, true).asDiagonal(),
                          modes.Phi * of_u(energy).asDiagonal(),
                          scene.jitter,
                          {},
                          {}};
  if (scene.drift > 0.0) {
    uncertainty.drift_q = modes.Phi * of_q(scene.drift * one_each, false).asDiagonal();
    uncertainty.drift_u = modes.Phi * of_u(scene.drift * one_each).asDiagonal();
  }
  return uncertainty;
}

TimingFilter::TimingFilter(Model model, double h, Uncertainty uncertainty)
    : flows_(std::move(model)), h_(h), uncertainty_(std::move(uncertainty)) {
  build_foreseeable(flows_);
  flight_ = TickedFlight(flows_[0], h);
  const int m = flows_.dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(flows_.dynamics().free_acceleration(i));
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  const Eigen::Index columns = 4 * f() + of_drift + 2 + 2 * m + 1;
  now_.q.setZero(f(), columns);
  now_.u.setZero(f(), columns);
  event_.setZero(2 + 2 * m, columns);
  event_mean_.setZero(2 + 2 * m);
  const auto bytes = static_cast<std::size_t>(2 * f() * columns) * sizeof(double);
  no_gaps_.setZero(m);
  largest_w_ = flows_.dynamics().W().cwiseAbs().maxCoeff();
  flows_[0].enter(Eigen::VectorXd::Zero(f()), Eigen::VectorXd::Zero(f()), Instant{},
                  no_gaps_.head(0), now_.mean);
  sample_ = now_.mean;
  covariances_.assign(std::clamp<std::size_t>(kept_bytes / bytes, 16, 1024), now_);
  q_.setZero(f());
  u_.setZero(f());
  u_before_.setZero(f());
  jump_.setZero(f());
  on_q_.setZero(f());
  on_u_.setZero(f());
  first_on_q_.setZero(f());
  first_on_u_.setZero(f());
  const Model& of = flows_.dynamics().model();
  MinvC_ = of.M.llt().solve(of.C);
  MinvK_ = of.M.llt().solve(of.K);
  from_start_q_ = uncertainty_.q.inverse();
  from_start_u_ = uncertainty_.u.inverse();
  closings_.reserve(static_cast<std::size_t>(m));
  phi_.setZero(columns);
  z_.setZero(f(), columns);
  v_.setZero(f(), columns);
  directions_.setZero(f(), m);
  const Eigen::Index n = flows_[0].size();
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
  state.refused_impacts = 0;
  state.ambiguous_impacts = 0;
  state.innovation = {};
  state.consistency = {};
  state.length = state.speed = 0.0;
  q_ = start.q;
  u_ = start.u;
  enter(chi, tick_instant(k, h_), state);
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
  enter(state.chi & ~state.inside, t, state);
  S.mean = state.motion;
}

// The mean (q_, u_) goes on from t with these contacts locked at g = 0.
void TimingFilter::enter(ContactSet locked, Instant t, TimingState& state) {
  const Flow* flow = nullptr;
  try {
    flow = &flows_[locked];
  } catch (const ModelError&) {  // dependent directions: no machine closes them all
    ++state.refused_impacts;
    locked = 0;
    flow = &flows_[0];
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

void TimingFilter::apply_group(std::span<const ContactEvent> events, TimingState& state) {
  const Model& model = flows_.dynamics().model();
  const Instant t = state.motion.t;
  const ContactSet before = state.chi & ~state.inside;
  ContactSet leaving = 0;
  closings_.clear();
  for (const ContactEvent& event : events) {
    state.chi = after(state.chi, event);
    if (event.kind == ContactEventKind::closes && event.t == 0.0)
      state.inside |= bit(event.contact);
    if (contains(state.inside, event.contact)) {
      if (event.kind == ContactEventKind::opens) leaving |= bit(event.contact);
      continue;
    }
    if (event.kind == ContactEventKind::opens) continue;
    const double epsilon = event.kind == ContactEventKind::closes
                               ? 0.0
                               : model.contacts[index(event.contact)].restitution;
    // Whatever a contact is said to have done at one instant is one impact.
    const auto known =
        std::find_if(closings_.begin(), closings_.end(),
                     [&](const Closing& closing) { return closing.contact == event.contact; });
    if (known != closings_.end()) {
      known->epsilon = epsilon;
    } else {
      closings_.push_back({event.contact, epsilon, 0.0, 0.0, 0.0});
    }
  }
  load(state, t);
  state.motion.flow->state(state.motion, q_, u_);
  state.inside &= ~leaving;
  if (leaving != 0) set_start(now_);  // what happened until then is not in the model
  state.consistency.largest = 0.0;
  if (closings_.empty()) {
    for (const ContactEvent& event : events) measure_release(event.contact, state);
  } else {
    measure_closings(state);
    reset(before & state.chi, before & ~state.chi, state);
  }
  merge_columns();
  go_on(state);
}

// lambda_i = 0, of a contact that is locked.
void TimingFilter::measure_release(int contact, TimingState& state) {
  const Flow& flow = *state.motion.flow;
  if (!contains(flow.locked(), contact)) return;
  const Signal& lambda = flow.force(contact);
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  const Eigen::Index c = now_.columns;
  auto z = z_.topLeftCorner(n, c);
  auto v = v_.topLeftCorner(n, c);
  flow.enter_differences(now_.q.leftCols(c), now_.u.leftCols(c), z, v);
  for (Eigen::Index k = 0; k < c; ++k) {
    phi_[k] = (lambda.p.segment(nf, n) * z.col(k).array()).sum() +
              (lambda.r.segment(nf, n) * v.col(k).array()).sum();
  }
  const double scale = std::abs(lambda.constant) + (lambda.p * state.motion.x.z).abs().sum() +
                       (lambda.r * state.motion.x.v).abs().sum();
  const double t = state.motion.t.hi;
  const double off = std::max(uncertainty_.jitter, time_rounding * t) * rate(lambda, state.motion);
  condition(-value(lambda, state.motion), off * off, scale, state.consistency);
}

// The unknowns of the event: tau, tau^2, and for each closing the products of tau with what is not
// known of gamma- and of its rate.
void TimingFilter::add_event_unknowns() {
  const double sigma = uncertainty_.jitter;
  const Eigen::Index c = now_.columns;
  const auto n = static_cast<Eigen::Index>(closings_.size());
  now_.columns += 2 + 2 * n;
  now_.q.middleCols(c, 2 + 2 * n).setZero();
  now_.u.middleCols(c, 2 + 2 * n).setZero();
  event_.leftCols(now_.columns).setZero();
  event_(0, c) = sigma;
  event_(1, c + 1) = std::sqrt(2.0) * sigma * sigma;
  event_mean_.setZero();
  event_mean_[1] = sigma * sigma;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto w = flows_.dynamics().W().col(closings_[static_cast<std::size_t>(k)].contact);
    const Functional& a = acceleration_[index(closings_[static_cast<std::size_t>(k)].contact)];
    double gamma = 0.0;
    double gamma_rate = 0.0;
    for (Eigen::Index j = 0; j < c; ++j) {
      gamma += std::pow(w.dot(now_.u.col(j)), 2);
      gamma_rate += std::pow(a.a.dot(now_.q.col(j)) + a.b.dot(now_.u.col(j)), 2);
    }
    event_(2 + 2 * k, c + 2 + 2 * k) = sigma * std::sqrt(gamma);
    event_(3 + 2 * k, c + 3 + 2 * k) = sigma * std::sqrt(gamma_rate);
  }
}

// g_i = 0 of the contacts that close, gamma_i = 0 of those whose bounces have come to an end.
void TimingFilter::measure_closings(TimingState& state) {
  const Model& model = flows_.dynamics().model();
  const double t = state.motion.t.hi;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    closings_[k].gamma = gap_velocity(model.contacts[index(closings_[k].contact)], u_, t);
    const Signal& gamma = state.motion.flow->gap_velocity(closings_[k].contact);
    closings_[k].gamma_rate = rate(gamma, state.motion);
    closings_[k].gamma_second_rate = second_rate(gamma, state.motion);
  }
  const bool jitters = uncertainty_.jitter > 0.0;
  if (jitters) add_event_unknowns();
  const Eigen::Index c = now_.columns;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    const Closing& closing = closings_[k];
    const Contact& contact = model.contacts[index(closing.contact)];
    auto phi = phi_.head(c);
    phi.noalias() = now_.q.leftCols(c).transpose().lazyProduct(contact.w);
    const double gap_before = gap(contact, q_, t);
    double residual = -gap_before;
    double noise = 0.0;
    if (!jitters) {
      noise = std::pow(time_rounding * t * closing.gamma, 2);
    } else {
      // At the reported time the gap, gone on with, would be gamma tau - gamma' tau^2 / 2.
      const auto row = static_cast<Eigen::Index>(2 + 2 * k);
      const auto event = event_.leftCols(c);
      phi -=
          (closing.gamma * event.row(0) - 0.5 * closing.gamma_rate * event.row(1) + event.row(row))
              .transpose();
      residual += closing.gamma * event_mean_[0] - 0.5 * closing.gamma_rate * event_mean_[1] +
                  event_mean_[row];
    }
    state.length = std::max(state.length, contact.w.cwiseProduct(q_).cwiseAbs().sum() +
                                              std::abs(contact.motion.amplitude) +
                                              std::abs(contact.clearance));
    state.speed =
        std::max(state.speed, contact.w.cwiseProduct(u_).cwiseAbs().sum() +
                                  std::abs(contact.motion.amplitude * contact.motion.frequency));
    const double deviation = condition(residual, noise, state.length, state.consistency);
    if (k == 0 || std::abs(gap_before) > std::abs(state.innovation.gap)) {
      state.innovation = {t, closing.contact, gap_before, deviation};
    }
    if (closing.epsilon > 0.0 || contact.restitution == 0.0) continue;
    phi.noalias() = now_.u.leftCols(c).transpose().lazyProduct(contact.w);
    const double off = std::max({uncertainty_.jitter, model.chatter_time, time_rounding * t});
    condition(-gap_velocity(contact, u_, t), std::pow(off * closing.gamma_rate, 2), state.speed,
              state.consistency);
  }
}

// Conditions on the measurement whose columns' parts are phi_: residual = measured - expected.
// Returns the standard deviation that the residual was expected to have.
double TimingFilter::condition(double residual, double noise, double scale,
                               Consistency& consistency) {
  const Eigen::Index c = now_.columns;
  auto phi = phi_.head(c);
  const double known = phi.squaredNorm();
  const double floor = rounding * scale;
  const double r = noise + floor * floor;
  const double alpha = known + r;
  const double deviation = std::sqrt(alpha);
  if (deviation > 0.0) {
    const double square = residual * residual / (alpha + std::pow(insignificant * scale, 2));
    ++consistency.count;
    consistency.mean += (square - consistency.mean) / consistency_window;
    consistency.largest = std::max(consistency.largest, square);
  }
  if (!(known > floor * floor)) return deviation;
  // K = S phi / alpha; S -= K phi^T / (1 + sqrt(r / alpha)).
  const double gain = residual / alpha;
  const double shrink = 1.0 / (alpha * (1.0 + std::sqrt(r / alpha)));
  const auto take = [&](auto rows) {
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const double along = rows.row(i).dot(phi.transpose());
      rows.row(i) -= along * shrink * phi.transpose();
    }
  };
  for (Eigen::Index i = 0; i < f(); ++i) {
    q_[i] += gain * now_.q.row(i).head(c).dot(phi.transpose());
    u_[i] += gain * now_.u.row(i).head(c).dot(phi.transpose());
  }
  take(now_.q.leftCols(c));
  take(now_.u.leftCols(c));
  if (uncertainty_.jitter == 0.0) return deviation;
  for (Eigen::Index i = 0; i < event_.rows(); ++i) {
    event_mean_[i] += gain * event_.row(i).head(c).dot(phi.transpose());
  }
  take(event_.leftCols(c));
  return deviation;
}

// The impact of the contacts that close, with those of `staying` held; those of `leaving` were
// closed before it and are not after it.
void TimingFilter::reset(ContactSet staying, ContactSet leaving, TimingState& state) {
  const Dynamics& dynamics = flows_.dynamics();
  const Model& model = dynamics.model();
  const auto n = static_cast<Eigen::Index>(closings_.size());
  const ContactMatrix G_staying = of_contacts(dynamics.G(), staying);
  ContactVector gamma(n), held, Lambda;
  ContactMatrix G(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const int i = closings_[static_cast<std::size_t>(k)].contact;
    auto direction = directions_.col(k);
    direction = dynamics.MinvW().col(i);
    if (staying == 0) continue;
    held.resize(std::popcount(staying));
    Eigen::Index row = 0;
    for_each(staying, [&](int j) { held[row++] = dynamics.G()(j, i); });
    if (arrest(G_staying, held, Lambda) != Solved::yes) continue;
    row = 0;
    for_each(staying, [&](int j) { direction += Lambda[row++] * dynamics.MinvW().col(j); });
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    const int i = closings_[static_cast<std::size_t>(k)].contact;
    for (Eigen::Index l = 0; l < n; ++l) G(k, l) = dynamics.W().col(i).dot(directions_.col(l));
  }
  // Impulses along the directions that take gamma to its value after the impact.
  const auto scale = [&](ContactVector& x) {
    for (Eigen::Index k = 0; k < n; ++k) {
      x[k] *= 1.0 + closings_[static_cast<std::size_t>(k)].epsilon;
    }
  };
  const auto impulses = [&] {
    if (model.law == ImpactLaw::newton) scale(gamma);
    if (arrest(G, gamma, Lambda) != Solved::yes) return false;
    if (model.law == ImpactLaw::poisson) scale(Lambda);
    return true;
  };
  const auto contact = [&](Eigen::Index k) {
    return closings_[static_cast<std::size_t>(k)].contact;
  };
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    for (Eigen::Index k = 0; k < n; ++k) {
      gamma[k] = dynamics.W().col(contact(k)).dot(now_.u.col(j));
    }
    if (!impulses()) {
      ++state.refused_impacts;
      return;
    }
    for (Eigen::Index k = 0; k < n; ++k) now_.u.col(j) += Lambda[k] * directions_.col(k);
  }
  // u+ - u- where the gap velocities before the impact are `of(closing)`.
  const auto jump = [&](const auto& of) {
    for (Eigen::Index k = 0; k < n; ++k) gamma[k] = of(k);
    jump_.setZero();
    if (!impulses()) return;
    for (Eigen::Index k = 0; k < n; ++k) jump_ += Lambda[k] * directions_.col(k);
  };
  const auto closing = [&](Eigen::Index k) -> const Closing& {
    return closings_[static_cast<std::size_t>(k)];
  };
  jump([&](Eigen::Index k) {
    return gap_velocity(model.contacts[index(contact(k))], u_, state.motion.t.hi);
  });
  u_before_ = u_;
  u_ += jump_;
  if (n > 1 || staying != 0 || leaving != 0) decide(staying, leaving, state);
  if (uncertainty_.jitter == 0.0) return;

  // The impact was tau earlier, when gamma- was less by gamma-' tau - gamma-'' tau^2 / 2, and what
  // it added has moved for tau since: u by the damping forces, q by u.
  const auto C = [&](const Eigen::VectorXd& u) { return MinvC_.lazyProduct(u); };
  const auto K = [&](const Eigen::VectorXd& q) { return MinvK_.lazyProduct(q); };
  on_q_ = -0.5 * C(jump_);
  on_u_ = -0.5 * K(jump_) - C(on_q_);
  first_on_q_ = jump_;
  first_on_u_ = -C(jump_);
  jump([&](Eigen::Index k) { return closing(k).gamma_rate; });
  first_on_u_ -= jump_;
  on_q_ -= jump_;
  on_u_ += C(jump_);
  jump([&](Eigen::Index k) { return closing(k).gamma_second_rate; });
  on_u_ += 0.5 * jump_;
  add_effect(0, first_on_q_, first_on_u_);
  add_effect(1, on_q_, on_u_);
  for (Eigen::Index k = 0; k < n; ++k) {
    jump([&](Eigen::Index l) { return l == k ? 1.0 : 0.0; });
    on_u_ = -C(jump_);
    add_effect(2 + 2 * k, jump_, on_u_);
    on_u_ = -jump_;
    on_q_.setZero();
    add_effect(3 + 2 * k, on_q_, on_u_);
  }
}

// The impact law itself on the mean, in place of the branch that took it to u_, where it agrees
// with what was reported; the difference is one more unknown.
void TimingFilter::decide(ContactSet staying, ContactSet leaving, TimingState& state) {
  const Dynamics& dynamics = flows_.dynamics();
  const Model& model = dynamics.model();
  ContactSet closing = 0;
  for (const Closing& of : closings_) closing |= bit(of.contact);
  const ContactSet closed = closing | staying | leaving;
  const ContactMatrix G = of_contacts(dynamics.G(), closed);
  ContactVector gamma(G.rows()), epsilon(G.rows()), Lambda, gamma_plus;
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    const Contact& contact = model.contacts[index(i)];
    gamma[row] = contains(closing, i) ? gap_velocity(contact, u_before_, state.motion.t.hi) : 0.0;
    epsilon[row++] = contact.restitution;
  });
  row = 0;
  for_each(closed, [&](int i) {
    for (const Closing& of : closings_) {
      if (of.contact == i) epsilon[row] = of.epsilon;
    }
    ++row;
  });
  if (impact(model.law, G, epsilon, gamma, Lambda, gamma_plus) != Solved::yes) return;
  on_u_ = u_before_ - u_;
  bool as_reported = true;
  row = 0;
  for_each(closed, [&](int i) {
    on_u_ += Lambda[row] * dynamics.MinvW().col(i);
    if (contains(closing, i) && !(Lambda[row] > 0.0)) as_reported = false;
    if (contains(staying, i) && gamma_plus[row] > 0.0) as_reported = false;
    ++row;
  });
  if (!(on_u_.norm() > same_impact * (u_ - u_before_).norm())) return;
  ++state.ambiguous_impacts;
  now_.q.col(now_.columns).setZero();
  now_.u.col(now_.columns) = on_u_;
  event_.col(now_.columns).setZero();
  ++now_.columns;
  if (as_reported) u_ += on_u_;
}

// What unknown number `row` of the event adds to q and u.
void TimingFilter::add_effect(Eigen::Index row, const Eigen::VectorXd& on_q,
                              const Eigen::VectorXd& on_u) {
  q_ += event_mean_[row] * on_q;
  u_ += event_mean_[row] * on_u;
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    now_.q.col(j) += event_(row, j) * on_q;
    now_.u.col(j) += event_(row, j) * on_u;
  }
}

// Householder reflections of S^T leave P = S S^T as it is and all but 2 f columns zero.
void TimingFilter::merge_columns() {
  const Eigen::Index c = now_.columns;
  const Eigen::Index n = 2 * f();
  if (c <= 4 * f()) return;
  auto R = merged_.topRows(c);
  R.leftCols(f()) = now_.q.leftCols(c).transpose();
  R.rightCols(f()) = now_.u.leftCols(c).transpose();
  for (Eigen::Index k = 0; k < n; ++k) {
    auto x = R.col(k).tail(c - k);
    const double norm = x.norm();
    if (norm == 0.0) continue;
    const double head = x[0] > 0.0 ? -norm : norm;
    x[0] -= head;  // the reflection's vector, in place
    const double factor = 2.0 / x.squaredNorm();
    for (Eigen::Index j = k + 1; j < n; ++j) {
      auto y = R.col(j).tail(c - k);
      y -= factor * x.dot(y) * x;
    }
    x.setZero();
    x[0] = head;
  }
  now_.columns = n;
  now_.q.leftCols(n) = R.topLeftCorner(n, f()).transpose();
  now_.u.leftCols(n) = R.topRightCorner(n, f()).transpose();
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
    phi.noalias() = now_.q.leftCols(c).transpose().lazyProduct(flows_.dynamics().W().col(i));
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
