// Master and observer with a bad network between them: a relay that loses, duplicates, delays and
// reorders packets by a seeded plan, and two hosts with a firewall that drops packets.
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iostream>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

using BlackoutTest = EndToEnd;

// Losses, and an outage longer than the repeated records of a message: more than 120 are lost.
TEST_F(BlackoutTest, IsReportedAndObserverConvergesAgain) {
  const std::string machine = scene("paper_beam_chatter");
  const Arguments how{"--duration", "180", "--tick", "0.015625"};
  const std::uint16_t near = free_port(), far = free_port();
  Process& relay =
      start_command({RELAY, std::to_string(near), std::to_string(far), "--seed", "10", "--loss",
                     "0.1", "--double", "0.2", "--reorder", "0.25", "--delay", "50", "--outages",
                     "1", "--every", "1.5", "--outage", "1.2"});
  EXPECT_TRUE(in_time([&] { return relay.err().find("listening") != std::string::npos; }));
  set_url(udp_url(far));
  Process& observer = start_listening(
      "observer",
      Arguments{machine, "--states", file("live.csv"), "--report", file("o.json")} + how);
  set_url(udp_url(near));
  Process& master = start_master(
      Arguments{machine, "--no-truth", "--speed", "40", "--states", file("truth.csv")} + how);
  EXPECT_EQ(end_of(master).code, 0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 0);
  relay.signal(SIGTERM);
  std::cout << end_of(relay).err << ended.err.substr(ended.err.rfind("ticks "));
  EXPECT_NE(ended.err.find("the master is silent"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("events may be missing between t = "), std::string::npos);

  const nlohmann::json report = json("o.json");
  EXPECT_GT(report["lost_records"], 0);
  EXPECT_GE(report["messages"]["lost"], 100);
  EXPECT_GE(report["messages"]["doubled"], 20);
  EXPECT_GE(report["messages"]["reordered"], 30);
  EXPECT_GE(report["messages"]["repaired_events"], 10);
  EXPECT_TRUE(report["confidence"]["bound"]["final"].is_number());
  ASSERT_EQ(report["degraded"].size(), 1U);
  const double from = report["degraded"][0]["from"], to = report["degraded"][0]["to"];
  EXPECT_GT(to, from);
  EXPECT_EQ(run("sync_logger", {machine, "--truth", file("truth.csv"), "--estimate",
                                file("live.csv"), "--csv", file("sync.csv")})
                .code,
            0);
  const std::vector<SyncLine> rows = read_sync(file("sync.csv"));
  ASSERT_EQ(rows.size(), 11521U);
  const auto after = static_cast<std::size_t>(std::min(to / 0.015625 + 1.0, 11000.0));
  std::cout << "degraded from " << from << " to " << to << ", V " << rows[after].v
            << ", at the end " << rows.back().v << '\n';
  EXPECT_GT(rows[after].v, 1e-6);
  EXPECT_LT(rows.back().v, 1e-2 * rows[after].v);
}

/// Two hosts joined by a cable; the destructor removes them.
class TwoHosts {
 public:
  TwoHosts() {
    const std::string id = std::to_string(::getpid() % 100000);
    a = "sprag_a" + id;
    b = "sprag_b" + id;
    const std::string in_a = "ip netns exec " + a + " ";
    const std::string in_b = "ip netns exec " + b + " ";
    const std::string chain = "inet sprag input";
    for (const std::string& command :
         {"ip netns add " + a, "ip netns add " + b,
          "ip link add sa" + id + " netns " + a + " type veth peer name sb" + id + " netns " + b,
          in_a + "ip address add 10.77.0.1/24 dev sa" + id,
          in_b + "ip address add 10.77.0.2/24 dev sb" + id, in_a + "ip link set sa" + id + " up",
          in_b + "ip link set sb" + id + " up", in_a + "ip route add 224.0.0.0/4 dev sa" + id,
          in_b + "ip route add 224.0.0.0/4 dev sb" + id, in_b + "nft add table inet sprag",
          in_b + "nft 'add chain " + chain + " { type filter hook input priority 0; }'",
          in_b + "nft add rule " + chain + " ip saddr 10.77.0.1 numgen random mod 10 == 0 drop"}) {
      if (std::system((command + " > /dev/null 2>&1").c_str()) == 0) continue;
      refused = command;
      return;
    }
  }
  ~TwoHosts() {
    for (const std::string& host : {a, b}) {
      (void)!std::system(("ip netns del " + host + " > /dev/null 2>&1").c_str());
    }
  }
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  std::string a, b;
  std::string refused;  // the failed command
};

class HostsTest : public EndToEnd {};

TEST_F(HostsTest, ObserverConvergesAcrossHostsWithTenPercentLoss) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root for network namespaces";
  const TwoHosts hosts;
  if (!hosts.refused.empty()) GTEST_SKIP() << "not permitted or not installed: " << hosts.refused;
  const std::string between = "udpm://239.255.76.67:7667?ttl=1";
  const Arguments common{scene("paper_beam"), "--duration", "60",   "--tick",
                         "0.015625",          "--url",      between};
  const Arguments on_a{"ip", "netns", "exec", hosts.a};
  const Arguments on_b{"ip", "netns", "exec", hosts.b};
  Process& observer =
      start_command(on_b + Arguments{OBSERVER} + common +
                    Arguments{"--states", file("live.csv"), "--report", file("o.json")});
  ASSERT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  Process& master = start_command(on_a + Arguments{MASTER_SIM} + common +
                                  Arguments{"--speed", "15", "--events", file("events.csv")});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  const nlohmann::json report = json("o.json");
  EXPECT_GT(report["messages"]["lost"], 10);
  EXPECT_EQ(report["lost_records"], 0);
  EXPECT_TRUE(text("live.csv") == read_text(replay(scene("paper_beam"), file("events.csv"),
                                                   {"--tick", "0.015625", "--duration", "60"})))
      << "live differs from the replay";
}

// ttl=0 means this host only, but liblcm would receive a packet that another host sends to the
// port.
TEST_F(HostsTest, TtlZeroRefusesPacketsOfOtherHosts) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root for network namespaces";
  const TwoHosts hosts;
  if (!hosts.refused.empty()) GTEST_SKIP() << "not permitted or not installed: " << hosts.refused;
  Process& observer = start_command(
      {"ip", "netns", "exec", hosts.b, OBSERVER, scene("paper_beam"), "--report", file("o.json")});
  ASSERT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  Process& master =
      start_command({"ip", "netns", "exec", hosts.a, MASTER_SIM, scene("paper_beam"), "--duration",
                     "20", "--speed", "20", "--url", "udpm://239.255.76.67:7667?ttl=1"});
  EXPECT_EQ(end_of(master).code, 0);
  observer.signal(SIGTERM);
  EXPECT_EQ(end_of(observer).code, 0);
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["sessions"], 0);
  EXPECT_GT(report["messages"]["refused"]["other_host"], 50);
}

}  // namespace
}  // namespace sprag::test
