#include "tools/diagnose/linear_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "sprag/mechanics/impact_law.h"

namespace sprag {
namespace {

// Times of events are not known better than to so many ulps.
constexpr double time_rounding = 16.0 * std::numeric_limits<double>::epsilon();

std::size_t index(Eigen::Index i) { return static_cast<std::size_t>(i); }

}  // namespace

LinearFilter::LinearFilter(Model model, Uncertainty uncertainty, State start, Instant t,
                           ContactSet closed)
    : flows_(std::move(model)),
      uncertainty_(std::move(uncertainty)),
      start_(std::move(start)),
      chi_(closed),
      impact_(flows_.dynamics()) {
  const Eigen::Index m = dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(dynamics().free_acceleration(i));
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  const Eigen::Index columns = 4 * f() + of_drift + 2 + 2 * m + 1;
  now_.q = start_.q;
  now_.u = start_.u;
  now_.S_q.setZero(f(), columns);
  now_.S_u.setZero(f(), columns);
  event_.setZero(2 + 2 * m, columns);
  event_mean_.setZero(2 + 2 * m);
  no_gaps_.setZero(m);
  for (Eigen::VectorXd* x : {&u_before_, &jump_, &first_on_q_, &first_on_u_, &on_q_, &on_u_}) {
    x->setZero(f());
  }
  const Model& of = dynamics().model();
  MinvC_ = of.M.llt().solve(of.C);
  MinvK_ = of.M.llt().solve(of.K);
  closings_.reserve(index(m));
  phi_.setZero(columns);
  columns_ = BeliefColumns(flows_[0], f(), columns);
  motion_.flow = &flows_[0];
  set_start(uncertainty_, now_);
  go_on(t);
}

// The mean goes on from t with all closed contacts locked at g = 0 that can be.
void LinearFilter::go_on(Instant t) {
  const ContactSet closed = chi_ & ~inside_;
  const ContactSet kept = motion_.flow->locked() & closed;
  ContactSet locked = kept | independent_of(dynamics().G(), kept, closed);
  const Flow* flow = flows_.find(locked);
  if (flow == nullptr) {
    ++refused_impacts_;
    locked = 0;
    flow = &flows_[0];
  }
  flow->enter(now_.q, now_.u, t, no_gaps_.head(std::popcount(locked)), motion_);
}

void LinearFilter::follow(std::span<const ContactEvent> of_one_instant) {
  const Model& model = dynamics().model();
  const Instant t = at(of_one_instant.front().t);
  const double tau = t - motion_.t;
  previous_ = motion_;
  motion_.flow->propagate(motion_, t, motion_);
  columns_.move(*motion_.flow, tau, now_);
  if (tau > 0.0) add_drift(uncertainty_, tau, now_);
  motion_.flow->state(motion_, now_.q, now_.u);

  const ContactSet before = motion_.flow->locked();
  ContactSet leaving = 0;
  closings_.clear();
  event_.setZero();
  event_mean_.setZero();
  for (const ContactEvent& event : of_one_instant) {
    chi_ = after(chi_, event);
    if (event.kind == ContactEventKind::closes && event.t == 0.0) inside_ |= bit(event.contact);
    if (contains(inside_, event.contact)) {
      if (event.kind == ContactEventKind::opens) leaving |= bit(event.contact);
      continue;
    }
    // What is held has g = gamma = 0, whatever else it is said to do at this instant.
    if (event.kind == ContactEventKind::opens || contains(before, event.contact)) continue;
    const double epsilon = event.kind == ContactEventKind::closes
                               ? 0.0
                               : model.contacts[index(event.contact)].restitution;
    // Whatever a contact is said to have done at one instant is one impact.
    const auto known = std::find_if(closings_.begin(), closings_.end(),
                                    [&](const Closing& of) { return of.contact == event.contact; });
    if (known != closings_.end()) {
      known->epsilon = epsilon;
    } else {
      closings_.push_back({event.contact, epsilon});
    }
  }
  drop_redundant(before & chi_);
  inside_ &= ~leaving;
  if (leaving != 0) set_start(uncertainty_, now_);  // what happened until then is not in the model
  if (closings_.empty()) {
    for_each(before & ~chi_, [&](int contact) { measure_release(contact); });
  } else {
    measure_closings();
    strike(before & chi_, before & ~chi_);
  }
  columns_.merge(now_);
  if (!is_sane(now_)) {  // as if the machine were started now
    now_.q = start_.q;
    now_.u = start_.u;
    set_start(uncertainty_, now_);
  }
  go_on(t);
}

double LinearFilter::inside(int contact) const {
  constexpr int samples = 64;
  const Flow& flow = *previous_.flow;
  if (contains(flow.locked(), contact)) return 0.0;
  const double tau = motion_.t - previous_.t;
  Motion sample = previous_;
  int negative = 0;
  for (int i = 1; i < samples; ++i) {
    flow.propagate(previous_, previous_.t + tau * i / samples, sample);
    if (value(flow.gap(contact), sample) < 0.0) ++negative;
  }
  return static_cast<double>(negative) / samples;
}

ContactSet LinearFilter::closing() const {
  ContactSet closing = 0;
  for (const Closing& of : closings_) closing |= bit(of.contact);
  return closing;
}

// What is held already takes no impulse of its own.
void LinearFilter::drop_redundant(ContactSet held) {
  const ContactSet redundant = closing() & ~independent_of(dynamics().G(), held, closing());
  std::erase_if(closings_, [&](const Closing& of) { return contains(redundant, of.contact); });
}

// lambda_i = 0, of a contact that is locked.
void LinearFilter::measure_release(int contact) {
  const Signal& lambda = motion_.flow->force(contact);
  columns_.see(*motion_.flow, lambda, now_, phi_);
  const double t = motion_.t.hi;
  const double off = std::max(uncertainty_.jitter, time_rounding * t) * rate(lambda, motion_);
  condition(-value(lambda, motion_), off * off, largest_terms(lambda, motion_));
}

// The unknowns of the event: tau, tau^2, and for each closing the products of tau with what is not
// known of gamma- and of its rate.
void LinearFilter::add_event_unknowns() {
  const double sigma = uncertainty_.jitter;
  const Eigen::Index c = now_.columns;
  const auto n = static_cast<Eigen::Index>(closings_.size());
  now_.columns += 2 + 2 * n;
  now_.S_q.middleCols(c, 2 + 2 * n).setZero();
  now_.S_u.middleCols(c, 2 + 2 * n).setZero();
  event_(0, c) = sigma;
  event_(1, c + 1) = std::sqrt(2.0) * sigma * sigma;
  event_mean_[1] = sigma * sigma;
  for (Eigen::Index k = 0; k < n; ++k) {
    const int contact = closings_[index(k)].contact;
    const auto w = dynamics().W().col(contact);
    double gamma = 0.0;
    for (Eigen::Index j = 0; j < c; ++j) gamma += square(w.dot(now_.S_u.col(j)));
    const double gamma_rate = variance(acceleration_[index(contact)], now_);
    event_(2 + 2 * k, c + 2 + 2 * k) = sigma * std::sqrt(gamma);
    event_(3 + 2 * k, c + 3 + 2 * k) = sigma * std::sqrt(gamma_rate);
  }
}

// g_i = 0 of the contacts that close, gamma_i = 0 of those whose bounces have come to an end.
void LinearFilter::measure_closings() {
  const Model& model = dynamics().model();
  const double t = motion_.t.hi;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    closings_[k].gamma = gap_velocity(model.contacts[index(closings_[k].contact)], now_.u, t);
    const Signal& gamma = motion_.flow->gap_velocity(closings_[k].contact);
    closings_[k].gamma_rate = rate(gamma, motion_);
    closings_[k].gamma_second_rate = second_rate(gamma, motion_);
  }
  add_event_unknowns();
  const Eigen::Index c = now_.columns;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    const Closing& closing = closings_[k];
    const Contact& contact = model.contacts[index(closing.contact)];
    auto phi = phi_.head(c);
    phi.noalias() = now_.S_q.leftCols(c).transpose().lazyProduct(contact.w);
    const double gap_before = gap(contact, now_.q, t);
    // At the reported time the gap, gone on with, would be gamma tau - gamma' tau^2 / 2.
    const auto row = static_cast<Eigen::Index>(2 + 2 * k);
    const auto event = event_.leftCols(c);
    phi -= (closing.gamma * event.row(0) - 0.5 * closing.gamma_rate * event.row(1) + event.row(row))
               .transpose();
    const double residual = -gap_before + closing.gamma * event_mean_[0] -
                            0.5 * closing.gamma_rate * event_mean_[1] + event_mean_[row];
    terms_.include(contact, now_.q, now_.u);
    const double deviation = condition(residual, 0.0, terms_.length);
    if (k == 0 || std::abs(gap_before) > std::abs(expected_.gap)) {
      expected_ = {t, closing.contact, gap_before, deviation, closing.gamma};
    }
    if (closing.epsilon > 0.0 || contact.restitution == 0.0) continue;
    phi.noalias() = now_.S_u.leftCols(c).transpose().lazyProduct(contact.w);
    const double off = std::max({uncertainty_.jitter, model.chatter_time, time_rounding * t});
    condition(-gap_velocity(contact, now_.u, t), square(off * closing.gamma_rate), terms_.speed);
  }
}

// Conditions on the measurement whose columns' parts are phi_: residual = measured - expected.
// Returns the standard deviation that the residual was expected to have.
double LinearFilter::condition(double residual, double noise, double scale) {
  const Eigen::Index c = now_.columns;
  auto phi = phi_.head(c);
  const double known = phi.squaredNorm();
  const double floor = measurement_rounding * scale;
  const double r = noise + floor * floor;
  const double alpha = known + r;
  const double deviation = std::sqrt(alpha);
  if (!(known > floor * floor)) return deviation;
  const PotterUpdate update(phi, residual, r);
  update.apply(now_.q, now_.S_q.leftCols(c));
  update.apply(now_.u, now_.S_u.leftCols(c));
  update.apply(event_mean_, event_.leftCols(c));
  return deviation;
}

// The impact of the contacts that close, with those of `staying` held; those of `leaving` were
// closed before it and are not after it.
void LinearFilter::strike(ContactSet staying, ContactSet leaving) {
  const Dynamics& dynamics = flows_.dynamics();
  const auto n = static_cast<Eigen::Index>(closings_.size());
  const auto closing = [&](Eigen::Index k) -> const Closing& { return closings_[index(k)]; };
  impact_.set(closings_, staying, leaving);
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    auto column = now_.S_u.col(j);
    const auto gamma = [&](Eigen::Index k) {
      return dynamics.W().col(closing(k).contact).dot(column);
    };
    if (!impact_.add_jump(gamma, column)) {
      ++refused_impacts_;
      return;
    }
  }
  // u+ - u- where the gap velocities before the impact are `of(closing)`.
  const auto jump = [&](const auto& of) {
    jump_.setZero();
    impact_.add_jump(of, jump_);
  };
  const double t = motion_.t.hi;
  jump([&](Eigen::Index k) {
    return gap_velocity(dynamics.model().contacts[index(closing(k).contact)], now_.u, t);
  });
  u_before_ = now_.u;
  now_.u += jump_;
  const auto decision = impact_.decide(u_before_, now_.u, t, on_u_);
  if (decision != ActiveImpact::Decision::same) {
    ++ambiguous_impacts_;
    now_.S_q.col(now_.columns).setZero();
    now_.S_u.col(now_.columns) = on_u_;
    ++now_.columns;
    if (decision == ActiveImpact::Decision::as_reported) now_.u += on_u_;
  }

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

// What unknown number `row` of the event adds to q and u.
void LinearFilter::add_effect(Eigen::Index row, const Eigen::VectorXd& on_q,
                              const Eigen::VectorXd& on_u) {
  now_.q += event_mean_[row] * on_q;
  now_.u += event_mean_[row] * on_u;
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    now_.S_q.col(j) += event_(row, j) * on_q;
    now_.S_u.col(j) += event_(row, j) * on_u;
  }
}

}  // namespace sprag
