// Would catch a changed message that keeps a valid tag, and a key file that is read wrongly.
#include "lcmtypes/key.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "lcmtypes/bus.h"
#include "sprag/detail/files/csv.h"
#include "tests/support/temporary_directory.h"
#include "tests/support/udp_url.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

Key key_of_ones(std::uint8_t value = 1) {
  std::array<std::uint8_t, Key::size> bytes{};
  bytes.fill(value);
  return Key(bytes);
}

Bytes tagged(const Key& key, const std::string& channel, Bytes message) {
  const Key::Tag tag = key.tag(channel, message);
  message.insert(message.end(), tag.begin(), tag.end());
  return message;
}

TEST(KeyTest, RefusesTagWithAnyChangedBit) {
  const Key key = key_of_ones();
  const Bytes good = tagged(key, "A", {1, 2, 3, 4, 5});
  EXPECT_TRUE(key.verifies("A", good));
  EXPECT_FALSE(key.verifies("B", good));
  EXPECT_FALSE(key_of_ones(2).verifies("A", good));
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
    EXPECT_FALSE(key.verifies("A", bad)) << bit;
  }
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(key.verifies("A", std::span(good).first(size))) << size;
  }
}

// The boundary between channel name and message is authenticated.
TEST(KeyTest, TagAuthenticatesBoundaryOfChannelName) {
  const Key key = key_of_ones();
  EXPECT_NE(key.tag("AB", Bytes{'C'}), key.tag("A", Bytes{'B', 'C'}));
}

std::string hexadecimal(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4U];
    text += "0123456789abcdef"[byte & 15U];
  }
  return text;
}

// The reference for programs of other authors.
TEST(KeyTest, TheTestVectorOfTheDocumentationIsRight) {
  const std::string page = test::read_text(SPRAG_SOURCE_DIR "/docs/reference/messages.md");
  std::array<std::uint8_t, Key::size> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i);
  const Bytes message{1, 2, 3, 4};
  const Bytes sent = tagged(Key(bytes), "SPRAG_CONTACTS", message);
  for (const std::string& text : {hexadecimal(bytes), hexadecimal(message), hexadecimal(sent)})
    EXPECT_NE(page.find("`" + text + "`"), std::string::npos) << text;
}

class KeyFile : public testing::Test {
 protected:
  std::string write(const std::string& text) {
    const std::string file = (directory_ / "key").string();
    std::ofstream(file) << text;
    return file;
  }

 private:
  test::TemporaryDirectory directory_;
};

TEST_F(KeyFile, HoldsSixtyFourHexadecimalDigits) {
  const std::string digits(64, '1');
  std::array<std::uint8_t, Key::size> bytes{};
  bytes.fill(0x11);
  const Key::Tag expected = Key(bytes).tag("A", Bytes{1});
  for (const std::string& text : {digits, digits + "\n", "  " + digits + "\r\n"}) {
    EXPECT_EQ(Key(write(text)).tag("A", Bytes{1}), expected);
  }
}

TEST_F(KeyFile, InvalidContentIsRefused) {
  const std::string digits(64, '1');
  for (const std::string& text : {std::string{}, std::string("secret"), digits.substr(1),
                                  digits.substr(2), digits + "11", digits + " 1", "g" + digits}) {
    EXPECT_THROW(Key{write(text)}, InputError) << text;
  }
  EXPECT_THROW(Key{std::filesystem::path("/nowhere/key")}, InputError);
  EXPECT_THROW(Key{std::filesystem::path("/tmp")}, InputError);
}

TEST(KeyTest, BusWithKeyReceivesOnlyMessagesOfItsKey) {
  const std::string url = test::udp_url();
  Bus friendly(url, key_of_ones());
  Bus stranger(url, key_of_ones(2));
  Bus open(url);
  Bus receiver(url, key_of_ones());
  std::vector<Bytes> received;
  std::vector<Bytes> as_sent;
  receiver.subscribe("A", [&](auto, std::span<const std::uint8_t> data, auto) {
    received.emplace_back(data.begin(), data.end());
    const auto whole = receiver.as_sent(data);
    as_sent.emplace_back(whole.begin(), whole.end());
  });
  EXPECT_TRUE(open.publish("A", Bytes{1}));
  EXPECT_TRUE(open.publish("A", Bytes(100)));
  EXPECT_TRUE(stranger.publish("A", Bytes{2}));
  EXPECT_TRUE(open.publish("B", Bytes{3}));  // not subscribed to: not counted
  EXPECT_TRUE(friendly.publish("A", Bytes{4, 5}));
  while (received.empty() && receiver.handle(10s) > 0) {
  }
  EXPECT_EQ(received, (std::vector<Bytes>{{4, 5}}));
  EXPECT_EQ(as_sent, (std::vector<Bytes>{tagged(key_of_ones(), "A", {4, 5})}));
  EXPECT_EQ(receiver.counts().unauthenticated, 3);
}

}  // namespace
}  // namespace sprag
