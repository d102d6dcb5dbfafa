// LCM's wire format for messages of one packet: the bytes "LC02", a sequence number, the channel's
// name with its final zero, the message. Anybody may send anything to the port; what liblcm 1.3.1
// does with some of it (a bad fragment offset, a name without an end) ends the process, so that
// Sprag reads packets itself. Fragments ("LC03") are refused: Sprag's messages never need them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace sprag {

enum class PacketFault {
  none,
  foreign,    ///< not LCM's: another beginning, or no room for one
  fragment,   ///< part of a message of several packets
  no_channel  ///< the channel's name has no end, or more than 63 bytes, or none
};

inline constexpr int packet_faults = 4;

/// "none", "foreign", ...: the enumerator's name.
std::string_view name(PacketFault fault);

/// Views into the bytes of a packet.
struct Packet {
  std::string_view channel;
  std::span<const std::uint8_t> data;
};

/// Largest message that goes into one packet, whatever the channel [bytes].
inline constexpr std::size_t largest_packet_message = 65507 - 8 - 64;

/// Fills `packet` and returns PacketFault::none, or why the bytes are no packet.
PacketFault read_packet(std::span<const std::uint8_t> bytes, Packet& packet) noexcept;

}  // namespace sprag
