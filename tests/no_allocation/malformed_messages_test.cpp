// Random and changed packets: decoding ends, and allocates at most twice a packet's size at once.
#include <gtest/gtest.h>

#include <vector>

#include "lcmtypes/messages.h"
#include "lcmtypes/udp_receiver.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/random_messages.h"
#include "tests/support/repetitions.h"

namespace sprag::test {
namespace {

template <class Message>
class MalformedMessages : public testing::Test {};
using Types = testing::Types<contacts_t, input_t, state_t, estimate_t, outputs_t, parameters_t,
                             bounds_t, health_t>;
TYPED_TEST_SUITE(MalformedMessages, Types);

constexpr std::size_t types = 8;

// As received: LCM's header, a channel, a message of this type. Every fifth message is random after
// its type hash, the others are changed in a few places.
template <class Message>
void fill_packet(Random& random, Message& message, std::vector<std::uint8_t>& packet) {
  fill(random, message);
  std::vector<std::uint8_t> bytes;
  encode(message, bytes);
  if (random.chance(0.2)) {
    bytes.resize(static_cast<std::size_t>(random.integer(8, 400)));
    for (std::size_t i = 8; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::uint8_t>(random.chance(0.5) ? 0 : random.integer(0, 255));
    }
  } else {
    mutate(random, bytes);
  }
  packet = {'L', 'C', '0', '2', 0, 0, 0, 0, 'X', 0};
  packet.insert(packet.end(), bytes.begin(), bytes.end());
  if (random.chance(0.05)) {
    packet[static_cast<std::size_t>(random.integer(0, 9))] =
        static_cast<std::uint8_t>(random.integer(0, 255));
  }
}

TYPED_TEST(MalformedMessages, AreDecodedWithinTwiceTheirSize) {
  Random random(27);
  TypeParam valid{}, message{};
  std::vector<std::uint8_t> bytes;
  int accepted = 0, refused = 0;
  const int packets = long_repetitions(1'000'000 / static_cast<int>(types));
  for (int i = 0; i < packets; ++i) {
    fill_packet(random, valid, bytes);
    Packet packet;
    if (read_packet(bytes, packet) != PacketFault::none) continue;
    if (random.chance(0.01)) message = {};  // else with the capacity of the messages before
    CountAllocations counting;
    const Refusal refusal = decode(packet.data, message);
    counting.stop();
    ASSERT_LE(counting.largest(), 2 * bytes.size()) << "packet " << i;
    ++(refusal == Refusal::none ? accepted : refused);
  }
  EXPECT_GT(accepted, packets / 20);
  EXPECT_GT(refused, packets / 20);
}

// The longest array of the shortest names.
TEST(DeclaredLengths, NamesTakeLittleMemory) {
  for (const int length : {0, 1, 2, 3}) {
    bounds_t message{};
    message.n = 900;
    message.name.assign(900, std::string(static_cast<std::size_t>(length), 'x'));
    message.half_width.assign(900, 1.0);
    std::vector<std::uint8_t> bytes;
    encode(message, bytes);
    bounds_t read{};
    CountAllocations counting;
    const Refusal refusal = decode(bytes, read);
    counting.stop();
    EXPECT_LE(counting.largest(), 2 * bytes.size());
    EXPECT_EQ(refusal, length < 3 ? Refusal::bad_count : Refusal::none) << length;
  }
}

// A length of 2^31 - 1 would make the generated code allocate gigabytes.
TEST(DeclaredLengths, AreCheckedFirst) {
  const auto expect_refused = [](auto message, std::initializer_list<std::size_t> lengths) {
    Random random(28);
    std::vector<std::uint8_t> good;
    do {
      fill(random, message);
      encode(message, good);
    } while (good.size() < 200);
    for (const std::size_t at : lengths) {
      for (const bool negative : {false, true}) {
        std::vector<std::uint8_t> bytes = good;
        bytes[at] = negative ? 0xff : 0x7f;
        bytes[at + 1] = bytes[at + 2] = bytes[at + 3] = 0xff;
        CountAllocations counting;
        const Refusal refusal = decode(bytes, message);
        const long allocations = counting.stop();
        EXPECT_NE(refusal, Refusal::none) << at;
        EXPECT_EQ(allocations, 0) << at;
      }
    }
  };
  expect_refused(state_t{}, {40});
  expect_refused(estimate_t{}, {40});
  expect_refused(outputs_t{}, {42, 46});
  expect_refused(parameters_t{}, {40, 44});
  expect_refused(bounds_t{}, {56, 60});
  expect_refused(health_t{}, {284, 288});
}

}  // namespace
}  // namespace sprag::test
