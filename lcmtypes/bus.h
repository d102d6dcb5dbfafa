// The processes' common bus: raw bytes on named channels over LCM.
//
// It works around what LCM 1.3.1 does badly: its default queue drops the newest messages (here:
// unlimited), its default receive buffer is small (here: 4 MB if the kernel grants it), exceptions
// cannot pass through its C code (here: handle() throws them on), a host without multicast makes it
// hang (here: BusError at once), and a malformed packet can claim a size near 4 GB (here: dropped).
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "lcmtypes/lcm_url.h"

namespace sprag {

inline constexpr const char* contacts_channel = "SPRAG_CONTACTS";
inline constexpr const char* truth_channel = "SPRAG_TRUTH";
inline constexpr const char* estimate_channel = "SPRAG_ESTIMATE";
inline constexpr const char* settled_channel = "SPRAG_SETTLED";

/// The bus cannot be opened, subscribed to or read. Where multicast has no route, what() ends with
/// the two lines that mend it.
struct BusError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Bus {
 public:
  /// Gets the channel's name, the message and its arrival (wall clock [us]), valid during the call.
  using Handler = std::function<void(std::string_view channel, std::span<const std::uint8_t> data,
                                     std::int64_t recv_utime)>;

  /// Opens an LCM address; for udpm it probes multicast first (at most one second). Throws
  /// BusError, or UrlError if `url` cannot be one.
  explicit Bus(const std::string& url = default_url);
  Bus(Bus&&) noexcept;
  Bus& operator=(Bus&&) noexcept;
  ~Bus();

  /// Calls `handler` from handle() for every message on `channel`. The first subscription starts
  /// LCM's receiving thread, which inherits the caller's scheduling class. Throws BusError.
  void subscribe(std::string_view channel, Handler handler);

  /// The same for all channels whose name starts with `prefix`.
  void subscribe_prefix(std::string_view prefix, Handler handler);

  /// Sends one message; may be called from any thread. Returns false if it could not be sent.
  bool publish(const char* channel, std::span<const std::uint8_t> data) noexcept;

  /// Waits for a message up to `timeout`, then handles what has arrived (at most 1000 messages).
  /// Returns how many; 0 after a timeout or a signal. Throws what a handler threw, or BusError; the
  /// end of a file:// log is a BusError too.
  int handle(std::chrono::milliseconds timeout);

  /// A descriptor that is readable when handle() has work, for poll(). Throws BusError.
  int fileno();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sprag
