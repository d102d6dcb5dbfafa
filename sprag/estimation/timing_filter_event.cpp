// An instant with events: what it says of the state, the jump, and the covariance behind it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "sprag/estimation/timing_filter.h"

namespace sprag {
namespace {

// Times of events are not known better than to so many ulps.
constexpr double time_rounding = 16.0 * std::numeric_limits<double>::epsilon();
// And impacts happen at doubles.
constexpr double time_step = std::numeric_limits<double>::epsilon();
constexpr double consistency_window = 16.0;
// Roundings of a run are not in the covariance: an innovation below this share of its terms is no
// sign of anything.
constexpr double insignificant = 1e-10;
// How much less must be known of gamma than the end of a chatter tells.
constexpr double remainder_tells = 100.0;
// The master's: gaps that are less than this share of their terms are closed.
constexpr double touching = 1e-12;
constexpr double infinity = std::numeric_limits<double>::infinity();
// Impulses that differ by more than this share are different decisions.
constexpr double same_impact = 1e-9;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

void TimingFilter::take_instant(std::span<const ContactEvent> events, TimingState& state) {
  if (unknown_time_ && events.size() != 1) {
    // Each has a jitter of its own: that they are told to be of one instant says nothing.
    for (const ContactEvent& event : events) take_instant({&event, 1}, state);
    return;
  }
  const ContactSet before = state.motion.flow->locked();
  const Instant t = state.motion.t;
  if (!load(state, t)) ++state.forgotten;
  state.motion.flow->state(state.motion, now_.q, now_.u);
  state.began_again = state.unknown;
  if (state.unknown) {
    now_.q = start_.q;
    now_.u = start_.u;
    set_start(uncertainty_, now_);
    state.consistency = {};
  }
  state.consistency.largest = 0.0;
  report_ = {};
  ContactSet leaving = 0;
  for (const ContactEvent& event : events) {
    if (event.kind == ContactEventKind::closes && event.t == 0.0)
      state.inside |= bit(event.contact);
    if (event.kind == ContactEventKind::opens && contains(state.inside, event.contact)) {
      leaving |= bit(event.contact);
    }
  }
  if (leaving != 0) set_start(uncertainty_, now_);  // what happened until then is not in the model
  if (unknown_time_) {
    take_uncertain(events.front(), before, state);
  } else {
    take_exact(events, before, state);
  }
  state.inside &= ~leaving;
  columns_.merge(now_);
  if (!is_sane(now_)) begin_again(events.back().contact, state);
  go_on(state);
}

// One impact after the other: what a contact does twice at one instant is two of them.
void TimingFilter::take_exact(std::span<const ContactEvent> events, ContactSet before,
                              TimingState& state) {
  const Model& model = flows_->dynamics().model();
  bool closed = false;
  int stages = 0;
  u_before_ = now_.u;
  for (std::size_t first = 0; first < events.size();) {
    closings_.clear();
    ContactSet told = 0;
    std::size_t end = first;
    for (; end < events.size() && !contains(told, events[end].contact); ++end) {
      const ContactEvent& event = events[end];
      told |= bit(event.contact);
      state.chi = after(state.chi, event);
      // What is held has g = gamma = 0, whatever else it is said to do at this instant.
      if (contains(state.inside | before, event.contact)) continue;
      if (event.kind == ContactEventKind::opens) continue;
      const double epsilon = event.kind == ContactEventKind::closes
                                 ? 0.0
                                 : model.contacts[index(event.contact)].restitution;
      closings_.push_back({event.contact, epsilon, 0.0, 0.0});
    }
    first = end;
    ContactSet closing = 0;
    for (const Closing& of : closings_) closing |= bit(of.contact);
    const ContactSet redundant = drop_redundant(before & state.chi, closing, state);
    std::erase_if(closings_, [&](const Closing& of) { return contains(redundant, of.contact); });
    if (closings_.empty()) continue;
    measure_closings(events.size() > 1, state);
    if (!closed) u_before_ = now_.u;
    closed = true;
    ++stages;
    reset(before & state.chi, before & ~state.chi, state);
  }
  if (!closed) {
    for_each(before & ~state.chi, [&](int contact) { measure_release(contact, state); });
    return;
  }
  if (stages > 1) add_sequence(events, before, state);
  add_time_rounding(state);
}

// An impact at a time that is a rounded double: what it adds to u has moved q by more or less.
void TimingFilter::add_time_rounding(const TimingState& state) {
  if (now_.columns == now_.S_q.cols()) columns_.merge(now_);
  now_.S_q.col(now_.columns) = time_step * state.motion.t.hi * (now_.u - u_before_);
  now_.S_u.col(now_.columns).setZero();
  ++now_.columns;
}

// Several impacts at one instant: nothing says in which order. What it would have been one by one
// as they are told is one more unknown.
void TimingFilter::add_sequence(std::span<const ContactEvent> events, ContactSet before,
                                TimingState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = dynamics.model();
  u_sequence_ = u_before_;
  for (const ContactEvent& event : events) {
    if (event.kind == ContactEventKind::opens) continue;
    if (contains(state.inside | before, event.contact)) continue;
    const Contact& contact = model.contacts[index(event.contact)];
    const double gamma = gap_velocity(contact, u_sequence_, state.motion.t.hi);
    if (!(gamma < 0.0)) continue;
    const double epsilon = event.kind == ContactEventKind::closes ? 0.0 : contact.restitution;
    const double G = dynamics.G()(event.contact, event.contact);
    u_sequence_ -= (1.0 + epsilon) * gamma / G * dynamics.MinvW().col(event.contact);
  }
  on_u_ = u_sequence_ - now_.u;
  if (!(on_u_.norm() > same_impact * (now_.u - u_before_).norm())) return;
  ++state.ambiguous_impacts;
  add_unknown(on_u_);
}

// An event that jitters.
void TimingFilter::take_uncertain(const ContactEvent& event, ContactSet before,
                                  TimingState& state) {
  const bool closes = event.kind != ContactEventKind::opens;
  const int i = event.contact;
  state.chi = after(state.chi, event);
  if (contains(state.inside, i) || contains(before, i) == closes) return;
  Report report{Report::Kind::releases, i, before & state.chi};
  if (closes) {
    const ContactSet redundant = drop_redundant(report.held, bit(i), state);
    if (redundant != 0) return;
    report.kind = event.kind == ContactEventKind::closes ? Report::Kind::stays
                  : event.t - state.last_report[i] < unknown_time_->indistinct()
                      ? Report::Kind::burst
                      : Report::Kind::pulse;
    note_terms(i, state);
  }
  state.last_report[i] = event.t;
  state.motion.flow->enter(now_.q, now_.u, state.motion.t, no_gaps_.head(std::popcount(before)),
                           state.motion);
  u_before_ = now_.u;
  UnknownTime::Innovation innovation;
  if (!unknown_time_->take(report, state.motion, state.terms, 0.0, false, now_, innovation)) {
    begin_again(i, state);
    return;
  }
  add_time_rounding(state);
  columns_.merge(now_);
  report_ = report;
  if (!innovation.measured) return;
  note(innovation.square, state.consistency);
  if (closes) state.innovation = {event.t, i, innovation.gap, innovation.deviation};
}

// As if the machine were started now. No event fits less than one after which nothing is known.
void TimingFilter::begin_again(int contact, TimingState& state) {
  now_.q = start_.q;
  now_.u = start_.u;
  set_start(uncertainty_, now_);
  state.consistency = {};
  state.consistency.largest = infinity;
  state.last = {state.motion.t.hi, contact, Suspicion::model, infinity};
  ++state.lost;
}

// Those of `closing` that take no impulse of their own, since others hold their directions.
ContactSet TimingFilter::drop_redundant(ContactSet held, ContactSet closing,
                                        TimingState& state) const {
  const ContactSet redundant = closing & ~independent_of(flows_->dynamics().G(), held, closing);
  if (redundant == 0) return 0;
  ++state.redundancy.closings;
  state.redundancy.contact = std::countr_zero(redundant);
  return redundant;
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
  flow.enter_differences(now_.S_q.leftCols(c), now_.S_u.leftCols(c), z, v);
  for (Eigen::Index k = 0; k < c; ++k) {
    phi_[k] = (lambda.p.segment(nf, n) * z.col(k).array()).sum() +
              (lambda.r.segment(nf, n) * v.col(k).array()).sum();
  }
  const double scale = std::abs(lambda.constant) + (lambda.p * state.motion.x.z).abs().sum() +
                       (lambda.r * state.motion.x.v).abs().sum();
  const double off = time_rounding * state.motion.t.hi * rate(lambda, state.motion);
  condition(-value(lambda, state.motion), off * off, scale, state.consistency);
}

void TimingFilter::note_terms(int i, TimingState& state) const {
  const Contact& contact = flows_->dynamics().model().contacts[index(i)];
  const double length = contact.w.cwiseProduct(now_.q).cwiseAbs().sum() +
                        std::abs(contact.motion.amplitude) + std::abs(contact.clearance);
  const double speed = contact.w.cwiseProduct(now_.u).cwiseAbs().sum() +
                       std::abs(contact.motion.amplitude * contact.motion.frequency);
  state.terms.length = std::max(state.terms.length, length);
  state.terms.speed = std::max(state.terms.speed, speed);
}

// Variance of a functional of (q, u).
double TimingFilter::known_of(const Functional& of) const {
  double variance = 0.0;
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    variance += square(of.a.dot(now_.S_q.col(j)) + of.b.dot(now_.S_u.col(j)));
  }
  return variance;
}

// g_i = 0 of the contacts that close, gamma_i = 0 of those whose bounces have come to an end.
void TimingFilter::measure_closings(bool several, TimingState& state) {
  const Model& model = flows_->dynamics().model();
  const double t = state.motion.t.hi;
  for (Closing& closing : closings_) {
    closing.gamma = gap_velocity(model.contacts[index(closing.contact)], now_.u, t);
    closing.gamma_rate = rate(state.motion.flow->gap_velocity(closing.contact), state.motion);
  }
  const Eigen::Index c = now_.columns;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    const Closing& closing = closings_[k];
    const Contact& contact = model.contacts[index(closing.contact)];
    const Functional& acceleration = acceleration_[index(closing.contact)];
    auto phi = phi_.head(c);
    phi.noalias() = now_.S_u.leftCols(c).transpose().lazyProduct(contact.w);
    const double speed2 = closing.gamma * closing.gamma + phi.squaredNorm();
    phi.noalias() = now_.S_q.leftCols(c).transpose().lazyProduct(contact.w);
    const double gap_before = gap(contact, now_.q, t);
    note_terms(closing.contact, state);
    double noise = square(time_rounding * t) * speed2;
    // The master takes for one impact what touches within its rounding.
    if (several) noise += square(touching * state.terms.length);
    const double deviation = condition(-gap_before, noise, state.terms.length, state.consistency);
    if (k == 0 || std::abs(gap_before) > std::abs(state.innovation.gap)) {
      state.innovation = {t, closing.contact, gap_before, deviation};
    }
    if (closing.epsilon > 0.0 || contact.restitution == 0.0 || model.contacts.size() > 1) continue;
    phi.noalias() = now_.S_u.leftCols(c).transpose().lazyProduct(contact.w);
    // What is left of a chatter that is completed is always of one sign, and in proportion to an
    // acceleration that may not be known. It is not taken for more than it can say: where gamma is
    // known almost as well already, it says nothing; nor where contacts may have wedged each other.
    const double off = std::max(model.chatter_time, time_rounding * t);
    const double left = off * off * (square(closing.gamma_rate) + known_of(acceleration));
    if (phi.squaredNorm() > remainder_tells * left) {
      condition(-gap_velocity(contact, now_.u, t), left, state.terms.speed, state.consistency);
    }
  }
}

void TimingFilter::note(double square, Consistency& consistency) const {
  ++consistency.count;
  consistency.mean += (square - consistency.mean) / consistency_window;
  consistency.largest = std::max(consistency.largest, square);
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
    note(residual * residual / (alpha + square(insignificant * scale)), consistency);
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
    now_.q[i] += gain * now_.S_q.row(i).head(c).dot(phi.transpose());
    now_.u[i] += gain * now_.S_u.row(i).head(c).dot(phi.transpose());
  }
  take(now_.S_q.leftCols(c));
  take(now_.S_u.leftCols(c));
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
      gamma[k] = dynamics.W().col(contact(k)).dot(now_.S_u.col(j));
    }
    if (!impulses()) {
      ++state.refused_impacts;
      return;
    }
    for (Eigen::Index k = 0; k < n; ++k) now_.S_u.col(j) += Lambda[k] * directions_.col(k);
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    gamma[k] = gap_velocity(model.contacts[index(contact(k))], now_.u, state.motion.t.hi);
  }
  before_impact_ = now_.u;
  if (!impulses()) return;
  for (Eigen::Index k = 0; k < n; ++k) now_.u += Lambda[k] * directions_.col(k);
  if (n > 1 || staying != 0 || leaving != 0) decide(staying, leaving, state);
}

std::vector<TimingFilter::Closing>::iterator TimingFilter::find_closing(int contact) {
  return std::find_if(closings_.begin(), closings_.end(),
                      [&](const Closing& closing) { return closing.contact == contact; });
}

// The impact law itself on the mean, in place of the branch that took it to its u, where it agrees
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
    gamma[row] = closes ? gap_velocity(contact, before_impact_, state.motion.t.hi) : 0.0;
    epsilon[row++] = closes ? found->epsilon : contact.restitution;
  });
  if (impact(model.law, G, epsilon, gamma, Lambda, gamma_plus) != Solved::yes) return;
  on_u_ = before_impact_ - now_.u;
  bool as_reported = true;
  row = 0;
  for_each(closed, [&](int i) {
    on_u_ += Lambda[row] * dynamics.MinvW().col(i);
    if (contains(closing, i) && !(Lambda[row] > 0.0)) as_reported = false;
    if (contains(staying, i) && gamma_plus[row] > 0.0) as_reported = false;
    ++row;
  });
  if (!(on_u_.norm() > same_impact * (now_.u - before_impact_).norm())) return;
  ++state.ambiguous_impacts;
  add_unknown(on_u_);
  if (as_reported) now_.u += on_u_;
}

// Velocities that are known up to N(0, 1) times this.
void TimingFilter::add_unknown(const Eigen::VectorXd& on_u) {
  if (now_.columns == now_.S_q.cols()) columns_.merge(now_);
  now_.S_q.col(now_.columns).setZero();
  now_.S_u.col(now_.columns) = on_u;
  ++now_.columns;
}

}  // namespace sprag
