// Foreign senders on the port: malformed packets, impossible messages, floods, a second master, and
// old recordings. No program ends, every refusal is counted by its cause, and the estimates do not
// change.
#include <atomic>
#include <csignal>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <sprag/contacts_t.hpp>
#include <thread>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/key.h"
#include "lcmtypes/messages.h"
#include "tests/end_to_end/fixture.h"
#include "tests/support/random.h"

namespace sprag::test {
namespace {

using namespace std::string_literals;

/// Sends raw datagrams to a port, as any host may.
class Stranger {
 public:
  explicit Stranger(std::uint16_t port) : descriptor_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    to_.sin_family = AF_INET;
    to_.sin_port = htons(port);
    inet_pton(AF_INET, "239.255.76.67", &to_.sin_addr);
    const int ttl = 0;
    ::setsockopt(descriptor_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  }
  ~Stranger() { ::close(descriptor_); }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;

  void send(const std::string& bytes) {
    (void)::sendto(descriptor_, bytes.data(), bytes.size(), 0,
                   reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }

  void send(const char* channel, std::span<const std::uint8_t> data) {
    send("LC02\0\0\0\0"s + channel + '\0' +
         std::string(reinterpret_cast<const char*>(data.data()), data.size()));
  }

 private:
  int descriptor_;
  sockaddr_in to_{};
};

contacts_t good_message(std::int64_t session) {
  contacts_t message{};
  message.session = session;
  message.speed = 1.0;
  message.horizon = 1.0;
  message.contacts = 1;
  message.records = 1;
  message.records_total = 1;
  message.t[0] = 0.5;
  message.contact[0] = 1;
  message.kind[0] = 3;
  return message;
}

std::vector<std::uint8_t> encoded(const contacts_t& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_GT(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
  return bytes;
}

class StrangerTest : public EndToEnd {
 protected:
  void SetUp() override {
    EndToEnd::SetUp();
    set_url(udp_url(port_));
  }

  void start_programs(const std::string& duration, const std::string& speed,
                      const Arguments& more = {}) {
    const Arguments common = Arguments{scene("paper_beam"), "--duration", duration} + more;
    logger_ = &start_listening("sync_logger", common + Arguments{"--csv", file("sync.csv"),
                                                                 "--report", file("sync.json")});
    observer_ = &start_listening(
        "observer", common + Arguments{"--tick", "0.015625", "--states", file("live.csv"),
                                       "--report", file("o.json")});
    master_ = &start_master(
        common + Arguments{"--tick", "0.015625", "--speed", speed, "--events", file("events.csv")});
    duration_ = duration;
  }

  void expect_unharmed() {
    EXPECT_EQ(end_of(*master_).code, 0);
    const Ended ended = end_of(*observer_);
    EXPECT_EQ(ended.code, 0);
    EXPECT_EQ(end_of(*logger_).code, 0);
    EXPECT_TRUE(text("live.csv") ==
                read_text(replay(scene("paper_beam"), file("events.csv"),
                                 {"--tick", "0.015625", "--duration", duration_})))
        << "live differs from the replay";
    EXPECT_EQ(json("o.json")["sessions"], 1);
    EXPECT_EQ(json("sync.json")["sessions"], 1);
    std::cout << ended.err.substr(ended.err.rfind("ticks"));
  }

  const std::uint16_t port_ = free_port();
  Stranger stranger_{port_};
  Process* logger_ = nullptr;
  Process* observer_ = nullptr;
  Process* master_ = nullptr;
  std::string duration_;
};

TEST_F(StrangerTest, MalformedAndImpossibleMessagesAndASecondMasterAreCountedByCause) {
  start_programs("60", "15");
  wait_for_time(*master_, 10.0);
  Process& second = start("master_sim", {scene("paper_beam_chatter"), "--speed", "5", "--tick",
                                         "0.015625", "--duration", "8"});
  const auto contacts = [this](const std::function<void(contacts_t&)>& spoil) {
    contacts_t message = good_message(99);
    spoil(message);
    stranger_.send(contacts_channel, encoded(message));
  };
  for (int i = 0; i < 10; ++i) {
    stranger_.send("HTTP/1.1 200 OK");
    stranger_.send("LC03\0\0\0\1\0\0\0\x10\x7f\xff\xff\xff\0\1\0\2SPRAG_CONTACTS\0data"s);
    stranger_.send("LC02\0\0\0\1SPRAG_CONTACTS"s);
    auto bytes = encoded(good_message(99));
    stranger_.send(contacts_channel, std::span(bytes).first(700));
    bytes[0] ^= 1U;
    stranger_.send(contacts_channel, bytes);
    contacts([](contacts_t& m) { m.t[0] = std::numeric_limits<double>::quiet_NaN(); });
    contacts([](contacts_t& m) { m.horizon = std::numeric_limits<double>::infinity(); });
    contacts([](contacts_t& m) { m.t[0] = -1e9; });
    contacts([](contacts_t& m) { m.contact[0] = 61; });
    contacts([](contacts_t& m) { m.records = -1; });
    contacts([](contacts_t& m) { m.records_total = -5; });
    contacts([](contacts_t& m) { m.contacts = 61; });
    contacts([](contacts_t& m) { m.contacts = 2; });
    contacts([](contacts_t& m) { m.speed = 0.0; });
    contacts([](contacts_t& m) { m.horizon = m.t[0] = 1e300; });
    // Valid, but from another master than the followed one.
    contacts([](contacts_t& m) { m.speed = std::numeric_limits<double>::infinity(); });
    stranger_.send(truth_channel, bytes);
    stranger_.send(settled_channel, std::span(bytes).first(20));
  }
  EXPECT_EQ(end_of(second).code, 0);
  const std::string said = observer_->err();
  expect_unharmed();
  EXPECT_NE(said.find("a second master"), std::string::npos) << said;
  const nlohmann::json messages = json("o.json")["messages"];
  const nlohmann::json expected{{"foreign", 10},     {"fragment", 10},   {"no_channel", 10},
                                {"truncated", 10},   {"wrong_type", 10}, {"bad_time", 30},
                                {"bad_contact", 10}, {"bad_count", 30},  {"other_machine", 10},
                                {"bad_speed", 10},   {"implausible", 10}};
  EXPECT_EQ(messages["refused"], expected);
  EXPECT_GT(messages["of_other_masters"], 110);
  EXPECT_GT(json("sync.json")["of_other_masters"], 100);
  EXPECT_EQ(json("sync.json")["refused"]["wrong_type"], 20);
}

TEST_F(StrangerTest, FloodOfFiftyThousandPacketsPerSecondHasNoEffect) {
  start_programs("50", "15");
  // The observer follows the first session that it receives.
  ASSERT_TRUE(
      in_time([&] { return observer_->err().find("observing from") != std::string::npos; }));
  const auto good = encoded(good_message(99));
  const std::string other = "LC02\0\0\0\0SPRAG_CONTACTS\0"s + std::string(good.begin(), good.end());
  const std::string rubbish(100, 'x');
  const auto start = std::chrono::steady_clock::now();
  std::int64_t sent = 0;
  for (; sent < 100'000; ++sent) {
    stranger_.send(sent % 2 == 0 ? rubbish : other);
    if (sent % 100 == 0) std::this_thread::sleep_until(start + sent * 20us);
  }
  const auto seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start);
  std::cout << sent << " packets in " << seconds.count() << " s\n";
  expect_unharmed();
  const nlohmann::json messages = json("o.json")["messages"];
  EXPECT_GT(messages["refused"]["foreign"], 4'000);
  EXPECT_GT(messages["of_other_masters"], 4'000);
}

class KeyTest : public StrangerTest {
 protected:
  std::string key_file(const std::string& name, char digit) {
    std::ofstream(file(name)) << std::string(64, digit) << '\n';
    return file(name);
  }
};

TEST_F(KeyTest, WithKeyForeignAndRecordedMessagesAreRefused) {
  const Arguments key{"--key", key_file("key", 'a')};
  // A first run, recorded by an attacker.
  Process& recorder = start_recorder(file("enemy.lcmlog"));
  Process& first = start_master(
      Arguments{scene("paper_beam"), "--duration", "20", "--tick", "0.015625", "--speed", "10"} +
      key);
  EXPECT_EQ(end_of(first).code, 0);
  end_recorder(recorder);

  start_programs("60", "15", key);
  wait_for_time(*master_, 5.0);
  Process& player = start_command({LCM_LOGPLAYER, "--lcm-url=" + url(), file("enemy.lcmlog")});
  Process& open = start("master_sim", {scene("paper_beam"), "--duration", "20", "--speed", "10"});
  Process& forger = start("master_sim", Arguments{scene("paper_beam"), "--duration", "20",
                                                  "--speed", "10", "--key", key_file("no", 'b')});
  end_of(player);
  EXPECT_EQ(end_of(open).code, 0);
  EXPECT_EQ(end_of(forger).code, 0);
  expect_unharmed();
  const nlohmann::json messages = json("o.json")["messages"];
  EXPECT_GT(messages["refused"]["unauthenticated"], 50);
  EXPECT_GT(messages["stale"], 20);
  EXPECT_GT(json("sync.json")["refused"]["unauthenticated"], 50);
}

}  // namespace
}  // namespace sprag::test
