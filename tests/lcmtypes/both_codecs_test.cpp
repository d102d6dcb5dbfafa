// Compares the hand-written codecs with the generated types.
#include <gtest/gtest.h>

#include "lcmtypes/bounds_codec.h"
#include "lcmtypes/contacts_codec.h"
#include "lcmtypes/health_codec.h"
#include "lcmtypes/input_codec.h"
#include "lcmtypes/messages.h"
#include "lcmtypes/outputs_codec.h"
#include "lcmtypes/parameters_codec.h"
#include "lcmtypes/state_codec.h"
#include "tests/support/random_messages.h"

namespace sprag::test {
namespace {

template <class Message>
struct Old;
template <>
struct Old<contacts_t> {
  using type = ContactMessage;
};
template <>
struct Old<input_t> {
  using type = InputMessage;
};
template <>
struct Old<state_t> {
  using type = StateSample;
};
template <>
struct Old<estimate_t> {
  using type = EstimateSample;
};
template <>
struct Old<outputs_t> {
  using type = OutputsSample;
};
template <>
struct Old<parameters_t> {
  using type = ParametersSample;
};
template <>
struct Old<bounds_t> {
  using type = BoundsSample;
};
template <>
struct Old<health_t> {
  using type = Health;
};

std::vector<std::uint8_t> old_bytes(const ContactMessage& m) {
  EncodedContacts bytes;
  encode(m, bytes);
  return {bytes.begin(), bytes.end()};
}
std::vector<std::uint8_t> old_bytes(const InputMessage& m) {
  EncodedInput bytes;
  encode(m, bytes);
  return {bytes.begin(), bytes.end()};
}
std::vector<std::uint8_t> old_bytes(const StateSample& m) {
  std::vector<std::uint8_t> buffer;
  encode(m, buffer);
  return buffer;
}
std::vector<std::uint8_t> old_bytes(const EstimateSample& m) {
  std::vector<std::uint8_t> buffer;
  encode(m, buffer);
  return buffer;
}
std::vector<std::uint8_t> old_bytes(const Health& m) {
  std::vector<std::uint8_t> buffer;
  encode(m, buffer);
  return buffer;
}
std::vector<std::uint8_t> old_bytes(const OutputsSample&) { return {}; }
std::vector<std::uint8_t> old_bytes(const ParametersSample&) { return {}; }
std::vector<std::uint8_t> old_bytes(const BoundsSample&) { return {}; }

template <class Message>
class BothCodecs : public testing::Test {};
using Types = testing::Types<contacts_t, input_t, state_t, estimate_t, outputs_t, parameters_t,
                             bounds_t, health_t>;
TYPED_TEST_SUITE(BothCodecs, Types);

TYPED_TEST(BothCodecs, Agree) {
  Random random(9);
  TypeParam message{}, read{};
  typename Old<TypeParam>::type old;
  std::vector<std::uint8_t> buffer, again;
  int same_bytes = 0, accepted = 0, refused = 0, other_reason = 0;
  for (int i = 0; i < 60000; ++i) {
    fill(random, message);
    const auto bytes = encode(message, buffer);
    ASSERT_EQ(name(decode(bytes, old)), "none");
    ASSERT_EQ(name(decode(bytes, read)), "none");
    ASSERT_TRUE(std::ranges::equal(encode(read, again), bytes));
    const auto of_old = old_bytes(old);
    if (!of_old.empty()) {
      ASSERT_TRUE(std::ranges::equal(of_old, bytes));
      ++same_bytes;
    }
    mutate(random, buffer);
    const Refusal by_old = decode(buffer, old), by_new = decode(buffer, read);
    ASSERT_EQ(by_old == Refusal::none, by_new == Refusal::none)
        << name(by_old) << " " << name(by_new);
    ++(by_new == Refusal::none ? accepted : refused);
    if (by_old != by_new) ++other_reason;
    if (by_new != Refusal::none) continue;
    const auto old_again = old_bytes(old);
    if (old_again.empty()) continue;
    // Strict flags, used records only.
    encode(read, again);
    if (std::is_same_v<TypeParam, contacts_t> || std::is_same_v<TypeParam, input_t>) continue;
    if (old_again != again) {
      ++same_bytes;
    }
  }
  std::cout << same_bytes << " same, " << accepted << " accepted, " << refused << " refused, "
            << other_reason << " for another reason\n";
}

}  // namespace
}  // namespace sprag::test
