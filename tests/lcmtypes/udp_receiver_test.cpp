// Would catch a packet read beyond its bounds or accepted in part.
#include "lcmtypes/udp_receiver.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/random.h"

namespace sprag {
namespace {

using namespace std::string_literals;

PacketFault unpacked(const std::string& bytes, Packet& packet) {
  return read_packet({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, packet);
}

PacketFault fault_of(const std::string& bytes) {
  Packet packet;
  return unpacked(bytes, packet);
}

TEST(Packet, ReadsChannelAndMessage) {
  Packet packet;
  const std::string bytes = "LC02\0\0\0\7SPRAG_CONTACTS\0\1\2\0"s;
  ASSERT_EQ(unpacked(bytes, packet), PacketFault::none);
  EXPECT_EQ(packet.channel, "SPRAG_CONTACTS");
  EXPECT_EQ(std::vector<int>(packet.data.begin(), packet.data.end()), (std::vector{1, 2, 0}));
  const std::string empty = "LC02\0\0\0\0A\0"s;
  ASSERT_EQ(unpacked(empty, packet), PacketFault::none);
  EXPECT_EQ(packet.channel, "A");
  EXPECT_TRUE(packet.data.empty());
}

TEST(Packet, InvalidPacketsAreRefusedByCause) {
  EXPECT_EQ(fault_of(""), PacketFault::foreign);
  EXPECT_EQ(fault_of("LC02\0\0\0"s), PacketFault::foreign);
  EXPECT_EQ(fault_of("LC01\0\0\0\0A\0"s), PacketFault::foreign);
  EXPECT_EQ(fault_of("LC03\0\0\0\0\0\0\xff\xff\xff\xff\xff\xff\0\0\0\2SPRAG_TRUTH\0x"s),
            PacketFault::fragment);
  EXPECT_EQ(fault_of("LC02\0\0\0\0"s), PacketFault::no_channel);
  EXPECT_EQ(fault_of("LC02\0\0\0\0\0data"s), PacketFault::no_channel);
  EXPECT_EQ(fault_of("LC02\0\0\0\0SPRAG_CONTACTS"s), PacketFault::no_channel);
  EXPECT_EQ(fault_of("LC02\0\0\0\0"s + std::string(63, 'x') + "\0data"s), PacketFault::none);
  EXPECT_EQ(fault_of("LC02\0\0\0\0"s + std::string(64, 'x') + "\0data"s), PacketFault::no_channel);
}

// A sanitizer detects an access out of bounds.
TEST(Packet, RandomBytesStayWithinTheirBounds) {
  Random random(1);
  int read_well = 0;
  for (int i = 0; i < 100000; ++i) {
    std::string bytes(static_cast<std::size_t>(random.integer(0, 90)), '\0');
    for (char& c : bytes) c = static_cast<char>(random.integer(0, random.chance(0.9) ? 255 : 1));
    if (random.chance(0.7)) bytes.replace(0, 4, random.chance(0.8) ? "LC02" : "LC03");
    Packet packet;
    if (unpacked(bytes, packet) != PacketFault::none) continue;
    ++read_well;
    ASSERT_EQ(8 + packet.channel.size() + 1 + packet.data.size(), bytes.size());
    ASSERT_EQ(packet.channel.find('\0'), std::string_view::npos);
  }
  EXPECT_GT(read_well, 1000);
}

}  // namespace
}  // namespace sprag
