// Would catch a conversion that changes content, or half applies a refused message.
#include "lcmtypes/contact_messages.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "lcmtypes/messages.h"
#include "tests/support/random_messages.h"

namespace sprag::test {
namespace {

TEST(ContactMessages, ContactsCountFromZeroInMemory) {
  ContactMessage content;
  content.contacts = 3;
  content.records_total = 7;
  content.records = 2;
  content.record[0] = {0.25, 0, ContactEventKind::closes};
  content.record[1] = {0.5, 2, ContactEventKind::pulse};
  content.record[2] = {0.75, 1, ContactEventKind::pulse};  // not used
  std::vector<std::uint8_t> bytes;
  contacts_t message{};
  ASSERT_EQ(decode(encode(content, bytes), message), Refusal::none);
  EXPECT_EQ(message.contact[0], 1);
  EXPECT_EQ(message.kind[0], 1);
  EXPECT_EQ(message.t[1], 0.5);
  EXPECT_EQ(message.contact[1], 3);
  EXPECT_EQ(message.kind[1], 3);
  EXPECT_EQ(message.t[2], 0.0);
  EXPECT_EQ(message.contact[2], 0);
  EXPECT_EQ(message.kind[2], 0);
}

TEST(ContactMessages, RandomContentReturnsUnchanged) {
  Random random(1);
  contacts_t message{};
  ContactMessage content;
  std::vector<std::uint8_t> bytes, again;
  for (int i = 0; i < 500; ++i) {
    fill(random, message);
    encode(message, bytes);
    ASSERT_EQ(decode(bytes, content), Refusal::none);
    EXPECT_EQ(content.contacts, message.contacts);
    EXPECT_EQ(content.horizon, message.horizon);
    ASSERT_TRUE(std::ranges::equal(encode(content, again), bytes)) << i;
  }
}

TEST(ContactMessages, ARefusedMessageChangesNothing) {
  ContactMessage content;
  content.contacts = 0;
  content.sequence = 3;
  std::vector<std::uint8_t> bytes;
  encode(content, bytes);
  content.sequence = 5;
  EXPECT_EQ(decode(bytes, content), Refusal::bad_count);
  EXPECT_EQ(content.sequence, 5);
}

TEST(ContactMessages, InputSamples) {
  input_t message{};
  message.session = 5;
  message.sequence = 7;
  message.utime = 9;
  message.t0 = -0.25;
  message.dt = 0.002;
  message.total = 40;
  message.channels = 3;
  message.n = 20;
  for (int i = 0; i < 60; ++i) message.value[i] = 0.5 * i - 3.0;
  std::vector<std::uint8_t> bytes;
  InputMessage content;
  ASSERT_EQ(decode(encode(message, bytes), content), Refusal::none);
  EXPECT_EQ(content.session, 5);
  EXPECT_EQ(content.sequence, 7);
  EXPECT_EQ(content.utime, 9);
  EXPECT_EQ(content.t0, -0.25);
  EXPECT_EQ(content.dt, 0.002);
  EXPECT_EQ(content.first(), 20);
  EXPECT_EQ(content.sample(22), message.value[6]);
  bytes[3] ^= 1U;
  EXPECT_EQ(decode(bytes, content), Refusal::wrong_type);
}

}  // namespace
}  // namespace sprag::test
