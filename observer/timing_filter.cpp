#include "observer/timing_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

// A measurement whose deviation is below this share of its terms tells nothing but their rounding.
constexpr double rounding = 32.0 * std::numeric_limits<double>::epsilon();
constexpr std::size_t kept_bytes = 64 << 20;

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
  const Model& model = scene.model;
  const Eigen::Index f = model.coordinates();
  const Eigen::VectorXd energy = scene.uncertainty.size() == f
                                     ? scene.uncertainty
                                     : Eigen::VectorXd::Constant(f, 1.0 / static_cast<double>(f));
  Eigen::MatrixXd modes = model.M.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
  Eigen::VectorXd kappa = model.K.diagonal().cwiseQuotient(model.M.diagonal());
  if (!model.M.isDiagonal(0.0) || !model.K.isDiagonal(0.0)) {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(model.K, model.M);
    modes = solver.eigenvectors();
    kappa = solver.eigenvalues();
  }
  const double rigid = 1e-12 * kappa.maxCoeff();
  Eigen::VectorXd of_q(f);
  for (Eigen::Index i = 0; i < f; ++i) {
    of_q[i] = kappa[i] > rigid ? std::sqrt(energy[i] / kappa[i])
                               : longest_length(scene) / modes.col(i).cwiseAbs().maxCoeff();
  }
  return {modes * of_q.asDiagonal(), modes * energy.cwiseSqrt().asDiagonal(), scene.jitter};
}

TimingFilter::TimingFilter(Model model, double h, Uncertainty uncertainty)
    : flows_(std::move(model)), h_(h), uncertainty_(std::move(uncertainty)) {
  build_foreseeable(flows_);
  flight_ = TickedFlight(flows_[0], h);
  const int m = flows_.dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(flows_.dynamics().free_acceleration(i));
  const Eigen::Index columns = 4 * f() + 2 + 2 * m;
  now_.q.setZero(f(), columns);
  now_.u.setZero(f(), columns);
  event_.setZero(2 + 2 * m, columns);
  event_mean_.setZero(2 + 2 * m);
  const auto bytes = static_cast<std::size_t>(2 * f() * columns) * sizeof(double);
  covariances_.assign(std::clamp<std::size_t>(kept_bytes / bytes, 16, 1024), now_);
  q_.setZero(f());
  u_.setZero(f());
  jump_.setZero(f());
  jump_rate_.setZero(f());
  MinvC_jump_.setZero(f());
  MinvK_jump_.setZero(f());
  const Model& of = flows_.dynamics().model();
  MinvC_ = of.M.llt().solve(of.C);
  MinvK_ = of.M.llt().solve(of.K);
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
  no_gaps_.setZero(m);
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
  q_ = start.q;
  u_ = start.u;
  enter(chi, tick_instant(k, h_), state);
  state.covariance_time = state.motion.t;
  slot(0).instants = 0;
  set_start(slot(0));
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
  while (!events.empty()) {
    const auto end = std::find_if(events.begin(), events.end(), [&](const ContactEvent& event) {
      return event.t != events.front().t;
    });
    const auto count = static_cast<std::size_t>(end - events.begin());
    motion.flow->propagate(motion, at(events.front().t), motion);
    apply_group(events.first(count), state);
    events = events.subspan(count);
  }
  if (t - motion.t > 0.0) motion.flow->propagate(motion, t, motion);
  TickedFlight::set_anchor(motion, state.anchor);
}

void TimingFilter::apply(std::span<const ContactEvent> events, TimingState& state) {
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
    now_.columns = S.columns;
    now_.q.leftCols(S.columns) = S.q.leftCols(S.columns);
    now_.u.leftCols(S.columns) = S.u.leftCols(S.columns);
  } else {
    set_start(now_);  // gone: as if nothing had been learnt
  }
  move(*state.motion.flow, t - state.covariance_time);
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
    const double epsilon = model.contacts[static_cast<std::size_t>(event.contact)].restitution;
    closings_.push_back(
        {event.contact, event.kind == ContactEventKind::closes ? 0.0 : epsilon, 0.0, 0.0});
  }
  load(state, t);
  state.motion.flow->state(state.motion, q_, u_);
  state.inside &= ~leaving;
  if (leaving != 0) set_start(now_);  // what happened until then is not in the model
  if (closings_.empty()) {
    for (const ContactEvent& event : events) measure_release(event.contact, state);
  } else {
    measure_closings(state);
    reset(before & state.chi, state);
  }
  merge_columns();
  ++state.instants;
  Covariance& S = slot(state.instants);
  S.instants = state.instants;
  S.columns = now_.columns;
  S.q.leftCols(S.columns) = now_.q.leftCols(S.columns);
  S.u.leftCols(S.columns) = now_.u.leftCols(S.columns);
  state.covariance_time = t;
  enter(state.chi & ~state.inside, t, state);
}

// lambda_i = 0, of a contact that is locked.
void TimingFilter::measure_release(int contact, const TimingState& state) {
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
  const double slope = rate(lambda, state.motion);
  condition(-value(lambda, state.motion), std::pow(uncertainty_.jitter * slope, 2), scale);
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
void TimingFilter::measure_closings(const TimingState& state) {
  const Model& model = flows_.dynamics().model();
  const double t = state.motion.t.hi;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    closings_[k].gamma = gap_velocity(model.contacts[index(closings_[k].contact)], u_, t);
    closings_[k].gamma_rate =
        rate(state.motion.flow->gap_velocity(closings_[k].contact), state.motion);
  }
  const bool jitters = uncertainty_.jitter > 0.0;
  if (jitters) add_event_unknowns();
  const Eigen::Index c = now_.columns;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    const Closing& closing = closings_[k];
    const Contact& contact = model.contacts[index(closing.contact)];
    auto phi = phi_.head(c);
    phi.noalias() = now_.q.leftCols(c).transpose().lazyProduct(contact.w);
    double residual = -gap(contact, q_, t);
    if (jitters) {
      // At the reported time the gap, gone on with, would be gamma tau - gamma' tau^2 / 2.
      const auto row = static_cast<Eigen::Index>(2 + 2 * k);
      const auto event = event_.leftCols(c);
      phi -=
          (closing.gamma * event.row(0) - 0.5 * closing.gamma_rate * event.row(1) + event.row(row))
              .transpose();
      residual += closing.gamma * event_mean_[0] - 0.5 * closing.gamma_rate * event_mean_[1] +
                  event_mean_[row];
    }
    const double scale = contact.w.cwiseProduct(q_).cwiseAbs().sum() +
                         std::abs(contact.motion.amplitude) + std::abs(contact.clearance);
    condition(residual, 0.0, scale);
    if (closing.epsilon > 0.0 || contact.restitution == 0.0) continue;
    phi.noalias() = now_.u.leftCols(c).transpose().lazyProduct(contact.w);
    const double u_scale = contact.w.cwiseProduct(u_).cwiseAbs().sum() +
                           std::abs(contact.motion.amplitude * contact.motion.frequency);
    const double rest = std::max(uncertainty_.jitter, model.chatter_time) * closing.gamma_rate;
    condition(-gap_velocity(contact, u_, t), rest * rest, u_scale);
  }
}

// Conditions on the measurement whose columns' parts are phi_: residual = measured - expected.
void TimingFilter::condition(double residual, double noise, double scale) {
  const Eigen::Index c = now_.columns;
  auto phi = phi_.head(c);
  const double known = phi.squaredNorm();
  const double floor = rounding * scale;
  const double r = noise + floor * floor;
  if (!(known > floor * floor)) return;
  const double alpha = known + r;
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
  if (uncertainty_.jitter == 0.0) return;
  for (Eigen::Index i = 0; i < event_.rows(); ++i) {
    event_mean_[i] += gain * event_.row(i).head(c).dot(phi.transpose());
  }
  take(event_.leftCols(c));
}

// The impact of the contacts that close, with those of `staying` held.
void TimingFilter::reset(ContactSet staying, TimingState& state) {
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
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(contact(k));
    gamma[k] = gap_velocity(model.contacts[i], u_, state.motion.t.hi);
  }
  if (!impulses()) return;
  jump_.setZero();
  for (Eigen::Index k = 0; k < n; ++k) jump_ += Lambda[k] * directions_.col(k);
  u_ += jump_;
  if (uncertainty_.jitter == 0.0) return;

  // The impact was tau earlier: with gamma- less by gamma-' tau, and with the damping forces after
  // it for tau longer.
  MinvC_jump_.noalias() = MinvC_.lazyProduct(jump_);
  for (Eigen::Index k = 0; k < n; ++k)
    gamma[k] = -closings_[static_cast<std::size_t>(k)].gamma_rate;
  if (!impulses()) return;
  jump_rate_ = -MinvC_jump_;
  for (Eigen::Index k = 0; k < n; ++k) jump_rate_ += Lambda[k] * directions_.col(k);
  add_effect(0, jump_, jump_rate_);
  MinvK_jump_.noalias() = MinvK_.lazyProduct(jump_);
  jump_ = jump_rate_ + 0.5 * MinvC_jump_;
  jump_rate_ = -0.5 * MinvK_jump_;
  add_effect(1, jump_, jump_rate_);
  for (Eigen::Index k = 0; k < n; ++k) {
    gamma.setZero();
    gamma[k] = 1.0;
    if (!impulses()) return;
    jump_.setZero();
    for (Eigen::Index l = 0; l < n; ++l) jump_ += Lambda[l] * directions_.col(l);
    jump_rate_.noalias() = -MinvC_.lazyProduct(jump_);
    add_effect(2 + 2 * k, jump_, jump_rate_);
    jump_rate_ = -jump_;
    jump_.setZero();
    add_effect(3 + 2 * k, jump_, jump_rate_);
  }
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

Eigen::MatrixXd TimingFilter::covariance(const TimingState& state) {
  load(state, tick_instant(state.tick, h_));
  Eigen::MatrixXd S(2 * f(), now_.columns);
  S << now_.q.leftCols(now_.columns), now_.u.leftCols(now_.columns);
  return S * S.transpose();
}

}  // namespace sprag
