// What is said of the present around events that jitter, and what it says that none comes.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <span>

#include "sprag/estimation/force_terms.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// An event may be on its way where the gap, or the force, is less than so many of its deviations.
constexpr double deviations_to_expect = 4.0;
// Silence that is less likely than a deviation of seven sigma is no silence.
constexpr double most_square = 49.0;
constexpr double growth_of_looks = 0.25;
// What is published looks at so many of the last reports again.
constexpr std::int64_t most_unsettled = 4;
constexpr double as_good_as_over = 1e-6;  // probability that it is not

}  // namespace

// What the last reports say of t, in `now_` and `published_`: what they are about may have happened
// by then, or not, and not in their order. Contacts for which it certainly has leave `unsettled`.
// False where there are none.
bool TimingFilter::take_so_far(const TimingState& state, Instant t, ContactSet& unsettled) {
  std::int64_t first = state.instants;
  while (first > 0 && state.instants - first < most_unsettled) {
    const Covariance& last = slot(first);
    const Covariance& before = slot(first - 1);
    const bool kept = last.instants == first && before.instants == first - 1;
    if (!kept || last.event.kind == UncertainEvent::Kind::none) break;
    // Reports of one contact that have changed places.
    if (last.event.kind == UncertainEvent::Kind::known && last.mean.flow != before.mean.flow) break;
    if (!(t - last.mean.t < unknown_time_->latest()) || last.mean.t - before.mean.t < 0.0) break;
    --first;
  }
  if (first == state.instants) return false;
  load(slot(first), t);
  slot(first).mean.flow->propagate(slot(first).mean, t, published_);
  const Flow* behind = nullptr;  // the last event taken
  ContactSet to_come = 0;        // closed where that is still to be opened, or the other way round
  while (first < state.instants) {
    const Covariance& next = slot(++first);
    UncertainEvent event = next.event;
    if (event.kind == UncertainEvent::Kind::known) continue;
    const ContactSet locked = next.mean.flow->locked();
    const ContactSet changed = locked ^ slot(first - 1).mean.flow->locked();
    if (contains(to_come, event.contact)) {
      // All the more is what follows it.
      to_come ^= changed;
      continue;
    }
    event.held ^= to_come;
    if (behind != nullptr) enter(*behind, t, published_);
    published_.flow->state(published_, now_.q, now_.u);
    UnknownTime::Innovation innovation;
    if (!unknown_time_->take(event, published_, state.terms, t - next.mean.t, true, now_,
                             innovation)) {
      return false;
    }
    columns_.merge(now_);
    if (innovation.to_come < as_good_as_over) {
      unsettled &= ~bit(event.contact);
    } else {
      unsettled |= bit(event.contact);
    }
    if (innovation.to_come > 0.5) to_come ^= changed;
    behind = flows_->find(locked ^ to_come);
    if (behind == nullptr) behind = next.mean.flow;
  }
  if (behind == nullptr) return false;
  enter_motion(*behind, t, published_);
  return true;
}

// Around an event that jitters: the expectation over what may have happened by the present tick,
// in `now_`. False where there is nothing of the kind.
bool TimingFilter::publish(const TimingState& state) {
  const Published wanted{&state, state.tick, state.instants};
  const Published& last = last_published_;
  // Mean and deviations are asked for one after the other. Whatever changes a state loads another
  // covariance.
  if (wanted.state != last.state || wanted.tick != last.tick || wanted.instants != last.instants) {
    const bool overdue = is_overdue(state);
    const bool near = find_published(state);
    last_published_ = wanted;
    last_published_.near = near;
    last_published_.overdue = overdue;
  }
  return last_published_.near;
}

bool TimingFilter::find_published(const TimingState& state) {
  const Instant t = tick_instant(state.tick, h_);
  ContactSet unsettled = recently_reported(state, t);
  bool near = take_so_far(state, t, unsettled);
  if (!near) {
    load(state, t);
    published_ = state.motion;
    published_.t = t;
    published_.flow->state(published_, now_.q, now_.u);
  }
  // Several contacts may have met or left their supports.
  Unheard unheard;
  std::array<UnknownTime::Release, max_contacts> releases;
  std::size_t released = 0;
  while (true) {
    const auto [due, beyond_doubt] = next_due(state, published_, unheard, unsettled);
    if (due.kind == UncertainEvent::Kind::none) break;
    const bool pulse = due.kind == UncertainEvent::Kind::pulse;
    unknown_time_->take_silence(due, published_, state.terms, beyond_doubt, now_);
    unheard.quiet_for = std::min(unheard.quiet_for, unknown_time_->unheard_age());
    // What the others do is seen on the flow behind it, if that is certain.
    const Flow* flow = beyond_doubt ? unknown_time_->flow_after(due) : nullptr;
    // What has closed may be open again, once: contacts may throw each other off for ever. That
    // what has opened is closed again is not looked at: it leaves so slowly that its gap is long of
    // no sign.
    const bool closes = flow != nullptr && due.kind == UncertainEvent::Kind::sticks;
    if (closes && !contains(unheard.closed, due.contact)) {
      unheard.closed |= bit(due.contact);
    } else {
      unheard.done |= bit(due.contact);
    }
    if (flow == nullptr && due.kind == UncertainEvent::Kind::releases) {
      releases[released++] = {due.contact, unknown_time_->unheard_age()};
    } else {
      enter_motion(flow != nullptr ? *flow : *published_.flow, t, published_);
    }
    columns_.merge(now_);
    near = true;
    if (!pulse || !unknown_time_->bring_to_rest(due, published_, state.terms, now_)) continue;
    enter_motion(*published_.flow, t, published_);
    columns_.merge(now_);
  }
  // An impact may have thrown off what may have let go before it.
  const auto gone = [&](const UnknownTime::Release& of) {
    return !contains(published_.flow->locked(), of.contact);
  };
  const auto all = releases.begin() + static_cast<std::ptrdiff_t>(released);
  const std::span held(releases.begin(), std::remove_if(releases.begin(), all, gone));
  if (held.size() > 1) {
    std::ranges::sort(held, std::greater<>(), &UnknownTime::Release::age);
    unknown_time_->add_interplay(held, published_, now_);
  }
  return near && is_sane(now_);
}

// Contacts whose last reports may be of what is still to come.
ContactSet TimingFilter::recently_reported(const TimingState& state, Instant t) const {
  ContactSet recently = 0;
  for (int i = 0; i < flows_->dynamics().contacts() && unknown_time_; ++i) {
    if (t.hi - state.last_report[i] < unknown_time_->latest()) recently |= bit(i);
  }
  return recently;
}

// What is most likely to be reported next, if anything is, behind what has happened unheard; of
// open contacts of `unsettled` only what is beyond doubt. `now_` is at the motion's time.
TimingFilter::Due TimingFilter::next_due(const TimingState& state, const Motion& motion,
                                         const Unheard& unheard, ContactSet unsettled) {
  const ContactSet locked = motion.flow->locked();
  const auto any = [&](int i) {
    const bool held = contains(locked, i);
    UncertainEvent event{held ? UncertainEvent::Kind::releases : UncertainEvent::Kind::pulse, i,
                         locked & ~bit(i)};
    set_last(motion.t.hi, state, event);
    event.quiet_for = std::min(event.quiet_for, unheard.quiet_for);
    if (contains(unheard.closed, i)) {
      event.since_last = std::min(event.since_last, unheard.quiet_for);
    }
    return event;
  };
  int nearest = -1;
  double least = deviations_to_expect;
  ContactSet beyond_doubt = 0;
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    const bool held = contains(locked, i);
    if (contains(unheard.done | state.inside, i) || (contains(closed(state), i) && !held)) continue;
    if (held && contains(state.thrown, i)) continue;
    const double margin = unknown_time_ ? unknown_time_->margin(any(i), motion, state.terms, now_)
                                        : exact_margin(i, motion, state);
    if (margin < -deviations_to_expect) {
      beyond_doubt |= bit(i);
    } else if (!held && contains(unsettled, i)) {
      continue;
    }
    if (!(margin < least)) continue;
    least = margin;
    nearest = i;
  }
  if (nearest < 0) return {};
  // Of several that have happened the first.
  if (unknown_time_ && std::popcount(beyond_doubt) > 1) {
    double oldest = -1.0;
    for_each(beyond_doubt, [&](int i) {
      unknown_time_->log_of_silence(any(i), motion, state.terms, now_);
      if (!(unknown_time_->unheard_age() > oldest)) return;
      oldest = unknown_time_->unheard_age();
      nearest = i;
    });
  }
  const bool is_over = contains(beyond_doubt, nearest);
  if (contains(locked, nearest)) return {any(nearest), is_over};
  bool stays = restitution_of(nearest) == 0.0;
  if (stays && is_over && unknown_time_) {
    unknown_time_->log_of_silence(any(nearest), motion, state.terms, now_);
    motion.flow->propagate(motion, motion.t + -unknown_time_->unheard_age(), hit_);
    stays = would_stick(nearest, hit_);
  } else if (stays) {
    stays = would_stick(nearest, motion);
  }
  UncertainEvent impact = any(nearest);
  const UncertainEvent of = impact_of(nearest, stays, motion);
  impact.kind = of.kind;
  impact.held = of.held;
  return {impact, is_over};
}

// Whether what takes a contact's gap velocity away also presses it down.
bool TimingFilter::would_stick(int contact, const Motion& motion) {
  const Flow* flow = flows_->find(motion.flow->locked() | bit(contact));
  if (flow == nullptr) return false;
  motion.flow->state(motion, on_flow_, u_before_);
  flow->enter_closed(on_flow_, u_before_, motion.t, stuck_);
  return value(flow->force(contact), stuck_) > 0.0;
}

// How far a contact's gap, or its force if it is held, is above zero, in deviations of `now_`,
// where events come at their own times.
double TimingFilter::exact_margin(int contact, const Motion& motion, const TimingState& state) {
  const Flow& flow = *motion.flow;
  const bool held = contains(flow.locked(), contact);
  const Signal& signal = held ? flow.force(contact) : flow.gap(contact);
  const double of_columns = columns_.see(flow, signal, now_, phi_);
  double terms = state.terms.length;
  if (held) {
    const Terms size = state.terms.of_coordinates(now_.q, now_.u, largest_w_);
    terms =
        std::max({of_columns, largest_terms(signal, motion),
                  force_terms(flows_->dynamics(), contact, acceleration_[index(contact)], size)});
  }
  return value(signal, motion) /
         std::hypot(phi_.head(now_.columns).norm(), measurement_rounding * terms);
}

// Silence is information: an open contact whose gap is negative beyond doubt must have closed, a
// held one whose force would have to pull must have opened.
void TimingFilter::listen(Instant t, TimingState& state) {
  const double since = t - state.covariance_time;
  // Of two reports of one instant the other must have come.
  if (!state.unknown && state.thrown != 0 &&
      t.hi > state.thrown_since + 2.0 * unknown_time_->latest()) {
    state.unknown = true;
    ++state.silences;
    state.last = {state.thrown_since, std::countr_zero(state.thrown), Suspicion::missing_event,
                  infinity};
  }
  while (!state.unknown) {
    const double next =
        state.watched == 0.0
            ? first_look_
            : state.watched + std::min(growth_of_looks * state.watched, longest_look_);
    if (!(next <= since)) return;
    state.watched = next;
    const Inconsistency silence = overdue(state, state.covariance_time + next);
    if (!(silence.square > most_square)) continue;
    state.unknown = true;
    ++state.silences;
    state.last = silence;
  }
}

// Whether a gap, or the force of what is held, is below zero.
bool TimingFilter::is_suspect(const Motion& motion, const TimingState& state) const {
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    const bool held = contains(motion.flow->locked(), i);
    if (contains(state.inside, i) || (contains(closed(state), i) && !held)) continue;
    const Signal& margin = held ? motion.flow->force(i) : motion.flow->gap(i);
    if (value(margin, motion) < 0.0) return true;
  }
  return false;
}

// Between the looks at silence, which do not depend on the ticks, that may have gone on for too
// long at the present tick already.
bool TimingFilter::is_overdue(const TimingState& state) {
  return is_suspect(state.motion, state) &&
         overdue(state, tick_instant(state.tick, h_)).square > most_square;
}

// At the present tick.
bool TimingFilter::is_known(const TimingState& state) {
  if (!state.trusted || state.unknown || state.inside != 0 || scale_is_open()) return false;
  if (!unknown_time_) return !is_overdue(state);
  publish(state);
  return !last_published_.overdue;
}

// How unlikely it is that nothing has been reported by t.
Inconsistency TimingFilter::overdue(const TimingState& state, Instant t) {
  const Covariance& from = slot(state.instants);
  if (from.instants != state.instants) return {};
  from.mean.flow->propagate(from.mean, t, sample_);
  if (!is_suspect(sample_, state)) return {};
  // The mean goes on from behind what was reported, even where that is still to come.
  const ContactSet recently = recently_reported(state, t);
  ContactSet unsettled = recently;
  if (unknown_time_ && take_so_far(state, t, unsettled)) {
    sample_ = published_;
  } else {
    load(from, t);
    sample_.flow->state(sample_, now_.q, now_.u);
  }
  const UncertainEvent due =
      next_due(state, sample_, {.done = recently, .quiet_for = 0.0}, 0).event;
  if (due.kind == UncertainEvent::Kind::none) return {};
  const double log_probability =
      unknown_time_ ? unknown_time_->log_of_silence(due, sample_, state.terms, now_)
                    : log_normal_cdf(exact_margin(due.contact, sample_, state));
  return {t.hi, due.contact, Suspicion::missing_event, -2.0 * log_probability};
}

}  // namespace sprag
