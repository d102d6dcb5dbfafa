// Recordings of a master: which kind a file is, and the contact reports of an LCM log.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/key.h"
#include "recording/arrival.h"
#include "sprag/detail/events/contact_message.h"

namespace sprag {

/// By its first bytes, which stay ahead, or by its name where it is empty or damaged from the
/// start.
bool is_lcm_log(InputFile& file);

/// The messages on SPRAG_CONTACTS of a log that an observer would take, with the log's own clock.
class RecordedMessages {
 public:
  /// For a machine with `contacts` contacts; with a key only messages that it has signed count.
  RecordedMessages(InputFile file, int contacts, const std::optional<Key>& key);

  /// The next one and when it arrived; false at the end of the log.
  bool next(ContactMessage& report, Arrival& arrival);

  std::int64_t refused() const { return refused_; }
  std::int64_t unauthenticated() const { return unauthenticated_; }
  bool empty() const { return log_.empty(); }
  const std::vector<LogDamage>& damages() const { return log_.damages(); }

  /// What is wrong with the log, once next() has come to its end: a line for people about each of
  /// the first 20 damages and one about the others, or that the log is empty.
  std::vector<std::string> problems() const;

 private:
  std::string name_;
  ChannelLogReader log_;
  int contacts_;
  const std::optional<Key>* key_;
  ChannelRecord record_;
  std::int64_t now_ = 0;  // ns
  std::int64_t refused_ = 0;
  std::int64_t unauthenticated_ = 0;
};

}  // namespace sprag
