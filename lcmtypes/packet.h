// LCM's wire format for messages of one packet: the bytes "LC02", a sequence number, the channel's
// name with its final zero, the message. Sprag reads packets itself because anybody may send to the
// port, and some malformed packets (a bad fragment offset, an unterminated name) end a process that
// reads with liblcm 1.3.1. Fragments ("LC03") are refused: Sprag's messages fit into one packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

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

}  // namespace sprag
