// Recordings of a master: which kind a file is, and the contact reports of an LCM log.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/key.h"
#include "mechanics/contact_report.h"
#include "observer/arrival.h"

namespace sprag {

/// By its first bytes, or by its name where it is empty or damaged from the start.
bool is_lcm_log(const std::filesystem::path& file);

/// The messages on SPRAG_CONTACTS of a log that an observer would take, with the log's own clock.
class RecordedReports {
 public:
  /// For a machine with `contacts` contacts; with a key only messages that it has signed count.
  /// Throws InputError if the file cannot be opened.
  RecordedReports(const std::filesystem::path& file, int contacts, const std::optional<Key>& key);

  /// The next one and when it arrived; false at the end of the log or where it is damaged.
  bool next(ContactReport& report, Arrival& arrival);

  std::int64_t refused() const { return refused_; }
  std::int64_t unauthenticated() const { return unauthenticated_; }
  const auto& damage() const { return log_.damage(); }

 private:
  ChannelLogReader log_;
  int contacts_;
  const std::optional<Key>* key_;
  ChannelRecord record_;
  std::int64_t now_ = 0;  // ns
  std::int64_t refused_ = 0;
  std::int64_t unauthenticated_ = 0;
};

}  // namespace sprag
