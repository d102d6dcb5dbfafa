#include "lcmtypes/packet.h"

#include <algorithm>
#include <array>

#include "lcmtypes/big_endian.h"

namespace sprag {
namespace {

constexpr std::uint32_t short_magic = 0x4c433032;     // "LC02"
constexpr std::uint32_t fragment_magic = 0x4c433033;  // "LC03"
constexpr std::size_t header_size = 8;
constexpr std::size_t longest_name = 63;

}  // namespace

std::string_view name(PacketFault fault) {
  constexpr std::array<std::string_view, packet_faults> names = {"none", "foreign", "fragment",
                                                                 "no_channel"};
  static_assert(static_cast<int>(PacketFault::no_channel) + 1 == packet_faults);
  return names.at(static_cast<std::size_t>(fault));
}

PacketFault read_packet(std::span<const std::uint8_t> bytes, Packet& packet) noexcept {
  if (bytes.size() < header_size) return PacketFault::foreign;
  const std::uint8_t* from = bytes.data();
  const auto magic = take<std::uint32_t>(from);
  if (magic == fragment_magic) return PacketFault::fragment;
  if (magic != short_magic) return PacketFault::foreign;
  const auto rest = bytes.subspan(header_size);
  const auto searched = rest.first(std::min(rest.size(), longest_name + 1));
  const auto end = std::find(searched.begin(), searched.end(), std::uint8_t{0});
  if (end == searched.end() || end == searched.begin()) return PacketFault::no_channel;
  const auto length = static_cast<std::size_t>(end - searched.begin());
  packet.channel = {reinterpret_cast<const char*>(rest.data()), length};
  packet.data = rest.subspan(length + 1);
  return PacketFault::none;
}

}  // namespace sprag
