// The processes' common bus: raw bytes on named channels over LCM.
//
// Messages are sent by liblcm. Over UDP multicast they are received here, from LCM's packets
// (packet.h, udp_receiver.h), because liblcm 1.3.1 dies of packets that anybody may send; memq://,
// file:// and tcpq:// are liblcm's own, but for a log that is written (file://LOG?mode=w). A host
// without multicast is told at once how to mend it. With a key every message is signed, and nothing
// unsigned is let through.
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
#include "lcmtypes/packet.h"
#include "sprag/error.h"

namespace sprag {

inline constexpr const char* contacts_channel = "SPRAG_CONTACTS";
inline constexpr const char* truth_channel = "SPRAG_TRUTH";
inline constexpr const char* estimate_channel = "SPRAG_ESTIMATE";
inline constexpr const char* settled_channel = "SPRAG_SETTLED";
inline constexpr const char* parameters_channel = "SPRAG_PARAMETERS";
inline constexpr const char* impacts_channel = "SPRAG_IMPACTS";
inline constexpr const char* prediction_channel = "SPRAG_PREDICTION";
inline constexpr const char* outputs_channel = "SPRAG_OUTPUTS";
inline constexpr const char* bounds_channel = "SPRAG_BOUNDS";
inline constexpr const char* health_channel = "SPRAG_HEALTH";

/// The bus cannot be opened, subscribed to or read. Where multicast has no route, what() ends with
/// the two lines that mend it; where another program has the port, it says that.
struct BusError : Error {
  using Error::Error;
};

/// What was not let through to a handler.
struct BusCounts {
  std::array<std::int64_t, packet_faults> faults{};  ///< by PacketFault
  std::int64_t other_host = 0;                       ///< with ttl=0: did not come from this host
  std::int64_t unauthenticated = 0;  ///< on a subscribed channel: not made with the key
  std::int64_t overflowed = 0;       ///< dropped by the kernel: the receive buffer was full; of
                                     ///< all until now once handle() has left nothing unread

  bool operator==(const BusCounts&) const = default;
};

class Bus {
 public:
  /// Gets the channel's name, the message and its arrival (wall clock [us]), valid during the call.
  using Handler = std::function<void(std::string_view channel, std::span<const std::uint8_t> data,
                                     std::int64_t recv_utime)>;

  /// Opens an LCM address; for udpm it probes multicast first (at most one second). Throws
  /// BusError, or UrlError if `url` cannot be one.
  explicit Bus(const std::string& url = default_url, std::optional<Key> key = std::nullopt);
  Bus(Bus&&) noexcept;
  Bus& operator=(Bus&&) noexcept;
  ~Bus();

  /// Calls `handler` from handle() for every message on `channel`. Throws BusError.
  void subscribe(std::string_view channel, Handler handler);

  /// The same for all channels whose name starts with `prefix`.
  void subscribe_prefix(std::string_view prefix, Handler handler);

  /// Sends one message; may be called from any thread. Returns false if it could not be sent, as
  /// when it is larger than one packet of UDP holds.
  bool publish(const char* channel, std::span<const std::uint8_t> data) noexcept;

  /// Closes a log that is written; after the last publish(). Throws BusError where it does not hold
  /// every message, as on a full disk.
  void finish();

  /// Waits for a message up to `timeout`, then handles what has arrived (at most 1000 packets).
  /// Returns how many packets; 0 after a timeout or a signal. Throws what a handler threw, or
  /// BusError; the end of a file:// log is a BusError too.
  int handle(std::chrono::milliseconds timeout);

  /// Within a handler: its message as it was sent, with the tag behind it if there is a key.
  std::span<const std::uint8_t> as_sent(std::span<const std::uint8_t> data) const;

  /// Within a handler: which process its message is from, by address and port. 0 where that is not
  /// known, as in a log or through a queue.
  std::uint64_t sender() const;

  /// For the thread that calls handle(), or after it.
  const BusCounts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sprag
