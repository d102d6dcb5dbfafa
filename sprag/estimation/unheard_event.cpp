// What it says that no event has been reported.
#include <algorithm>
#include <cmath>

#include "sprag/estimation/unknown_time.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// For the last crossing of the mean.
constexpr int looks_back = 17;
constexpr int crossing_steps = 16;
// Hypotheses about when it was, over +- so many of its deviations.
constexpr int unheard_nodes = 16;
constexpr double unheard_reach = 5.0;
// Standard deviations.
constexpr double surely_behind = 3.0;

}  // namespace

double UnknownTime::margin(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                           const Belief& belief) {
  look_for(due, motion, terms, belief);
  return find_least_margin(due);
}

double UnknownTime::margin(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                           const Belief& belief, double age) {
  look_for(due, motion, terms, belief);
  return margin_at(age);
}

double UnknownTime::margin_at(double age) {
  belief_.go_back(age);
  return belief_.value() /
         std::sqrt(belief_.phi().squaredNorm() + square(value_rounding_) + least_square);
}

// What has been beyond doubt may be over: the motion of which nothing has been heard would have
// come back.
double UnknownTime::find_least_margin(const UncertainEvent& due) {
  const double now = margin_at(0.0);
  least_age_ = 0.0;
  if (now < -beyond_doubt || !(belief_.rate() > 0.0)) return now;
  const double oldest = std::min(latest(), due.quiet_for);
  double least = -beyond_doubt;
  for (int i = 1; i <= looks_back && oldest > 0.0; ++i) {
    const double age = i * oldest / looks_back;
    if (!(belief_.value_at(age) < 0.0)) continue;
    const double then = margin_at(age);
    if (!(then < least)) continue;
    least = then;
    least_age_ = age;
  }
  return least_age_ > 0.0 ? least : now;
}

bool UnknownTime::bring_to_rest(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                                Belief& belief) {
  look_for(due, motion, terms, belief);
  if (!(margin_at(0.0) < -beyond_doubt)) return false;
  const double gap = value(belief_.signal(), motion);
  const double gap_velocity = rate(belief_.signal(), motion);
  const Eigen::Index c = belief.columns;
  belief.q -= gap * impact_u_;
  belief.u -= gap_velocity * impact_u_;
  belief.S_q.middleCols(c, 2).setZero();
  belief.S_u.middleCols(c, 2).setZero();
  belief.S_q.col(c) = gap * impact_u_;
  belief.S_u.col(c + 1) = gap_velocity * impact_u_;
  // What that has done to the rest of the machine since.
  move_impact(unheard_age_);
  belief.S_q.col(c + 2) = gap_velocity * moved_q_;
  belief.S_u.col(c + 2) = gap_velocity * moved_u_;
  belief.columns += 3;
  return true;
}

double UnknownTime::log_of_silence(const UncertainEvent& due, const Motion& motion,
                                   const Terms& terms, Belief& belief) {
  changes_flow_ = false;
  hear_nothing(due, motion, terms, belief);
  return mixture_.log_total();
}

void UnknownTime::take_silence(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                               bool is_over, Belief& belief) {
  const bool releases = due.kind == UncertainEvent::Kind::releases;
  const Flow* after = flow_after(due);
  // An impact that may have been has not been gone on from for long.
  changes_flow_ = releases || (is_over && after != nullptr && after != motion.flow);
  hear_nothing(due, motion, terms, belief);
  if (changes_flow_ && !releases) add_covariances(due, belief);
  mixture_.collapse(0, belief);
}

// The hypotheses.
void UnknownTime::hear_nothing(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                               Belief& belief) {
  delay_ = 0.0;
  belief.components = 0;
  look_for(due, motion, terms, belief);
  mixture_.begin(belief);
  seen_size_ = 0;

  // It has not happened yet.
  find_least_margin(due);
  Sight sight = see(due.kind, least_age_);
  const double s = std::sqrt(sight.s2);
  const double x = sight.value / s;
  const double hazard = normal_hazard(x);
  EventMixture::Hypothesis not_yet;
  not_yet.log_weight = log_normal_cdf(x);
  not_yet.rest_phi = sight.rest_phi;
  not_yet.shift_phi = hazard;
  not_yet.taken_along_phi = std::clamp(hazard * (x + hazard), 0.0, 1.0);
  mixture_.add(not_yet);
  mixture_.phi() = belief_.phi() / s;
  mixture_.psi().setZero();

  // It has, and will be reported. The mean's last crossing, which may be over: a shallow one lasts
  // shorter than reports may take.
  const bool is_behind_last = due.since_last < latest() &&
                              surely_behind * due.since_deviation < due.since_last - least_age_;
  const double oldest = is_behind_last ? due.since_last : latest();
  double age = least_age_, since = least_age_;
  for (int i = 1; i <= looks_back && sight.value < 0.0; ++i) {
    since = age;
    age = least_age_ + i * (oldest - least_age_) / looks_back;
    // At the contact's last event it leaves zero.
    if (is_behind_last && i == looks_back) break;
    sight = see(due.kind, age);
  }
  const bool from_last = is_behind_last && age == oldest;
  if (age > least_age_ && (from_last || !(sight.value < 0.0))) {
    // Newton's steps, between where it is over and where it is to come.
    double until = age;
    if (from_last) sight = see(due.kind, age = 0.5 * (since + until));
    (sight.value < 0.0 ? since : until) = age;
    for (int i = 0; i < crossing_steps; ++i) {
      const double step = sight.value / sight.rate;
      if (sight.rate < 0.0 && std::abs(step) * -sight.rate < 0.1 * std::sqrt(sight.s2)) break;
      const double next = sight.rate < 0.0 ? age + step : until;
      age = next > since && next < until ? next : 0.5 * (since + until);
      sight = see(due.kind, age);
      (sight.value < 0.0 ? since : until) = age;
    }
  }
  unheard_age_ = age;
  const double width = std::abs(std::sqrt(sight.s2) / sight.rate);
  const double low = std::max(least_age_, age - unheard_reach * width);
  const double high = std::min(oldest, age + unheard_reach * width);
  const double step = (high - low) / unheard_nodes;
  for (int i = 0; i < unheard_nodes && step > 0.0; ++i) {
    const double at_age = low + (i + 0.5) * step;
    add(due, at_age, std::log(step) - half_log_two_pi + log_normal_cdf(-at_age / sigma_), true);
  }
}

void UnknownTime::add_interplay(std::span<const Release> releases, const Motion& motion,
                                Belief& belief) {
  const Flow& flow = *motion.flow;
  belief_.begin(flow.force(releases.front().contact), motion, belief);
  // One after the other, less one by one.
  flow.state(motion, q_, u_);
  const auto others = static_cast<double>(releases.size() - 1);
  q_after_ = others * q_;
  u_after_ = others * u_;
  for (const Release& release : releases) {
    const Flow* alone = flows_->find(flow.locked() & ~bit(release.contact));
    if (alone == nullptr) return;
    belief_.go_back(release.age);
    flow.state(belief_.mean(), q_, u_);
    go_on(*alone, belief_.mean().t, motion.t, q_, u_);
    q_after_ -= q_;
    u_after_ -= u_;
  }
  belief_.go_back(releases.front().age);
  flow.state(belief_.mean(), q_, u_);
  ContactSet held = flow.locked();
  for (std::size_t k = 0; k < releases.size(); ++k) {
    held &= ~bit(releases[k].contact);
    const Flow* next = flows_->find(held);
    if (next == nullptr) return;
    const double until = k + 1 < releases.size() ? releases[k + 1].age : 0.0;
    go_on(*next, motion.t + -releases[k].age, motion.t + -until, q_, u_);
  }
  belief.S_q.col(belief.columns) = q_after_ + q_;
  belief.S_u.col(belief.columns) = u_after_ + u_;
  ++belief.columns;
}

}  // namespace sprag
