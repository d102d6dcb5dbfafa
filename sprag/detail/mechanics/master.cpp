#include "sprag/detail/mechanics/master.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {
namespace {

// This many events, each within a few roundings of t of the next, are a standstill of time.
constexpr int events_of_standstill = 10000;
constexpr double roundings_of_standstill = 4.0;
// Bounces shorter than this share of chatter_time cannot be distinguished either.
constexpr double resolvable_of_chatter = 1e-6;
// Joint chatter: after this many brief contacts in close succession the contacts are held together.
// This many in spite of that are a standstill of time.
constexpr int brief_contacts_of_chatter = 16;
constexpr int brief_contacts_of_standstill = 1000;
constexpr double chatters_of_brief_contact = 128.0;
constexpr double brief_share = 1e-4;  // share of the machine's time_scale()

// "contact 2" or "contacts 1, 2 and 4".
std::string list(ContactSet contacts) {
  std::string text = std::popcount(contacts) == 1 ? "contact " : "contacts ";
  int left = std::popcount(contacts);
  for_each(contacts, [&](int i) {
    text += std::to_string(i + 1);
    --left;
    if (left > 0) text += left == 1 ? " and " : ", ";
  });
  return text;
}

}  // namespace

Master::Master(Model model, const State& start)
    : Master(std::make_unique<const Flows>(std::move(model)), start) {}

Master::Master(std::unique_ptr<const Flows> own, const State& start) : Master(*own, start, 0.0, 0) {
  own_flows_ = std::move(own);
}

Master::Master(const Flows& flows, const State& start, double t, ContactSet closed)
    : flows_(flows),
      solver_(flows_, DependentContacts::refuse),
      start_(start),
      held_at_start_(closed) {
  const int m = flows_.dynamics().contacts();
  order_.assign(index(m), 0);
  completion_.assign(index(m), infinity);
  closed_at_.assign(index(m), -infinity);
  epsilon_.assign(index(m), 0.0);
  solver_.start(start, at(t), motion_);
}

void Master::fail(const std::string& what) const {
  throw SimulationError("t = " + std::to_string(now()) + ": " + what);
}

void Master::record(int contact, ContactEventKind kind, std::vector<ContactEvent>& events) {
  const ContactEvent event{now(), contact, kind};
  if (kind == ContactEventKind::closes) {
    closed_at_[index(contact)] = now();
  } else if (kind == ContactEventKind::opens && is_brief(now() - closed_at_[index(contact)])) {
    count_brief_contact();
  }
  closed_ = after(closed_, event);
  events.push_back(event);
}

// Whether a sustained contact of this duration belongs to a joint chatter. A chatter of one contact
// takes 1 / (1 - epsilon) times its first flight. The limit is a multiple of the chatters that
// chatter_time completes, and a small share of the machine's own time.
bool Master::is_brief(double duration) {
  double least = 1.0;
  for (const Contact& contact : flows_.dynamics().model().contacts) {
    if (contact.restitution < 1.0) least = std::min(least, 1.0 - contact.restitution);
  }
  if (duration > chatters_of_brief_contact / least * shortest_chatter()) return false;
  if (machine_time_ == 0.0) machine_time_ = time_scale(flows_.dynamics().model(), start_);
  return duration <= brief_share * machine_time_;
}

bool Master::in_brief_contacts() {
  return is_brief((now() - brief_since_) / (brief_contacts_ + 1));
}

// Counts a contact that soon opens again, or a completed chatter that does not stay closed.
void Master::count_brief_contact() {
  if (!in_brief_contacts()) {
    brief_contacts_ = 0;
    brief_since_ = now();
  }
  if (++brief_contacts_ < brief_contacts_of_standstill) return;
  std::array<char, 32> took{};
  std::snprintf(took.data(), took.size(), "%.3g", now() - brief_since_);
  fail("time stands still: " + list(recently_active()) + " close and throw each other off " +
       std::to_string(brief_contacts_) + " times in " + took.data() +
       " s, without end. Supports that squeeze the machine between them do this: check their "
       "clearances and motions; a larger impact.chatter_time may help");
}

// Whether the closed contacts release each other in turn without end: completing the chatter of one
// contact releases another, which chatters as long again.
bool Master::holds_together() {
  return brief_contacts_ >= brief_contacts_of_chatter && in_brief_contacts();
}

// Contacts that are closed or took part in one of the last impacts.
ContactSet Master::recently_active() const {
  ContactSet active = closed_;
  for (const Impact& impact : recent_) active |= impact.closing;
  return active;
}

void Master::start_contacts(std::vector<ContactEvent>& events) {
  const Model& model = flows_.dynamics().model();
  const int m = flows_.dynamics().contacts();
  ContactSet closing = 0;
  ContactSet touched = 0;
  for (int i = 0; i < m; ++i) {
    if (contains(held_at_start_, i)) {
      touched |= bit(i);
      continue;
    }
    const Contact& contact = model.contacts[index(i)];
    const double scale = gap_scale(contact, start_.q);
    const double g = gap(contact, start_.q, now());
    const double gamma = gap_velocity(contact, start_.u, now());
    if (g > touching * scale) continue;
    if (g < -touching * scale) {
      penetrating_ |= bit(i);
      closing |= bit(i);
    } else if (gamma < 0.0) {
      closing |= bit(i);
    } else if (gamma == 0.0) {
      touched |= bit(i);
    } else {
      order_[index(i)] = 1;
    }
  }
  if (touched != 0) {
    const Locking locking = solver_.lock(touched, ~penetrating_, motion_);
    if (locking.solved != Solved::yes) {
      fail(list(touched) +
           ", closed at the start, have linearly dependent directions: which of them carries the "
           "machine is a guess; leave one of them out");
    }
    for (int i = 0; i < m; ++i) {
      if (!contains(touched, i)) continue;
      if (contains(motion_.flow->locked(), i)) {
        order_[index(i)] = contains(locking.unloaded, i) ? 1 : 0;
        record(i, ContactEventKind::closes, events);
      } else {
        order_[index(i)] = 2;
      }
    }
  }
  if (closing != 0) close(closing, penetrating_, events);
}

// Lists the signals whose zeros can end the present phase, and starts the search for the first
// zero.
void Master::watch() {
  watches_.clear();
  const Flow& flow = *motion_.flow;
  const int m = flows_.dynamics().contacts();
  for (int i = 0; i < m; ++i) {
    const int order = order_[index(i)];
    if (contains(flow.locked(), i)) {
      watches_.push_back({&flow.force(i), 1.0, order, 4 * i + force_falls});
    } else if (contains(penetrating_, i)) {
      watches_.push_back({&flow.gap(i), -1.0, 0, 4 * i + gap_rises});
      watches_.push_back({&flow.gap_velocity(i), 1.0, order, 4 * i + velocity_falls});
    } else if (completion_[index(i)] == infinity) {
      watches_.push_back({&flow.gap(i), 1.0, order, 4 * i + gap_falls});
    }
  }
  search_.begin(motion_, watches_);
}

void Master::begin(std::vector<ContactEvent>& events) {
  if (started_) return;
  started_ = true;
  start_contacts(events);
  watch();
}

// Finds the time of the next change. Returns whether it is not after t.
bool Master::find_next(Instant t, double& event) {
  check_interrupt();
  const double completion =
      completion_.empty() ? infinity : *std::min_element(completion_.begin(), completion_.end());
  search_.advance(std::min(t - motion_.t, completion - now()));
  event = std::min(search_.found() ? now() + search_.tau() : infinity, completion);
  return !(at(event) - t > 0.0) && !(search_.certified() == infinity && event == infinity);
}

void Master::take_next(double event, std::vector<ContactEvent>& events) {
  check_progress(event);
  const bool from_search = search_.found() && now() + search_.tau() <= event;
  if (event > now()) std::fill(order_.begin(), order_.end(), 0);
  motion_.flow->propagate(motion_, at(std::max(event, now())), motion_);
  take_event(from_search, events);
  watch();
}

bool Master::advance(Instant t, std::vector<ContactEvent>& events, std::size_t enough,
                     std::stop_token stop) {
  const StopScope scope(std::move(stop));
  const std::size_t most = events.size() + std::min(enough, events.max_size() - events.size());
  begin(events);
  double event = infinity;
  while (find_next(t, event)) {
    if (events.size() >= most) return false;
    take_next(event, events);
  }
  return true;
}

bool Master::advance_once(Instant t, std::vector<ContactEvent>& events) {
  begin(events);
  double event = infinity;
  if (!find_next(t, event)) return false;
  take_next(event, events);
  return true;
}

void Master::check_progress(double event) {
  if (++events_since_ < events_of_standstill) return;
  const double standstill = events_of_standstill * roundings_of_standstill *
                            std::numeric_limits<double>::epsilon() * std::abs(event);
  if (event - since_ <= standstill) {
    fail("time stands still: " + std::to_string(events_of_standstill) + " events of " +
         list(recently_active()) + " at one instant; a larger impact.chatter_time may help");
  }
  events_since_ = 0;
  since_ = event;
}

// Collects the changes due now. Resets the completion time of each ended chatter.
Master::Due Master::take_due(bool from_search) {
  Due due;
  for (std::size_t w = 0; from_search && w < watches_.size(); ++w) {
    if (!search_.fires(w)) continue;
    const ContactSet contact = bit(watches_[w].id / 4);
    switch (watches_[w].id % 4) {
      case gap_falls:
        due.closing |= contact;
        break;
      case gap_rises:
        due.surfacing |= contact;
        break;
      case velocity_falls:
        due.arrested |= contact;
        break;
      default:
        due.releasing |= contact;
        break;
    }
  }
  for (int i = 0; i < flows_.dynamics().contacts(); ++i) {
    if (!(completion_[index(i)] <= now())) continue;
    due.completed |= bit(i);
    completion_[index(i)] = infinity;
  }
  return due;
}

void Master::take_event(bool from_search, std::vector<ContactEvent>& events) {
  Due due = take_due(from_search);
  surface(due.surfacing, events);
  if (due.releasing != 0) release(due.releasing, events);
  due.arrested &= penetrating_;
  if (due.arrested != 0) arrest(due.arrested);
  const ContactSet closing = due.closing | due.completed;
  if (closing == 0) return;
  const ContactSet to_stay = due.completed | (wedged(closing) & ~closed_);
  close(closing | to_stay, to_stay, events);
}

void Master::surface(ContactSet surfacing, std::vector<ContactEvent>& events) {
  for_each(surfacing, [&](int i) {
    penetrating_ &= ~bit(i);
    order_[index(i)] = 1;
    record(i, ContactEventKind::opens, events);
  });
}

// Unlocks contacts. Penetrating ones stay closed, the others open.
void Master::release(ContactSet releasing, std::vector<ContactEvent>& events) {
  solver_.release(releasing, motion_);
  for_each(releasing, [&](int i) {
    if (contains(penetrating_, i)) {
      order_[index(i)] = 2;
    } else {
      order_[index(i)] = 3;
      record(i, ContactEventKind::opens, events);
    }
  });
}

void Master::arrest(ContactSet arrested) {
  const Locking locking = solver_.lock(motion_.flow->locked() | arrested, ~penetrating_, motion_);
  if (locking.solved != Solved::yes) {
    fail(list(motion_.flow->locked() | arrested) +
         ", which are closed at once, have linearly dependent directions: which of them carries "
         "the machine is a guess; leave one of them out");
  }
  for_each(motion_.flow->locked(),
           [&](int i) { order_[index(i)] = contains(locking.unloaded, i) ? 1 : 0; });
}

// Shortest flight that t resolves. Shorter bounces would never end.
double Master::shortest_time() const {
  return resolvable * now() + resolvable_of_chatter * flows_.dynamics().model().chatter_time;
}

// Longest remainder of a bounce sequence that is completed.
double Master::shortest_chatter() const {
  return std::max(flows_.dynamics().model().chatter_time, shortest_time());
}

// Contacts in a joint chatter by their last impacts, this one included; 0: none.
ContactSet Master::wedged(ContactSet closing) {
  constexpr int repeatedly = 3;
  constexpr double window = 16.0;  // in chatter times
  const auto size = static_cast<long>(recent_.size());
  recent_[static_cast<std::size_t>(impacts_ % size)] = {now(), closing};
  const Impact& oldest = recent_[static_cast<std::size_t>((impacts_ + 1) % size)];
  if (now() - oldest.t > window * shortest_chatter()) return 0;
  ContactSet wedged = 0;
  for (int i = 0; i < flows_.dynamics().contacts(); ++i) {
    const auto count = std::count_if(recent_.begin(), recent_.end(), [&](const Impact& impact) {
      return contains(impact.closing, i);
    });
    if (count >= repeatedly) wedged |= bit(i);
  }
  if (std::popcount(wedged) < 2) return 0;
  count_brief_contact();
  recent_.fill({});
  return wedged;
}

// Whether a gap is zero to rounding. Such a contact takes part in an impact, because the event
// search cannot detect its penetration from a gap of zero.
bool Master::touches(int contact) const {
  const Signal& g = motion_.flow->gap(contact);
  const double scale =
      std::abs(g.constant) + (g.p * motion_.x.z).abs().sum() + (g.r * motion_.x.v).abs().sum();
  return std::abs(value(g, motion_)) <= touching * scale;
}

// Those of `contacts` that the impact released for less than the remainder of a completed chatter.
// They would return at once and release others, without end. In a joint chatter: all that would
// return.
ContactSet Master::hardly_parted(ContactSet contacts, const Collision& collision) {
  const double longest = holds_together() ? infinity : shortest_chatter();
  ContactSet brief = 0;
  for (int i = 0; i < flows_.dynamics().contacts(); ++i) {
    if (!contains(contacts & ~penetrating_ & ~motion_.flow->locked(), i)) continue;
    const double gamma = collision.gamma_plus[i];
    const double acceleration = rate(motion_.flow->gap_velocity(i), motion_);
    if (gamma > 0.0 && acceleration < 0.0 && 2.0 * gamma < -acceleration * longest) brief |= bit(i);
  }
  return brief;
}

// Touching contacts that are not in `contacts`.
ContactSet Master::touching_beside(ContactSet contacts) const {
  ContactSet touched = 0;
  for (int i = 0; i < flows_.dynamics().contacts(); ++i) {
    if (!contains(contacts, i) && touches(i)) touched |= bit(i);
  }
  return touched;
}

// Restitution of contact i at its gap velocity.
double Master::restitution_now(int i) const {
  const Contact& contact = flows_.dynamics().model().contacts[index(i)];
  if (contact.curve.is_constant()) return contact.restitution;
  return restitution_at(contact, solver_.gap_velocity(i, motion_)).epsilon;
}

// Impact of the contacts `closing`. A closing contact that stays closed takes restitution 0, one
// that is released its own restitution, as in a replica. Both choices can change which contacts
// stay closed, so that the impact is solved until they agree. `staying` receives the result.
Collision Master::collide(ContactSet closing, ContactSet& staying) {
  const Model& model = flows_.dynamics().model();
  const ContactSet participants = closed_ | closing;
  before_ = motion_;
  ContactSet forced_open = 0;
  while (true) {
    for (int i = 0; i < flows_.dynamics().contacts(); ++i) {
      epsilon_[index(i)] = contains(staying, i) ? 0.0 : restitution_now(i);
    }
    Collision collision =
        solver_.collide(participants, epsilon_, participants, ~penetrating_, motion_);
    if (collision.solved != Solved::yes) {
      fail(list(participants) +
           ", which close at once, have linearly dependent directions: supports that squeeze the "
           "machine between them, or one support too many; check their clearances and motions");
    }
    // Holding one contact may lift another as little.
    while (const ContactSet brief = hardly_parted(closed_ | staying, collision)) {
      const Collision held = solver_.hold(collision, brief, ~penetrating_, motion_);
      if (held.solved != Solved::yes) break;
      collision = held;
    }
    const ContactSet locked = motion_.flow->locked();
    const ContactSet sticking = closing & locked & ~staying & ~forced_open;
    const ContactSet opening = staying & ~locked & ~penetrating_;
    staying = (staying | sticking) & ~opening;
    forced_open |= opening;
    bool restitution_matters = false;
    for_each(sticking | opening, [&](int i) {
      if (model.contacts[index(i)].restitution != 0.0) restitution_matters = true;
    });
    if (!restitution_matters) return collision;
    motion_ = before_;
  }
}

// Impact of the contacts `closing`. Those of `to_stay` have restitution 0.
void Master::close(ContactSet closing, ContactSet to_stay, std::vector<ContactEvent>& events) {
  const ContactSet closed_before = closed_;
  const ContactSet touched = touching_beside(closed_before | closing);
  for_each(touched, [&](int i) { completion_[index(i)] = infinity; });
  closing |= touched;
  ContactSet staying = to_stay;
  const Collision collision = collide(closing, staying);
  ++impacts_;

  const ContactSet locked = motion_.flow->locked();
  if ((to_stay & ~locked & ~penetrating_) != 0) count_brief_contact();
  for_each(collision.closed, [&](int i) {
    const bool was_closed = contains(closed_before, i);
    const bool rests = contains(collision.resting, i);
    if (contains(penetrating_, i)) {
      order_[index(i)] = rests ? 1 : 0;
      if (!was_closed) record(i, ContactEventKind::closes, events);
    } else if (contains(locked, i)) {
      order_[index(i)] = contains(collision.unloaded, i) ? 1 : 0;
      completion_[index(i)] = infinity;
      if (contains(closing, i)) record(i, ContactEventKind::closes, events);
    } else {
      order_[index(i)] = rests ? 2 : 1;
      if (was_closed) {
        record(i, ContactEventKind::opens, events);
      } else if (!contains(touched, i) || contains(collision.struck, i)) {
        record(i, ContactEventKind::pulse, events);
      }
    }
  });
  for_each(closing & ~staying & ~locked & ~penetrating_,
           [&](int i) { foresee_completion(i, collision.gamma_plus[i]); });
}

// Sets the completion time of a contact that opens with gamma [m/s], if its chatter is to be
// completed.
void Master::foresee_completion(int contact, double gamma) {
  if (!(gamma > 0.0)) return;
  const double epsilon = flows_.dynamics().model().contacts[index(contact)].restitution;
  const double acceleration = rate(motion_.flow->gap_velocity(contact), motion_);
  // 2 gamma / (|g''| (1 - epsilon)) < chatter_time, or the next landing is not resolvable.
  if (2.0 * gamma < -acceleration * (1.0 - epsilon) * shortest_chatter()) {
    completion_[index(contact)] = now() + 2.0 * gamma / (-acceleration * (1.0 - epsilon));
  } else if (2.0 * gamma < -acceleration * shortest_time()) {
    completion_[index(contact)] = now() + 2.0 * gamma / -acceleration;
  }
}

double Master::next_event() const {
  double event = search_.found() ? now() + search_.tau() : infinity;
  for (const double completion : completion_) event = std::min(event, completion);
  return event;
}

void Master::state(Instant t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u) {
  motion_.flow->propagate(motion_, t, here_);
  motion_.flow->state(here_, q, u);
}

}  // namespace sprag
