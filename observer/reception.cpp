#include "observer/reception.h"

#include <chrono>

#include "lcmtypes/big_endian.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/wall_clock.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t longest_queued = 60'000'000;  // us, for a message in the kernel's buffer

Notice notice_of(Refusal refusal) {
  using enum Notice;
  constexpr std::array<Notice, refusal_kinds> notices{
      bad_count, wrong_type, wrong_size, wrong_size, bad_count, bad_contact,
      bad_kind,  bad_closed, bad_time,   bad_speed,  bad_count};
  return notices[static_cast<std::size_t>(refusal)];
}

// The session number in a message that has not been checked; 0 if it is too short.
std::int64_t session_of(std::span<const std::uint8_t> data) {
  if (data.size() < 16) return 0;
  const std::uint8_t* from = data.data() + 8;
  return take<std::int64_t>(from);
}

// When the kernel received a message, by both clocks of this host. The message may have waited
// since.
Arrival arrival_of(std::int64_t utime) {
  const std::int64_t wall = wall_clock_us();
  const std::int64_t queued =
      wall - utime >= 0 && wall - utime <= longest_queued ? wall - utime : 0;
  return {monotonic_now() - 1000 * queued, wall - queued};
}

}  // namespace

Reception::Reception(Bus& bus, int contacts, const ContactClock& clock, bool streamed, Inbox& inbox,
                     Notices& notices)
    : bus_(bus), contacts_(contacts), clock_(clock), inbox_(inbox), notices_(notices) {
  bus_.subscribe(contacts_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                          std::int64_t utime) { receive(data, utime); });
  if (!streamed) return;
  bus_.subscribe(input_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                       std::int64_t utime) { receive_input(data, utime); });
}

void Reception::receive_input(std::span<const std::uint8_t> data, std::int64_t utime) {
  ReceivedInput* slot = inbox_.inputs.free_slot();
  if (slot == nullptr) {
    ++figures_.overflowed;
    return;
  }
  slot->arrival = arrival_of(utime).monotonic;
  const Refusal refusal = decode(data, slot->message);
  if (refusal != Refusal::none) {
    ++figures_.refused[static_cast<std::size_t>(refusal)];
    notices_.raise(Notice::bad_input);
    return;
  }
  inbox_.inputs.push();
  inbox_.arrived.signal();
}

void Reception::run(const std::atomic<bool>& stop) {
  while (!stop) {
    bus_.handle(50ms);
    raise_refused();
    hand_over_figures();
  }
}

void Reception::hand_over_figures() {
  ReceptionFigures* slot = figures_queue_.free_slot();
  if (slot == nullptr) return;
  *slot = figures();
  if (*slot == last_put_) return;
  last_put_ = *slot;
  figures_queue_.push();
}

const ReceptionFigures& Reception::reported() {
  while (const ReceptionFigures* figures = figures_queue_.front()) {
    reported_ = *figures;
    figures_queue_.pop();
  }
  return reported_;
}

ReceptionFigures Reception::figures() const {
  ReceptionFigures figures = figures_;
  figures.bus = bus_.counts();
  return figures;
}

void Reception::receive(std::span<const std::uint8_t> data, std::int64_t utime) {
  const Arrival arrival = arrival_of(utime);
  inbox_.last_arrival.store(arrival.monotonic, std::memory_order_relaxed);
  if (bus_.counts().overflowed > kernel_drops_) {
    kernel_drops_ = bus_.counts().overflowed;
    inbox_.last_drop = arrival.monotonic;
  }
  const bool followed = inbox_.follows.load(std::memory_order_acquire) &&
                        session_of(data) == inbox_.session.load(std::memory_order_relaxed);
  SpscQueue<ReceivedMessage>& queue = followed ? inbox_.followed : inbox_.strangers;
  ReceivedMessage* slot = queue.free_slot();
  if (slot == nullptr) {
    ++figures_.overflowed;
    if (followed) {
      inbox_.last_drop = arrival.monotonic;
    } else {
      notices_.raise(Notice::crowded);
    }
    return;
  }
  slot->arrival = arrival;
  const Refusal refusal = decode(data, slot->message);
  if (refusal != Refusal::none) {
    ++figures_.refused[static_cast<std::size_t>(refusal)];
    notices_.raise(notice_of(refusal));
  } else if (slot->message.contacts != contacts_) {
    ++figures_.other_machine;
    notices_.raise(Notice::other_machine, 1, slot->message.contacts, contacts_);
  } else {
    to_machine_time(clock_, slot->message);
    queue.push();
    // Messages of other senders do not wake the loop while a session is followed.
    if (followed || !inbox_.follows.load(std::memory_order_relaxed)) inbox_.arrived.signal();
  }
}

// Raises notices about packets that the bus has discarded.
void Reception::raise_refused() {
  const BusCounts& counts = bus_.counts();
  const auto fault = [&counts](PacketFault of) {
    return counts.faults[static_cast<std::size_t>(of)];
  };
  raise_increase(Notice::malformed, fault(PacketFault::foreign) + fault(PacketFault::no_channel));
  raise_increase(Notice::fragment, fault(PacketFault::fragment));
  raise_increase(Notice::other_host, counts.other_host);
  if (raise_increase(Notice::unauthenticated, counts.unauthenticated)) {
    inbox_.last_arrival.store(monotonic_now(), std::memory_order_relaxed);
  }
}

bool Reception::raise_increase(Notice notice, std::int64_t count) {
  std::int64_t& before = kept_away_[static_cast<std::size_t>(notice)];
  if (count == before) return false;
  notices_.raise(notice, count - before);
  before = count;
  return true;
}

}  // namespace sprag
