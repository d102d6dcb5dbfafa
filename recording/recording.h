// Recordings of a master: recognizes the type of a file and reads the contact messages of a log.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/key.h"
#include "recording/arrival.h"
#include "recording/session_tracker.h"
#include "sprag/contact_event.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {

/// Whether a file is an LCM log: by its first bytes, which stay unread, or by its name if it is
/// empty or damaged at the beginning.
bool is_lcm_log(InputFile& file);

/// The valid messages on SPRAG_CONTACTS of a log, with the log's own clock.
class RecordedMessages {
 public:
  /// For a machine with `contacts` contacts. With a key only messages signed with it are used. The
  /// times of the log are on `clock`; the messages that next() returns have the machine's time.
  RecordedMessages(InputFile file, int contacts, const ContactClock& clock, std::optional<Key> key);

  /// Reads the next message and its arrival; false at the end of the log. Calls on_input for each
  /// valid message on SPRAG_INPUT before it.
  bool next(ContactMessage& report, Arrival& arrival);
  void on_input(std::function<void(const InputMessage&)> take) { on_input_ = std::move(take); }

  std::int64_t refused() const { return refused_; }
  std::int64_t unauthenticated() const { return unauthenticated_; }
  bool empty() const { return log_.empty(); }
  const std::vector<LogDamage>& damages() const { return log_.damages(); }

  /// Problems of the log, valid after next() has returned false: a line for the user about each of
  /// the first 20 damaged parts and one about the others, or that the log is empty; and lines about
  /// the messages that the session tracker with these counts has left out.
  std::vector<std::string> problems(const MessageCounts& counts) const;

 private:
  std::optional<std::span<const std::uint8_t>> authentic();
  bool take_input();

  std::string name_;
  ChannelLogReader log_;
  int contacts_;
  ContactClock clock_;
  std::optional<Key> key_;
  ChannelRecord record_;
  std::int64_t now_ = 0;     // ns
  std::int64_t origin_ = 0;  // time on the scale of now_ at which the log's clock is 0 [ns]
  bool appended_ = false;    // no message has been returned since an appended recording began
  bool any_appended_ = false;
  std::function<void(const InputMessage&)> on_input_;
  InputMessage input_;
  std::int64_t refused_ = 0;
  std::int64_t unauthenticated_ = 0;
};

}  // namespace sprag
