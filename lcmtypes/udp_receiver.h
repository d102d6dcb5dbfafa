// A multicast receiver. Unlike LCM's socket it accepts no packets of other groups on the same port,
// and with ttl=0 none from other hosts.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/lcm_url.h"

namespace sprag {

class UdpReceiver {
 public:
  /// Requests `receive_buffer` bytes from the kernel; as root, more than net.core.rmem_max is
  /// possible. Throws std::system_error.
  UdpReceiver(const MulticastAddress& address, int receive_buffer);
  ~UdpReceiver();
  UdpReceiver(const UdpReceiver&) = delete;
  UdpReceiver& operator=(const UdpReceiver&) = delete;

  struct Datagram {
    std::span<const std::uint8_t> bytes;  ///< valid until the next receive()
    std::int64_t utime = 0;               ///< arrival at the kernel, wall clock [us]
    std::uint64_t sender = 0;             ///< address and port, not 0
    bool other_host = false;              ///< with ttl=0: sent by another host
  };

  /// Receives a datagram that has arrived; false if there is none. Throws std::system_error.
  bool receive(Datagram& datagram);

  int descriptor() const { return descriptor_; }
  /// Number of datagrams that the kernel dropped because the buffer was full: those before the last
  /// received one, and after count_drops() all of them.
  std::int64_t overflowed() const { return overflowed_; }

  /// Counts all drops so far. To be called when no datagram is waiting: waiting datagrams still
  /// report the drops before them.
  void count_drops();

 private:
  void note_drops(std::uint32_t drops);
  bool from_here(std::uint32_t address);
  void read_own_addresses();

  int descriptor_;
  bool this_host_only_;
  std::vector<std::uint32_t> own_addresses_;
  std::int64_t addresses_read_ = 0;  // monotonic [ns]
  std::vector<std::uint8_t> buffer_;
  std::int64_t overflowed_ = 0;
  std::uint32_t last_drops_ = 0;
};

}  // namespace sprag
