// Messages that did not arrive, by the numbers of those that did: `sequence` on SPRAG_CONTACTS,
// `tick` on SPRAG_SETTLED and SPRAG_TRUTH, which rise by one with every message of a process.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace sprag {

/// The numbers of one stream of messages that are missing between the first and the last one.
/// Messages may be doubled, and may arrive in any order.
class MissingNumbers {
 public:
  /// A number that is further than `longest_gap` beyond the last one begins anew.
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

  /// Takes the number of a message. A restarted process is another `sender`, a restarted master
  /// another `session`: neither continues the numbers before it.
  void take(Channel channel, std::uint64_t sender, std::int64_t session, std::int64_t number);

  /// Messages that are missing on a channel.
  std::int64_t missing(Channel channel) const;

 private:
  struct Stream {
    Channel channel = Channel::contacts;
    std::uint64_t sender = 0;
    std::int64_t session = 0;
    MissingNumbers numbers;
  };

  std::vector<Stream> streams_;  // those heard last, and what the others have missed
  std::array<std::int64_t, channels> of_past_streams_{};
};

/// "3 packets at a full receive buffer, 2 messages of SPRAG_CONTACTS, 4 ticks of SPRAG_SETTLED";
/// empty if nothing is lost. `dropped`: packets that the kernel dropped.
std::string describe(const Losses& losses, std::int64_t dropped);

}  // namespace sprag
