// A multicast receiver of LCM's packets. Unlike LCM's socket it accepts no packets of other groups
// on the same port, and with ttl=0 none from other hosts.
//
// LCM's wire format for messages of one packet: the bytes "LC02", a sequence number, the channel's
// name with its final zero, the message. Sprag reads packets itself because anybody may send to the
// port, and some malformed packets (a bad fragment offset, an unterminated name) end a process that
// reads with liblcm 1.3.1. Fragments ("LC03") are refused: Sprag's messages fit into one packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lcmtypes/descriptor.h"
#include "lcmtypes/lcm_url.h"

namespace sprag {

enum class PacketFault {
  none,
  foreign,    ///< not an LCM packet: other magic bytes, or too short
  fragment,   ///< part of a message of several packets
  no_channel  ///< the channel's name is unterminated, empty, or longer than 63 bytes
};

inline constexpr int packet_faults = 4;

/// "none", "foreign", ...: the enumerator's name.
std::string_view name(PacketFault fault);

/// The parts of a packet, as views of its bytes.
struct Packet {
  std::string_view channel;
  std::span<const std::uint8_t> data;
};

/// Largest message that fits into one packet with any channel name [bytes].
inline constexpr std::size_t largest_packet_message = 65507 - 8 - 64;

/// Reads `packet` and returns PacketFault::none, or why the bytes are not a packet.
PacketFault read_packet(std::span<const std::uint8_t> bytes, Packet& packet) noexcept;

class UdpReceiver {
 public:
  /// Requests `receive_buffer` bytes from the kernel; as root, more than net.core.rmem_max is
  /// possible. Throws std::system_error.
  UdpReceiver(const MulticastAddress& address, int receive_buffer);

  struct Datagram {
    std::span<const std::uint8_t> bytes;  ///< valid until the next receive()
    std::int64_t utime = 0;               ///< arrival at the kernel, wall clock [us]
    std::uint64_t sender = 0;             ///< address and port, not 0
    bool other_host = false;              ///< with ttl=0: sent by another host
  };

  /// Receives a datagram that has arrived; false if there is none. Throws std::system_error.
  bool receive(Datagram& datagram);

  int descriptor() const { return descriptor_.get(); }
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

  Descriptor descriptor_;
  bool this_host_only_;
  std::vector<std::uint32_t> own_addresses_;
  std::int64_t addresses_read_ = 0;  // monotonic [ns]
  std::vector<std::uint8_t> buffer_;
  std::int64_t overflowed_ = 0;
  std::uint32_t last_drops_ = 0;
};

}  // namespace sprag
