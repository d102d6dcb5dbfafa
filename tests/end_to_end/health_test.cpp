// SPRAG_HEALTH of a live observer against the report of the same run.
#include <algorithm>
#include <csignal>
#include <map>
#include <optional>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/key.h"
#include "lcmtypes/messages.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

using namespace std::chrono_literals;
using enum MasterState;

nlohmann::json refused_of(const health_t& health) {
  nlohmann::json refused = nlohmann::json::object();
  for (std::size_t i = 0; i < health.cause.size(); ++i) {
    refused[health.cause[i]] = health.refused[i];
  }
  return refused;
}

class HealthTest : public EndToEnd {
 protected:
  std::string key_file(const std::string& name, char digit) {
    std::string key(64, digit);
    key += '\n';
    return write_text(file(name), key);
  }

  void listen(std::optional<Key> key = std::nullopt) {
    bus_.emplace(url(), std::move(key));
    bus_->subscribe(health_channel,
                    [this](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
                      health_t health{};
                      EXPECT_EQ(decode(data, health), Refusal::none);
                      received_[health.utime] = health;  // the last one is repeated
                    });
  }

  /// The newest message, after all that have arrived are received.
  health_t latest() {
    while (bus_->handle(1ms) > 0) continue;
    return received_.empty() ? health_t{} : received_.rbegin()->second;
  }

  bool comes_to(MasterState state) {
    return in_time([&] { return MasterState{latest().master} == state; });
  }

  std::optional<Bus> bus_;
  std::map<std::int64_t, health_t> received_;
};

TEST_F(HealthTest, EqualsTheReport) {
  const std::string key = key_file("key", 'a');
  listen(Key(std::filesystem::path(key)));
  const Arguments common{scene("paper_beam"), "--duration", "20", "--tick",
                         "0.015625",          "--key",      key};
  Process& observer = start_listening("observer", common + Arguments{"--report", file("o.json")});
  ASSERT_TRUE(in_time([&] { return latest().utime != 0; }));
  const health_t before = latest();
  EXPECT_EQ(MasterState{before.master}, awaited);
  EXPECT_EQ(EstimateSource{before.estimate}, EstimateSource::none);
  EXPECT_EQ(before.tick, -1);
  EXPECT_EQ(before.t, -1.0);
  EXPECT_EQ(before.session, 0);
  EXPECT_EQ(before.speed, 0.0);
  EXPECT_EQ(before.real_time_factor, 0.0);
  EXPECT_GE(before.period, 1.0);
  EXPECT_TRUE(before.refused.empty());

  // Senders without a key, with another key, and with another machine.
  ContactMessage message;
  message.contacts = 3;
  std::vector<std::uint8_t> three;
  encode(message, three);
  Bus unsigned_bus(url());
  Bus forger(url(), Key(std::filesystem::path(key_file("no", 'b'))));
  Bus other(url(), Key(std::filesystem::path(key)));
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(unsigned_bus.publish(contacts_channel, three));
    EXPECT_TRUE(forger.publish(contacts_channel, three));
    EXPECT_TRUE(other.publish(contacts_channel, three));
    EXPECT_TRUE(other.publish(contacts_channel, std::span(three).first(100)));
  }
  const nlohmann::json expected{{"unauthenticated", 10}, {"other_machine", 5}, {"truncated", 5}};
  EXPECT_TRUE(in_time([&] { return refused_of(latest()) == expected; })) << refused_of(latest());
  EXPECT_EQ(MasterState{latest().master}, awaited);

  Process& master = start_master(common + Arguments{"--speed", "6"});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  ASSERT_TRUE(in_time([&] { return latest().last == 1; }));

  std::vector<health_t> all;
  for (const auto& [utime, health] : received_) all.push_back(health);
  ASSERT_GT(all.size(), 4U);
  const health_t& last = all.back();
  const nlohmann::json report = json("o.json");
  const nlohmann::json& messages = report["messages"];
  EXPECT_EQ(refused_of(last), messages["refused"]);
  EXPECT_EQ(last.ticks, report["ticks"]);
  EXPECT_EQ(last.ticks, 1281);
  EXPECT_EQ(last.tick, 1280);
  EXPECT_EQ(last.t, 20.0);
  EXPECT_EQ(last.deadlines, report["ticks_with_deadline"]);
  EXPECT_EQ(last.missed_deadlines, report["missed_deadlines"]);
  EXPECT_EQ(last.real_time_losses, report["real_time"]["losses"]);
  EXPECT_EQ(last.events, report["events"]);
  EXPECT_GT(last.events, 20);
  EXPECT_EQ(last.late_events, report["late_events"]);
  EXPECT_EQ(last.lost_events, report["lost_records"]);
  EXPECT_EQ(last.gaps, report["degraded"].size());
  EXPECT_EQ(last.skipped_events, 0);
  EXPECT_EQ(last.rollbacks, report["rollbacks"]["count"]);
  EXPECT_EQ(last.inconsistencies, report["confidence"]["inconsistencies"]);
  EXPECT_EQ(last.messages, messages["received"]);
  EXPECT_GT(last.messages, 100);
  EXPECT_EQ(last.lost_messages, messages["lost"]);
  EXPECT_EQ(last.doubled_messages, messages["doubled"]);
  EXPECT_EQ(last.reordered_messages, messages["reordered"]);
  EXPECT_EQ(last.other_masters, messages["of_other_masters"]);
  EXPECT_EQ(last.stale, messages["stale"]);
  EXPECT_EQ(last.overflowed, messages["overflowed"]);
  EXPECT_EQ(last.unsent, messages["unsent"]);
  EXPECT_EQ(last.sessions, 1);

  // The figures of single seconds add up to the total.
  double simulated = 0.0, longest_latency = 0.0, greatest_lateness = 0.0;
  std::int64_t latencies = 0;
  bool paced = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const health_t& health = all[i];
    SCOPED_TRACE(i);
    EXPECT_EQ(health.last == 1, i + 1 == all.size());
    EXPECT_LE(health.latency_p50, health.latency_p99);
    EXPECT_LE(health.latency_p99, health.latency_max);
    simulated += health.real_time_factor * health.period;
    latencies += health.latencies;
    longest_latency = std::max(longest_latency, health.latency_max);
    greatest_lateness = std::max(greatest_lateness, health.lateness_max);
    if (MasterState{health.master} == received) {
      paced = true;
      EXPECT_EQ(health.speed, 6.0);
      EXPECT_NE(EstimateSource{health.estimate}, EstimateSource::none);
      EXPECT_NE(EstimateSource{health.estimate}, EstimateSource::adaptive);
    }
    if (i > 0) {
      EXPECT_GE(health.events, all[i - 1].events);
      EXPECT_GE(health.messages, all[i - 1].messages);
      EXPECT_GE(health.tick, all[i - 1].tick);
    }
  }
  EXPECT_TRUE(paced);
  EXPECT_NEAR(simulated, 1281 * 0.015625, 1e-9);
  EXPECT_EQ(latencies, report["event_latency_s"]["count"]);
  EXPECT_DOUBLE_EQ(longest_latency, report["event_latency_s"]["max"]);
  EXPECT_DOUBLE_EQ(greatest_lateness, report["lateness_s"]["max"]);
}

TEST_F(HealthTest, ReportsStateOfTheMaster) {
  listen();
  Process& observer = start_listening(
      "observer", {scene("paper_beam"), "--tick", "0.015625", "--estimator", "replica"});
  EXPECT_TRUE(comes_to(awaited));
  Process& killed = start_master({scene("paper_beam"), "--tick", "0.015625"});
  EXPECT_TRUE(comes_to(received));
  const std::int64_t first = latest().session;
  killed.signal(SIGKILL);
  EXPECT_TRUE(comes_to(silent));
  const health_t alone = latest();
  EXPECT_EQ(alone.session, first);
  EXPECT_EQ(EstimateSource{alone.estimate}, EstimateSource::replica);
  // Without a master no message is late, and the estimate continues.
  EXPECT_TRUE(in_time([&] { return latest().tick > alone.tick + 32; }));
  Process& next = start_master({scene("paper_beam"), "--duration", "6", "--speed", "3"});
  EXPECT_TRUE(comes_to(received));
  EXPECT_EQ(latest().sessions, 2);
  EXPECT_NE(observer.err().find("new session"), std::string::npos) << observer.err();
  EXPECT_NE(latest().session, first);
  EXPECT_EQ(latest().speed, 3.0);
  EXPECT_TRUE(comes_to(ended));
  EXPECT_EQ(end_of(next).code, 0);
  EXPECT_EQ(latest().last, 0);
  observer.signal(SIGTERM);
  EXPECT_EQ(end_of(observer).code, 0);
  EXPECT_TRUE(in_time([&] { return latest().last == 1; }));
  EXPECT_EQ(MasterState{latest().master}, ended);
}

}  // namespace
}  // namespace sprag::test
