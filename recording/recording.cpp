#include "recording/recording.h"

#include <algorithm>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"

namespace sprag {
namespace {

// The time assigned to arrivals advances at least by this with every record, since the time stamps
// of a log need not.
constexpr std::int64_t least_step = 1'000'000;                                    // ns
constexpr std::int64_t latest = std::numeric_limits<std::int64_t>::max() / 4000;  // us
// Time between the recordings of a log that was joined from several.
constexpr std::int64_t pause = 1'000'000'000;  // ns

}  // namespace

bool is_lcm_log(InputFile& file) {
  constexpr std::string_view sync = "\xED\xA1\xDA\x01";
  return file.ahead(sync.size()).starts_with(sync) || file.path().extension() == ".lcmlog";
}

RecordedMessages::RecordedMessages(InputFile file, int contacts, const ContactClock& clock,
                                   std::optional<Key> key)
    : name_(file.path().string()),
      log_(std::move(file)),
      contacts_(contacts),
      clock_(clock),
      key_(std::move(key)) {}

std::vector<std::string> RecordedMessages::problems(const MessageCounts& counts) const {
  constexpr std::size_t most = 20;
  std::vector<std::string> lines;
  const std::vector<LogDamage>& damages = log_.damages();
  for (const LogDamage& damage : damages) {
    if (lines.size() == most) {
      lines.push_back(name_ + ": " + std::to_string(damages.size() - most) + " more damages");
      break;
    }
    const std::string begin = std::to_string(damage.begin);
    lines.push_back(name_ + ": " +
                    (damage.to_the_end
                         ? "from byte " + begin + ": " + damage.what + "; everything before is used"
                         : "bytes " + begin + " to " + std::to_string(damage.end - 1) + ": " +
                               damage.what + "; left out, the rest is used"));
  }
  if (empty()) lines.push_back(name_ + ": is empty");
  const auto add_left_out = [&](std::int64_t count, const char* why) {
    if (count == 0) return;
    lines.push_back(name_ + ": " + std::to_string(count) +
                    (count == 1 ? " message is left out, " : " messages are left out, ") + why);
  };
  add_left_out(counts.of_other_masters,
               "of other masters, which sent while the one that is used was not silent; to use "
               "another one, record it alone");
  add_left_out(counts.of_past_sessions,
               "of masters that another one had replaced; to use them, record them alone");
  if (any_appended_)
    add_left_out(counts.doubled, "since they are repeated: the same recording was appended twice");
  return lines;
}

// The present record without its tag; nullopt, and counted, if the key does not verify it.
std::optional<std::span<const std::uint8_t>> RecordedMessages::authentic() {
  const std::span<const std::uint8_t> message(record_.data);
  if (!key_) return message;
  if (key_->verifies(record_.channel, message)) {
    return message.first(message.size() - Key::tag_size);
  }
  ++unauthenticated_;
  return std::nullopt;
}

// Takes the present record if it is on SPRAG_INPUT and somebody takes inputs.
bool RecordedMessages::take_input() {
  if (!on_input_ || record_.channel != input_channel) return false;
  const auto message = authentic();
  if (!message) return true;
  if (decode(*message, input_) == Refusal::none) {
    on_input_(input_);
  } else {
    ++refused_;
  }
  return true;
}

bool RecordedMessages::next(ContactMessage& report, Arrival& arrival) {
  while (log_.next(record_)) {
    appended_ |= record_.appended;
    if (take_input() || record_.channel != contacts_channel) continue;
    const auto message = authentic();
    if (!message) continue;
    if (decode(*message, report) != Refusal::none || report.contacts != contacts_) {
      ++refused_;
      continue;
    }
    to_machine_time(clock_, report);
    const std::int64_t utime = std::clamp<std::int64_t>(record_.utime, 0, latest);
    if (appended_) origin_ = std::min(now_ + pause, 1000 * latest) - 1000 * utime;
    any_appended_ |= appended_;
    now_ = std::max(origin_ + 1000 * utime, now_ + least_step);
    arrival = {now_, utime, std::exchange(appended_, false)};
    return true;
  }
  return false;
}

}  // namespace sprag
