#include "sprag/estimation/unknown_time.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "sprag/estimation/active_impact.h"
#include "sprag/mechanics/impact_law.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr int burst_nodes = 11;
constexpr double burst_reach = 3.0;
// Covariances are looked at at three ages, in deviations from their mean (Gauss-Hermite).
constexpr double outer_age = 1.7320508075688772;  // sqrt(3)
constexpr double outer_weight = 1.0 / 6.0;
// Of d; then the sign of a rate is all that counts.
constexpr double most_even = 1e6;
// An angle; below it what a hypothesis makes of the state goes with its time.
constexpr double straight = 5e-3;

}  // namespace

UnknownTime::UnknownTime(const Flows& flows, double sigma, Eigen::Index columns)
    : flows_(&flows),
      sigma_(sigma),
      mixture_(columns, flows.dynamics().coordinates()),
      belief_(flows, columns) {
  const Eigen::Index f = flows.dynamics().coordinates();
  psi_.setZero(columns);
  xi_.setZero(columns);
  for (Eigen::VectorXd* x : {&no_q_, &impact_u_, &q_, &u_, &q_after_, &u_after_}) x->setZero(f);
  for (Eigen::MatrixXd* x : {&impact_z_, &impact_v_, &moved_z_, &moved_v_, &moved_q_, &moved_u_}) {
    x->setZero(f, 1);
  }
  flows[0].enter(no_q_, no_q_, Instant{}, Eigen::VectorXd(), after_);
}

// `signal` is zero at the event, on the flow of the motion.
void UnknownTime::look(const Signal& signal, double value_rounding, double rate_rounding,
                       double time_rounding, const Motion& motion, const Belief& belief) {
  value_rounding_ = value_rounding;
  rate_rounding_ = rate_rounding;
  time_rounding_ = time_rounding;
  rate_noise_ = 0.0;
  components_ = belief.components;
  columns_ = belief.columns - components_;
  for (std::size_t k = 0; k < static_cast<std::size_t>(components_); ++k) {
    roots_[k] = std::sqrt(belief.weights[k]);
    log_weights_[k] = std::log(belief.weights[k]);
  }
  best_weight_ = -infinity;
  innovation_ = {};
  belief_.begin(signal, motion, belief);
  even_ = 0.0;
}

// Afterwards psi_ and views_ are those of a hypothesis.
UnknownTime::Sight UnknownTime::see(UncertainEvent::Kind kind, double age) {
  belief_.go_back(age);
  Sight sight{};
  sight.value = belief_.value();
  sight.rate = belief_.rate();
  const auto phi = belief_.phi().tail(columns_);
  auto psi = psi_.head(columns_);
  psi = belief_.psi().tail(columns_);
  const double r = square(value_rounding_) + square(time_rounding_ * sight.rate) + least_square;
  sight.s2 = phi.squaredNorm() + r;
  sight.all_s2 = sight.s2 + belief_.phi().head(components_).squaredNorm();
  const double kappa = phi.dot(psi) / sight.s2;
  psi -= kappa * phi;
  sight.d =
      std::sqrt(psi.squaredNorm() + square(kappa) * r + square(rate_rounding_) + least_square);
  sight.rest_phi = r / sight.s2;
  if (components_ == 0) {
    views_[0] = view(kind, sight, kappa, sight.value, sight.rate);
    sight.mean_rate = views_[0].mean_rate;
    sight.variance = views_[0].variance;
    sight.log_weight = views_[0].log_weight;
    return sight;
  }
  double highest = -infinity;
  for (int k = 0; k < components_; ++k) {
    const auto i = static_cast<std::size_t>(k);
    views_[i] = view(kind, sight, kappa, sight.value + belief_.phi()[k] / roots_[i],
                     sight.rate + belief_.psi()[k] / roots_[i]);
    views_[i].log_weight += log_weights_[i];
    highest = std::max(highest, views_[i].log_weight);
  }
  double total = 0.0;
  double second = 0.0;
  for (const View& one : std::span(views_).first(static_cast<std::size_t>(components_))) {
    const double share = std::exp(one.log_weight - highest);
    if (!(share > 0.0)) continue;
    total += share;
    sight.mean_rate += share * one.mean_rate;
    second += share * (one.variance + square(one.mean_rate));
  }
  sight.mean_rate /= total;
  sight.variance = std::max(second / total - square(sight.mean_rate), 0.0);
  sight.log_weight = highest + std::log(total);
  return sight;
}

double UnknownTime::even_of(const Sight& sight) const {
  return std::min(sight.s2 / (-sight.mean_rate * square(sigma_)), most_even * sight.d);
}

UnknownTime::View UnknownTime::view(UncertainEvent::Kind kind, const Sight& sight, double kappa,
                                    double value, double rate) const {
  View view{};
  view.value = value;
  view.mu = rate - kappa * value;
  view.log_weight = -0.5 * square(value) / sight.s2 - 0.5 * std::log(sight.s2);
  if (kind == UncertainEvent::Kind::stays) {
    // No crossing: the contact has come to rest.
    const double all = square(sight.d) + square(rate_noise_);
    view.mean_rate = view.mu * square(rate_noise_) / all;
    view.variance = square(sight.d) * square(rate_noise_) / all;
    view.log_weight -= 0.5 * square(view.mu) / all + 0.5 * std::log(all);
  } else {
    const FluxMoments flux = flux_moments(view.mu, sight.d, even_);
    view.mean_rate = flux.mean;
    view.variance = flux.variance;
    view.log_weight += flux.log_weight;
  }
  return view;
}

// The impact of the contact on the machine before the event, for one unit of change of its gap
// velocity.
void UnknownTime::set_impact(const UncertainEvent& event) {
  const Dynamics& dynamics = flows_->dynamics();
  const Flow& flow = belief_.flow();
  const int i = event.contact;
  const double epsilon = event.kind == UncertainEvent::Kind::sticks
                             ? 0.0
                             : dynamics.model().contacts[static_cast<std::size_t>(i)].restitution;
  const ContactSet held = flow.locked() & ~bit(i);
  const SingleImpact impact = single_impact(dynamics, i, epsilon, held);
  if (impact.solved == Solved::yes) {
    impact_u_.setZero();
    Eigen::Index row = 0;
    for_each(held | bit(i),
             [&](int j) { impact_u_ += impact.Lambda[row++] * dynamics.MinvW().col(j); });
    kick_ = -impact.change;
  } else {
    impact_u_ = dynamics.MinvW().col(i) / dynamics.G()(i, i);
    kick_ = -1.0 - epsilon;
  }
  const Eigen::Index n = flow.modes();
  flow.enter_differences(no_q_, impact_u_, impact_z_.topRows(n), impact_v_.topRows(n));
}

// The impact, moved on by `age`.
void UnknownTime::move_impact(double age) {
  const Flow& flow = belief_.flow();
  const Eigen::Index n = flow.modes();
  belief_.move(age, impact_z_.col(0).head(n), impact_v_.col(0).head(n), moved_z_.col(0).head(n),
               moved_v_.col(0).head(n));
  flow.state_differences(moved_z_.topRows(n), moved_v_.topRows(n), moved_q_, moved_u_);
}

// b of the hypothesis just added.
void UnknownTime::add_moved_impact(double age) {
  move_impact(age);
  mixture_.b_q() = moved_q_.col(0);
  mixture_.b_u() = moved_u_.col(0);
}

// q and u at `from` become those at `to`, with the contacts of this flow held.
void UnknownTime::go_on(const Flow& flow, Instant from, Instant to, Eigen::VectorXd& q,
                        Eigen::VectorXd& u) {
  flow.enter_closed(q, u, from, after_);
  flow.propagate(after_, to, after_);
  flow.state(after_, q, u);
}

// b of the hypothesis just added: what it makes of its mean, xi_, that it has moved on another flow
// since, behind an impact that changes the gap velocity.
void UnknownTime::add_changed_flow(const Flow& after, double gap_velocity_change) {
  const Motion& mean = belief_.mean();
  belief_.set_xi(xi_.head(columns_));
  belief_.flow().state(mean, q_after_, u_after_);
  u_after_ += gap_velocity_change * impact_u_;
  go_on(after, mean.t, belief_.motion().t, q_after_, u_after_);
  belief_.return_to_motion();
  belief_.flow().state(mean, q_, u_);
  mixture_.b_q() = q_after_ - q_;
  mixture_.b_u() = u_after_ - u_;
}

void UnknownTime::add(const UncertainEvent& event, double age, double log_weight,
                      bool has_happened) {
  const Sight sight = see(event.kind, age);
  const double s = std::sqrt(sight.s2);
  const auto phi = belief_.phi().tail(columns_);
  const auto psi = psi_.head(columns_);
  const bool impact = is_impact(event);
  const Flow* after = nullptr;
  if (has_happened && changes_flow_ && belief_.reaches(age)) after = flow_after(event);
  const bool kicks = has_happened && impact && after == nullptr;
  const auto of_components =
      std::span(of_components_).first(static_cast<std::size_t>(std::max(components_, 1)));
  for (std::size_t k = 0; k < of_components.size(); ++k) {
    const View& view = views_[k];
    EventMixture::Hypothesis& of = of_components[k] = {};
    of.log_weight = view.log_weight + log_weight;
    of.rest_phi = sight.rest_phi;
    of.shift_phi = -view.value / s;
    of.shift_psi = (view.mean_rate - view.mu) / sight.d;
    of.taken_along_phi = 1.0;
    of.taken_along_psi = 1.0 - view.variance / square(sight.d);
    if (kicks) {
      of.alpha = kick_ * view.mean_rate;
      of.beta = square(kick_) * view.variance;
      of.slope = kick_ * view.variance / sight.d;
    } else if (after != nullptr) {
      of.alpha = 1.0;
    }
  }
  mixture_.add(of_components);
  Seen& seen = seen_[seen_size_++];
  seen = {sight.log_weight + log_weight, age, sight.mean_rate, sight.variance, 0.0, 0.0, 0.0, 0.0};
  seen.changes_flow = after != nullptr;
  if (impact) {
    // The change of the gap velocity where it has happened.
    seen.after = (1.0 + kick_) * sight.mean_rate;
    seen.var_after = square(1.0 + kick_) * sight.variance;
    seen.change = kick_ * sight.mean_rate;
    seen.var_change = square(kick_) * sight.variance;
  } else if (event.kind == UncertainEvent::Kind::stays) {
    seen.change = -sight.mean_rate;
    seen.var_change = sight.variance;
  }
  mixture_.phi() = phi / s;
  mixture_.psi() = psi / sight.d;
  if (kicks) add_moved_impact(age);
  if (after == nullptr) return;
  const EventMixture::Hypothesis& of = of_components.front();
  xi_.head(columns_) = of.shift_phi / s * phi + of.shift_psi / sight.d * psi;
  add_changed_flow(*after, impact ? kick_ * sight.mean_rate : 0.0);
}

// None where it has not been built.
const Flow* UnknownTime::flow_after(const UncertainEvent& event) const {
  const bool stays =
      event.kind == UncertainEvent::Kind::stays || event.kind == UncertainEvent::Kind::sticks;
  return flows_->find(stays ? event.held | bit(event.contact) : event.held);
}

// The covariance within the hypotheses of an event that changes the flow: each has been on the one
// behind it since its own time, by which a gap that was zero until then is known worse the longer
// that is.
void UnknownTime::add_covariances(const UncertainEvent& event, const Belief& belief) {
  struct Ages {
    double weight = 0.0, mean = 0.0, square = 0.0;
  } before, after;
  const double total = mixture_.log_total();
  for (const Seen& seen : std::span(seen_).first(static_cast<std::size_t>(seen_size_))) {
    const double w = std::exp(seen.log_weight - total);
    if (!(w > 0.0)) continue;
    Ages& ages = seen.changes_flow ? after : before;
    ages.weight += w;
    const double off = seen.age - ages.mean;
    ages.mean += off * w / ages.weight;
    ages.square += w * off * (seen.age - ages.mean);
  }
  if (!(after.weight > 0.0)) return;
  if (before.weight > 0.0) add_covariance(event, before.mean, before.weight, nullptr, belief);
  const Flow* flow = flow_after(event);
  const double outer = outer_age * std::sqrt(after.square / after.weight);
  add_covariance(event, after.mean, after.weight * (1.0 - 2.0 * outer_weight), flow, belief);
  for (const double off : {-outer, outer}) {
    add_covariance(event, after.mean + off, after.weight * outer_weight, flow, belief);
  }
}

// That of a hypothesis of this age: on the flow `after` since, if there is one.
void UnknownTime::add_covariance(const UncertainEvent& event, double age, double share,
                                 const Flow* after, const Belief& belief) {
  const Sight sight = see(event.kind, age);
  EventMixture::Within& within = mixture_.add_within(share);
  if (after != nullptr) {
    const double kick = is_impact(event) ? kick_ : 0.0;
    belief_.change_flow(*after, age, kick, impact_u_, within.S_q, within.S_u);
  } else {
    within.S_q.leftCols(columns_) = belief.S_q.leftCols(columns_);
    within.S_u.leftCols(columns_) = belief.S_u.leftCols(columns_);
  }
  // What it measures is known, and its rate up to what the flux says: I - taken along along^T of
  // the variance is left, `rest` of it in this direction.
  const auto take = [&](double taken, const auto& along, double rest) {
    const double part = taken / (1.0 + std::sqrt(rest));
    for (Eigen::MatrixXd* S : {&within.S_q, &within.S_u}) {
      for (Eigen::Index i = 0; i < S->rows(); ++i) {
        auto row = S->row(i).head(columns_);
        row -= part * row.dot(along.transpose()) * along.transpose();
      }
    }
  };
  take(1.0 / sight.s2, belief_.phi(), sight.rest_phi);
  const auto psi = psi_.head(columns_);
  const double of_rate = (1.0 - sight.variance / square(sight.d)) / square(sight.d);
  take(of_rate, psi, std::max(1.0 - of_rate * psi.squaredNorm(), 0.0));
}

// A pulse too close to the one before: it turns the gap velocity round wherever it goes, and says
// nothing else. What comes back so soon has left with epsilon times the gap velocity before, so
// that the n-th of a row takes (1 - epsilon^2) epsilon^2n of the energy; were each to take its full
// share, at a time of its own, the modes would lose what no chatter takes.
void UnknownTime::add_burst(const UncertainEvent& event, double age, bool has_happened) {
  belief_.go_back(age);
  const double mu = belief_.rate();
  const auto psi = belief_.psi();
  const double d = std::sqrt(psi.squaredNorm() + square(rate_rounding_) + least_square);
  EventMixture::Hypothesis of;
  of.log_weight = log_prior(age);
  if (has_happened) {
    const double restitution =
        flows_->dynamics().model().contacts[static_cast<std::size_t>(event.contact)].restitution;
    const double kept = 1.0 - std::pow(restitution, 2 * event.in_row);
    const double a = mu / d;
    const double p = std::erf(a / std::numbers::sqrt2);
    const double all = square(mu) + square(d);
    const double after =
        restitution * (2.0 * d * std::exp(-0.5 * a * a - half_log_two_pi) + mu * p);
    const double slope = restitution * p - 1.0;
    const double further = square(restitution) * all - square(after) - square(restitution * p * d) +
                           kept * (1.0 - square(restitution)) * all;
    of.alpha = after - mu;
    of.slope = slope * d;
    of.beta = square(slope * d) + std::max(further, 0.0);
  }
  mixture_.add(of);
  seen_[seen_size_++] = {of.log_weight, age,           mu,
                         square(d),     mu + of.alpha, square(d) + 2.0 * of.slope * d + of.beta,
                         of.alpha,      of.beta};
  mixture_.phi().setZero();
  mixture_.psi() = psi / d;
  if (has_happened) add_moved_impact(age);
}

// Closings are seen by the gap, releases by the force.
void UnknownTime::look_for(const UncertainEvent& event, const Motion& motion, const Terms& terms,
                           const Belief& belief) {
  const double time_rounding = time_step * std::max(motion.t.hi, sigma_);
  if (event.kind == UncertainEvent::Kind::releases) {
    const Signal& force = motion.flow->force(event.contact);
    const double largest = largest_terms(force, motion);
    look(force, measurement_rounding * largest, measurement_rounding * largest / sigma_,
         release_rounding * time_rounding, motion, belief);
  } else {
    look(motion.flow->gap(event.contact), measurement_rounding * terms.length,
         measurement_rounding * terms.speed, time_rounding, motion, belief);
    set_impact(event);
  }
}

bool UnknownTime::take(const UncertainEvent& event, const Motion& motion, const Terms& terms,
                       double delay, bool so_far, Belief& belief, Innovation& innovation) {
  delay_ = delay;
  closed_since_ = delay + event.held_for;
  set_order(event, motion);
  const bool is_burst = event.kind == UncertainEvent::Kind::burst;
  const Flow* after = flow_after(event);
  changes_flow_ = !is_burst && after != motion.flow && (after != nullptr || !is_impact(event));
  if (is_burst || changes_flow_) belief.components = 0;
  look_for(event, motion, terms, belief);
  mixture_.begin(belief);
  seen_size_ = 0;
  const auto has_happened = [&](double age) { return !so_far || age >= 0.0; };
  Nodes nodes{delay_ - burst_reach * sigma_, 2.0 * burst_reach * sigma_ / (burst_nodes - 1),
              burst_nodes};
  if (is_burst) {
    for (int i = 0; i < nodes.count; ++i) {
      const double age = nodes.first + i * nodes.step;
      add_burst(event, age, has_happened(age));
    }
  } else {
    if (event.kind == UncertainEvent::Kind::stays) {
      const double chatter = flows_->dynamics().model().chatter_time;
      rate_noise_ = chatter * std::abs(second_rate(belief_.signal(), motion)) + rate_rounding_;
    }
    const Sight reported = see(event.kind, delay_);
    even_ = even_of(reported);
    nodes = find_nodes(event.kind);
    innovation_.gap = reported.value;
    innovation_.deviation = std::sqrt(reported.s2 + square(reported.rate * sigma_));
    innovation_.measured = true;
    for (int i = 0; i < nodes.count; ++i) {
      const double age = nodes.first + i * nodes.step;
      add(event, age, log_prior(age), has_happened(age));
    }
    if (changes_flow_) add_covariances(event, belief);
  }
  int first_over = 0;
  while (first_over < nodes.count && nodes.first + first_over * nodes.step < 0.0) ++first_over;
  innovation_.to_come = std::exp(mixture_.log_total_of_first(first_over) - mixture_.log_total());
  innovation = innovation_;
  const bool goes_on = event.kind == UncertainEvent::Kind::pulse && !changes_flow_;
  return mixture_.collapse(goes_on && is_bent(motion, nodes) ? Belief::most_components : 0, belief);
}

UnknownTime::Misfit UnknownTime::misfit(const UncertainEvent& event, const Motion& motion,
                                        const Terms& terms, const Belief& belief) {
  delay_ = 0.0;
  closed_since_ = event.held_for;
  set_order(event, motion);
  look_for(event, motion, terms, belief);
  even_ = even_of(see(event.kind, delay_));
  find_nodes(event.kind);
  return {innovation_.square, best_age_};
}

// Whether what is known behind an event is curved in when that was, to speak of.
bool UnknownTime::is_bent(const Motion& motion, const Nodes& nodes) const {
  const double deviation = 0.5 * (nodes.count - 1) * nodes.step / node_reach;
  const double turns =
      std::abs(second_rate(belief_.signal(), motion) / rate(belief_.signal(), motion));
  return deviation * std::max(belief_.fastest(), turns) > straight;
}

UnknownTime::Impact UnknownTime::impact() const {
  double highest = -infinity;
  for (int i = 0; i < seen_size_; ++i) highest = std::max(highest, seen_[i].log_weight);
  const auto moment = [&](double Seen::*mean, double Seen::*variance) -> Moment {
    double total = 0.0, first = 0.0, second = 0.0;
    for (int i = 0; i < seen_size_; ++i) {
      const double w = std::exp(seen_[i].log_weight - highest);
      if (!(w > 0.0)) continue;
      total += w;
      first += w * seen_[i].*mean;
    }
    first /= total;
    for (int i = 0; i < seen_size_; ++i) {
      const double w = std::exp(seen_[i].log_weight - highest);
      if (!(w > 0.0)) continue;
      second += w * square(seen_[i].*mean - first);
      if (variance != nullptr) second += w * seen_[i].*variance;
    }
    return {first, std::sqrt(second / total)};
  };
  Impact impact{moment(&Seen::age, nullptr), moment(&Seen::before, &Seen::var_before),
                moment(&Seen::after, &Seen::var_after), moment(&Seen::change, &Seen::var_change)};
  // Hypotheses are further apart than what the signal's rounding makes of a time.
  impact.age.deviation =
      std::max(impact.age.deviation, value_rounding_ / std::abs(impact.before.mean));
  return impact;
}

}  // namespace sprag
