// An instant with events: what it says of the state, the jump, and the covariance behind it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "observer/timing_filter.h"

namespace sprag {
namespace {

// Times of events are not known better than to so many ulps.
constexpr double time_rounding = 16.0 * std::numeric_limits<double>::epsilon();
constexpr double consistency_window = 16.0;
// Roundings of a run are not in the covariance: an innovation below this share of its terms is no
// sign of anything.
constexpr double insignificant = 1e-10;
// Impulses that differ by more than this share are different decisions.
constexpr double same_impact = 1e-9;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

void TimingFilter::apply_group(std::span<const ContactEvent> events, TimingState& state) {
  const Model& model = flows_->dynamics().model();
  const Instant t = state.motion.t;
  const ContactSet before = state.motion.flow->locked();
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
    // What is held has g = gamma = 0, whatever else it is said to do at this instant.
    if (event.kind == ContactEventKind::opens || contains(before, event.contact)) continue;
    const double epsilon = event.kind == ContactEventKind::closes
                               ? 0.0
                               : model.contacts[index(event.contact)].restitution;
    // Whatever a contact is said to have done at one instant is one impact.
    const auto known = find_closing(event.contact);
    if (known != closings_.end()) {
      known->epsilon = epsilon;
    } else {
      closings_.push_back({event.contact, epsilon, 0.0, 0.0, 0.0});
    }
  }
  drop_redundant(before & state.chi, state);
  load(state, t);
  state.motion.flow->state(state.motion, q_, u_);
  state.inside &= ~leaving;
  if (leaving != 0) set_start(now_);  // what happened until then is not in the model
  state.consistency.largest = 0.0;
  if (closings_.empty()) {
    for_each(before & ~state.chi, [&](int contact) { measure_release(contact, state); });
  } else {
    measure_closings(state);
    reset(before & state.chi, before & ~state.chi, state);
  }
  merge_columns();
  if (!is_sane()) begin_again(state);
  go_on(state);
}

// Whether mean and covariance are numbers that can be gone on with.
bool TimingFilter::is_sane() const {
  constexpr double largest = 1e100;
  const Eigen::Index c = now_.columns;
  return q_.cwiseAbs().maxCoeff() < largest && u_.cwiseAbs().maxCoeff() < largest &&
         now_.q.leftCols(c).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest &&
         now_.u.leftCols(c).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest &&
         q_.allFinite() && u_.allFinite();
}

// As if the machine were started now. No event fits less than one after which nothing is known.
void TimingFilter::begin_again(TimingState& state) {
  q_ = start_.q;
  u_ = start_.u;
  set_start(now_);
  state.consistency = {};
  state.consistency.largest = std::numeric_limits<double>::infinity();
  ++state.lost;
}

// What is held already takes no impulse of its own.
void TimingFilter::drop_redundant(ContactSet held, TimingState& state) {
  ContactSet closing = 0;
  for (const Closing& of : closings_) closing |= bit(of.contact);
  const ContactSet redundant = closing & ~independent_of(flows_->dynamics().G(), held, closing);
  if (redundant == 0) return;
  std::erase_if(closings_, [&](const Closing& of) { return contains(redundant, of.contact); });
  ++state.redundancy.closings;
  state.redundancy.contact = std::countr_zero(redundant);
}

// lambda_i = 0, of a contact that is locked.
void TimingFilter::measure_release(int contact, TimingState& state) {
  const Flow& flow = *state.motion.flow;
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
    const auto w = flows_->dynamics().W().col(closings_[static_cast<std::size_t>(k)].contact);
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
  const Model& model = flows_->dynamics().model();
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
  const Dynamics& dynamics = flows_->dynamics();
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

std::vector<TimingFilter::Closing>::iterator TimingFilter::find_closing(int contact) {
  return std::find_if(closings_.begin(), closings_.end(),
                      [&](const Closing& closing) { return closing.contact == contact; });
}

// The impact law itself on the mean, in place of the branch that took it to u_, where it agrees
// with what was reported; the difference is one more unknown.
void TimingFilter::decide(ContactSet staying, ContactSet leaving, TimingState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = dynamics.model();
  ContactSet closing = 0;
  for (const Closing& of : closings_) closing |= bit(of.contact);
  const ContactSet closed = closing | staying | leaving;
  const ContactMatrix G = of_contacts(dynamics.G(), closed);
  ContactVector gamma(G.rows()), epsilon(G.rows()), Lambda, gamma_plus;
  Eigen::Index row = 0;
  for_each(closed, [&](int i) {
    const Contact& contact = model.contacts[index(i)];
    const auto found = find_closing(i);
    const bool closes = found != closings_.end();
    gamma[row] = closes ? gap_velocity(contact, u_before_, state.motion.t.hi) : 0.0;
    epsilon[row++] = closes ? found->epsilon : contact.restitution;
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

}  // namespace sprag
