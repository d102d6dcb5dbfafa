// Counts lost messages by gaps in their numbers: `sequence` on SPRAG_CONTACTS, `tick` on
// SPRAG_SETTLED and SPRAG_TRUTH. These increase by one with every message of a process.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace sprag {

/// Counts the missing numbers between the first and the last of one stream of messages. Messages
/// may be repeated and may arrive in any order.
class MissingNumbers {
 public:
  /// After a gap longer than `longest_gap` counting starts again.
  void take(std::int64_t number, std::int64_t longest_gap);
  std::int64_t count() const { return count_; }

 private:
  std::optional<std::int64_t> last_;
  std::map<std::int64_t, std::int64_t> missing_;  // first and last number of each gap
  std::int64_t count_ = 0;
};

class Losses {
 public:
  enum class Channel { contacts, settled, truth };
  static constexpr std::size_t channels = 3;

  /// Takes the number of a message. A restarted process is a new `sender`, a restarted master a new
  /// `session`; both start new numbers.
  void take(Channel channel, std::uint64_t sender, std::int64_t session, std::int64_t number);

  /// Number of missing messages of a channel.
  std::int64_t missing(Channel channel) const;

 private:
  struct Stream {
    Channel channel = Channel::contacts;
    std::uint64_t sender = 0;
    std::int64_t session = 0;
    MissingNumbers numbers;
  };

  std::vector<Stream> streams_;  // the most recent ones; the counts of older ones are summed below
  std::array<std::int64_t, channels> of_past_streams_{};
};

/// "3 packets at a full receive buffer, 2 messages of SPRAG_CONTACTS, 4 ticks of SPRAG_SETTLED";
/// empty without losses. `dropped`: packets dropped by the kernel.
std::string describe(const Losses& losses, std::int64_t dropped);

}  // namespace sprag
