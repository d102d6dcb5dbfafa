#include "lcmtypes/contact_log.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/events/message_builder.h"

namespace sprag {

namespace {

// Half of the records of a message, so that each record is in at least two messages.
constexpr std::size_t most_events = max_records / 2;
constexpr double longest_wait = 1e-2;  // s, a heartbeat: longest delay of an event in a message

std::int64_t session_of(std::span<const ContactEvent> events) {
  std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  const auto add = [&hash](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3; };
  for (const ContactEvent& event : events) {
    add(std::bit_cast<std::uint64_t>(event.t) >> 32U);
    add(std::bit_cast<std::uint64_t>(event.t));
    add(static_cast<std::uint64_t>(event.contact));
    add(static_cast<std::uint64_t>(event.kind));
  }
  return static_cast<std::int64_t>(hash >> 1U);
}

/// t in microseconds, rounded up.
std::int64_t utime_of(double t) {
  constexpr double latest = 9e15;  // limit of times that observers accept in a log
  return static_cast<std::int64_t>(std::min(std::ceil(1e6 * t), latest));
}

class ContactLog {
 public:
  ContactLog(const std::filesystem::path& file, std::int64_t session, int contacts,
             const std::optional<Key>& key)
      : log_(file), builder_(session, 1.0, contacts), key_(key) {}

  void send(std::span<const ContactEvent> events, double horizon) {
    builder_.add(events);
    do {
      encode(builder_.next(horizon, utime_of(horizon)), data_);
      if (key_) {
        const Key::Tag tag = key_->tag(contacts_channel, data_);
        data_.insert(data_.end(), tag.begin(), tag.end());
      }
      log_.write(utime_of(horizon), contacts_channel, data_);
    } while (builder_.pending());
  }

  std::int64_t close() {
    if (!log_.close()) throw std::runtime_error(log_.error());
    return builder_.sent();
  }

 private:
  ChannelLogWriter log_;
  MessageBuilder builder_;
  const std::optional<Key>& key_;
  std::vector<std::uint8_t> data_;
};

/// Number of events in the next message: all of the first instant, and those that follow soon.
std::size_t events_together(std::span<const ContactEvent> events) {
  std::size_t count = 1;
  while (count < events.size() &&
         (events[count].t == events[count - 1].t ||
          (count < most_events && events[count].t <= events[0].t + longest_wait)))
    ++count;
  return count;
}

}  // namespace

std::int64_t write_contact_log(const std::filesystem::path& file,
                               std::span<const ContactEvent> events, int contacts, double end,
                               const std::optional<Key>& key) {
  ContactLog log(file, session_of(events), contacts, key);
  double horizon = 0.0;
  const auto at_start = static_cast<std::size_t>(std::ranges::count(events, 0.0, &ContactEvent::t));
  log.send(events.first(at_start), horizon);
  for (auto rest = events.subspan(at_start); !rest.empty();) {
    const std::size_t count = events_together(rest);
    horizon = rest[count - 1].t;
    log.send(rest.first(count), horizon);
    rest = rest.subspan(count);
  }
  if (end > horizon) log.send({}, end);
  return log.close();
}

}  // namespace sprag
