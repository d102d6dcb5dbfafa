// Would catch a bus that loses, reorders or mixes messages, receives foreign ones, or fails without
// a cause and a remedy.
#include "lcmtypes/bus.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/time.h>
#include <sys/wait.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/multicast_probe.h"
#include "tests/support/temporary_directory.h"
#include "tests/support/udp_url.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

struct Message {
  std::string channel;
  std::vector<std::uint8_t> data;

  friend bool operator==(const Message&, const Message&) = default;
};

Bus::Handler collect(std::vector<Message>& messages) {
  return [&messages](std::string_view channel, std::span<const std::uint8_t> data, std::int64_t) {
    messages.push_back({std::string(channel), {data.begin(), data.end()}});
  };
}

/// Handles messages until `count` have arrived; false after half a minute without one.
bool handle_until(Bus& bus, const std::vector<Message>& messages, std::size_t count) {
  for (int silence = 0; messages.size() < count && silence < 30;)
    silence = bus.handle(1s) > 0 ? 0 : silence + 1;
  return messages.size() >= count;
}

std::vector<std::uint8_t> numbered(int i, std::size_t size) {
  std::vector<std::uint8_t> data(size);
  for (std::size_t b = 0; b < size; ++b)
    data[b] = static_cast<std::uint8_t>(static_cast<std::size_t>(i) * 31 + b);
  return data;
}

TEST(BusTest, LargeBurstArrivesCompletelyAndInOrder) {
  const std::string url = test::udp_url();
  Bus sender(url), receiver(url);
  std::vector<Message> received;
  receiver.subscribe(contacts_channel, collect(received));
  std::vector<Message> sent;
  for (int i = 0; i < 500; ++i) {
    sent.push_back({contacts_channel, numbered(i, 1272)});
    ASSERT_TRUE(sender.publish(contacts_channel, sent.back().data));
  }
  ASSERT_TRUE(handle_until(receiver, received, sent.size()));
  EXPECT_EQ(received, sent);
  EXPECT_EQ(receiver.handle(0ms), 0);
}

TEST(BusTest, AMessageIsOnePacketOrNone) {
  const std::string url = test::udp_url();
  Bus sender(url), receiver(url);
  std::vector<Message> received;
  receiver.subscribe(truth_channel, collect(received));
  const auto data = numbered(1, largest_packet_message);
  EXPECT_FALSE(sender.publish(truth_channel, numbered(1, data.size() + 1)));
  ASSERT_TRUE(sender.publish(truth_channel, data));
  ASSERT_TRUE(handle_until(receiver, received, 1));
  EXPECT_EQ(received[0].data, data);
}

TEST(BusTest, ChannelsMatchExactlyAndPrefixesByPrefix) {
  const std::string url = test::udp_url();
  Bus sender(url), receiver(url);
  std::vector<Message> exact, prefixed;
  receiver.subscribe("A.B", collect(exact));
  receiver.subscribe_prefix("A.", collect(prefixed));
  for (const char* channel : {"AxB", "A.BC", "XA.B", "A.", "A.B"}) sender.publish(channel, {});
  ASSERT_TRUE(handle_until(receiver, exact, 1));
  EXPECT_EQ(exact, (std::vector<Message>{{"A.B", {}}}));
  EXPECT_EQ(prefixed, (std::vector<Message>{{"A.BC", {}}, {"A.", {}}, {"A.B", {}}}));
}

TEST(BusTest, ExceptionOfHandlerIsRethrownAndBusStaysUsable) {
  const std::string url = test::udp_url();
  Bus bus(url);
  int calls = 0;
  bus.subscribe("A", [&calls](auto, auto, auto) {
    if (++calls == 1) throw std::logic_error("from a handler");
  });
  bus.publish("A", {});
  bus.publish("A", {});
  EXPECT_THROW(while (true) bus.handle(1s), std::logic_error);
  EXPECT_EQ(calls, 1);
  while (calls < 2) bus.handle(1s);
}

// liblcm receives every group of a port.
TEST(BusTest, GroupsOnOnePortSeparateRuns) {
  const std::string port = std::to_string(test::free_port());
  Bus one("udpm://239.255.76.67:" + port + "?ttl=0");
  Bus other("udpm://239.255.76.68:" + port + "?ttl=0");
  std::vector<Message> received, received_by_other;
  one.subscribe("A", collect(received));
  other.subscribe("A", collect(received_by_other));
  other.publish("A", numbered(1, 3));
  one.publish("A", numbered(2, 3));
  ASSERT_TRUE(handle_until(one, received, 1));
  ASSERT_TRUE(handle_until(other, received_by_other, 1));
  EXPECT_EQ(received, (std::vector<Message>{{"A", numbered(2, 3)}}));
  EXPECT_EQ(received_by_other, (std::vector<Message>{{"A", numbered(1, 3)}}));
}

TEST(BusTest, HandlerDistinguishesSenders) {
  const std::string url = test::udp_url();
  Bus one(url), other(url), receiver(url);
  std::vector<std::uint64_t> senders;
  receiver.subscribe("A", [&](auto, auto, auto) { senders.push_back(receiver.sender()); });
  for (Bus* bus : {&one, &other, &one}) ASSERT_TRUE(bus->publish("A", {}));
  while (senders.size() < 3) ASSERT_GT(receiver.handle(30s), 0);
  EXPECT_EQ(senders[0], senders[2]);
  EXPECT_NE(senders[0], senders[1]);
  EXPECT_NE(senders[0], 0U);
}

// A program that does not share the port, like most servers.
TEST(BusTest, PortInUseIsReportedAndNotAsMissingRoute) {
  const std::uint16_t port = test::free_port();
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  ASSERT_EQ(::bind(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  try {
    const Bus bus(test::udp_url(port));
    ADD_FAILURE() << "the port is shared";
  } catch (const BusError& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find("UDP port " + std::to_string(port) + " is in use"), std::string::npos)
        << what;
    EXPECT_EQ(what.find("route"), std::string::npos) << what;
  }
  ::close(descriptor);
}

TEST(BusTest, ProbeDoesNotDisturbListeners) {
  const std::uint16_t port = test::free_port();
  Bus bus(test::udp_url(port));
  std::vector<Message> received;
  bus.subscribe_prefix("SPRAG_", collect(received));
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(probe_multicast({"239.255.76.67", port, 0}));
  bus.publish(truth_channel, numbered(1, 10));
  ASSERT_TRUE(handle_until(bus, received, 1));
  EXPECT_EQ(received, (std::vector<Message>{{truth_channel, numbered(1, 10)}}));
}

TEST(BusTest, SignalInterruptsHandle) {
  struct sigaction action {
  }, old{};
  action.sa_handler = [](int) {};
  action.sa_flags = SA_RESTART;
  sigaction(SIGALRM, &action, &old);
  Bus bus(test::udp_url());
  bus.subscribe("A", [](auto, auto, auto) {});
  const itimerval often{{0, 10000}, {0, 10000}}, never{};
  setitimer(ITIMER_REAL, &often, nullptr);
  EXPECT_EQ(bus.handle(std::chrono::hours(1)), 0);
  setitimer(ITIMER_REAL, &never, nullptr);
  sigaction(SIGALRM, &old, nullptr);
}

TEST(BusTest, OtherThreadsMayPublish) {
  const std::string url = test::udp_url();
  Bus bus(url);
  std::vector<Message> received;
  bus.subscribe("A", collect(received));
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&bus] {
      for (int k = 0; k < 50; ++k) EXPECT_TRUE(bus.publish("A", numbered(k, 100)));
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(handle_until(bus, received, 200));
}

TEST(BusTest, MemoryQueueAndLogFileNeedNoNetwork) {
  Bus memory("memq://");
  std::vector<Message> received;
  memory.subscribe("A", collect(received));
  EXPECT_TRUE(memory.publish("A", numbered(3, 20)));
  ASSERT_TRUE(handle_until(memory, received, 1));
  EXPECT_EQ(received[0].data, numbered(3, 20));

  const test::TemporaryDirectory directory;
  const auto file = directory / "x.lcmlog";
  ChannelLogWriter writer(file);
  for (int i = 0; i < 10; ++i) writer.write(1000 * i, "A", numbered(i, 5));
  ASSERT_TRUE(writer.close());
  Bus log("file://" + file.string() + "?speed=0");
  received.clear();
  log.subscribe("A", collect(received));
  ASSERT_TRUE(handle_until(log, received, 10));
  EXPECT_EQ(received[9].data, numbered(9, 5));
  EXPECT_THROW(log.handle(1s), BusError);
}

TEST(BusTest, AddressesThatCannotBeOpenedAreErrors) {
  EXPECT_THROW(Bus("nonsense"), UrlError);
  EXPECT_THROW(Bus("file:///nowhere/x.lcmlog"), BusError);
}

/// Runs `check` in a separate network namespace, without lo and without routes, and returns its
/// result; empty if namespaces are not permitted.
std::optional<int> in_new_network(int (*check)()) {
  constexpr int not_permitted = 99;
  const auto user = std::to_string(::getuid());
  const pid_t child = ::fork();
  if (child == 0) {
    if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) ::_exit(not_permitted);
    std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
    ::_exit(check());
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!WIFEXITED(status)) return -1;
  if (WEXITSTATUS(status) == not_permitted) return std::nullopt;
  return WEXITSTATUS(status);
}

TEST(BusTest, RemedyRestoresMulticastAndLostRouteFailsPublishing) {
  if (std::system("command -v ip >/dev/null") != 0) GTEST_SKIP() << "no ip here (iproute2)";
  const auto result = in_new_network([] {
    if (std::system("ip link set lo up && ip route add 224.0.0.0/4 dev lo") != 0) return 3;
    try {
      Bus bus;
      std::vector<Message> received;
      bus.subscribe("A", collect(received));
      if (!bus.publish("A", {})) return 4;
      if (!handle_until(bus, received, 1)) return 8;
      if (std::system("ip route del 224.0.0.0/4 dev lo") != 0) return 5;
      return bus.publish("A", {}) ? 6 : 0;
    } catch (const BusError&) {
      return 7;
    }
  });
  if (!result) GTEST_SKIP() << "network namespaces are not permitted here";
  EXPECT_EQ(*result, 0);
}

}  // namespace
}  // namespace sprag
