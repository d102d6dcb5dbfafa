// The message bus of the processes: raw bytes on named channels over LCM.
//
// liblcm sends the messages. Over UDP multicast this class receives them itself from LCM's packets
// (udp_receiver.h), because malformed packets end liblcm 1.3.1. memq://, file:// and
// tcpq:// are read through liblcm; a log is written (file://LOG?mode=w) by this class. On a host
// without multicast the constructor fails at once with instructions. With a key every message is
// signed, and unsigned messages are discarded.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "lcmtypes/key.h"
#include "lcmtypes/lcm_url.h"
#include "lcmtypes/udp_receiver.h"
#include "sprag/error.h"

namespace sprag {

inline constexpr const char* contacts_channel = "SPRAG_CONTACTS";
inline constexpr const char* input_channel = "SPRAG_INPUT";
inline constexpr const char* truth_channel = "SPRAG_TRUTH";
inline constexpr const char* estimate_channel = "SPRAG_ESTIMATE";
inline constexpr const char* settled_channel = "SPRAG_SETTLED";
inline constexpr const char* parameters_channel = "SPRAG_PARAMETERS";
inline constexpr const char* impacts_channel = "SPRAG_IMPACTS";
inline constexpr const char* prediction_channel = "SPRAG_PREDICTION";
inline constexpr const char* outputs_channel = "SPRAG_OUTPUTS";
inline constexpr const char* bounds_channel = "SPRAG_BOUNDS";
inline constexpr const char* health_channel = "SPRAG_HEALTH";

/// The bus cannot be opened, subscribed to or read. Without a multicast route, what() ends with the
/// two commands that add it. If another program uses the port, what() says so.
struct BusError : Error {
  using Error::Error;
};

/// Counts of packets that did not reach a handler.
struct BusCounts {
  std::array<std::int64_t, packet_faults> faults{};  ///< by PacketFault
  std::int64_t other_host = 0;                       ///< with ttl=0: sent by another host
  std::int64_t unauthenticated = 0;  ///< on a subscribed channel: tag not made with the key
  std::int64_t overflowed = 0;       ///< dropped by the kernel because the receive buffer was full;
                                     ///< complete once handle() has left no packet unread

  bool operator==(const BusCounts&) const = default;
};

class Bus {
 public:
  /// Receives the channel's name, the message and its arrival (wall clock [us]), valid during the
  /// call.
  using Handler = std::function<void(std::string_view channel, std::span<const std::uint8_t> data,
                                     std::int64_t recv_utime)>;

  /// Opens an LCM address. For udpm it tests multicast first, which takes at most one second.
  /// Throws BusError, or UrlError if `url` is malformed.
  explicit Bus(const std::string& url = default_url, std::optional<Key> key = std::nullopt);
  Bus(Bus&&) noexcept;
  Bus& operator=(Bus&&) noexcept;
  ~Bus();

  /// handle() calls `handler` for every message on `channel`. Throws BusError.
  void subscribe(std::string_view channel, Handler handler);

  /// The same for all channels whose name starts with `prefix`.
  void subscribe_prefix(std::string_view prefix, Handler handler);

  /// Sends a message; may be called from any thread. Returns false if it could not be sent, for
  /// example because it is larger than a UDP packet.
  bool publish(const char* channel, std::span<const std::uint8_t> data) noexcept;

  /// publish() gives every message to `copy` too, as it is sent, including the tag if there is a
  /// key; in the publishing thread. `copy` must not throw. To be called before the first publish().
  void copy_published(
      std::function<void(std::string_view channel, std::span<const std::uint8_t> data)> copy);

  /// Closes a log that is written; to be called after the last publish(). Throws BusError if the
  /// log is not complete, for example on a full disk.
  void finish();

  /// Waits up to `timeout` for a message, then handles all that have arrived, at most 1000 packets.
  /// Returns the number of packets; 0 after a timeout or a signal. Throws the exception of a
  /// handler, or BusError, also at the end of a file:// log.
  int handle(std::chrono::milliseconds timeout);

  /// Within a handler: the message as sent, including the tag if there is a key.
  std::span<const std::uint8_t> as_sent(std::span<const std::uint8_t> data) const;

  /// Within a handler: the sending process, by address and port. 0 if unknown, as in a log or a
  /// queue.
  std::uint64_t sender() const;

  /// To be called by the thread that calls handle(), or after it has ended.
  const BusCounts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sprag
