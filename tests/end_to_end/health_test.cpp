// SPRAG_HEALTH of a live observer against the report of the same run.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>
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

/// Receives SPRAG_HEALTH in its own thread.
class HealthListener {
 public:
  HealthListener(const std::string& url, std::optional<Key> key) : bus_(url, std::move(key)) {
    bus_.subscribe(health_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                          std::int64_t) { receive(data); });
    thread_ = std::thread([this] {
      while (!stop_) bus_.handle(20ms);
    });
  }
  ~HealthListener() {
    stop_ = true;
    thread_.join();
  }
  HealthListener(const HealthListener&) = delete;
  HealthListener& operator=(const HealthListener&) = delete;

  /// All messages so far, each once: the last one is repeated.
  std::vector<health_t> distinct_messages() const {
    const std::lock_guard lock(mutex_);
    std::vector<health_t> all;
    for (const auto& [utime, health] : received_) all.push_back(health);
    return all;
  }
  health_t latest() const {
    const std::lock_guard lock(mutex_);
    return received_.empty() ? health_t{} : received_.rbegin()->second;
  }
  int refused() const { return refused_; }

 private:
  void receive(std::span<const std::uint8_t> data) {
    health_t health{};
    if (decode(data, health) != Refusal::none) {
      ++refused_;
      return;
    }
    const std::lock_guard lock(mutex_);
    received_[health.utime] = health;
  }

  Bus bus_;
  mutable std::mutex mutex_;
  std::map<std::int64_t, health_t> received_;
  std::atomic<int> refused_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

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
    std::ofstream(file(name)) << std::string(64, digit) << '\n';
    return file(name);
  }
};

TEST_F(HealthTest, EqualsTheReport) {
  const std::string key = key_file("key", 'a');
  const HealthListener listener(url(), Key(std::filesystem::path(key)));
  const Arguments common{scene("paper_beam"), "--duration", "20", "--tick",
                         "0.015625",          "--key",      key};
  Process& observer = start_listening("observer", common + Arguments{"--report", file("o.json")});
  ASSERT_TRUE(in_time([&] { return !listener.distinct_messages().empty(); }));
  const health_t before = listener.latest();
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
  EXPECT_TRUE(in_time([&] { return refused_of(listener.latest()) == expected; }))
      << refused_of(listener.latest());
  EXPECT_EQ(MasterState{listener.latest().master}, awaited);

  Process& master = start_master(common + Arguments{"--speed", "6"});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  ASSERT_TRUE(in_time([&] { return listener.latest().last == 1; }));

  const std::vector<health_t> all = listener.distinct_messages();
  EXPECT_EQ(listener.refused(), 0);
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
  const HealthListener listener(url(), std::nullopt);
  const auto comes_to = [&](MasterState state) {
    return in_time([&] { return MasterState{listener.latest().master} == state; });
  };
  Process& observer = start_listening(
      "observer", {scene("paper_beam"), "--tick", "0.015625", "--estimator", "replica"});
  EXPECT_TRUE(comes_to(awaited));
  Process& killed = start_master({scene("paper_beam"), "--tick", "0.015625"});
  EXPECT_TRUE(comes_to(received));
  const std::int64_t first = listener.latest().session;
  killed.signal(SIGKILL);
  EXPECT_TRUE(comes_to(silent));
  const health_t alone = listener.latest();
  EXPECT_EQ(alone.session, first);
  EXPECT_EQ(EstimateSource{alone.estimate}, EstimateSource::replica);
  // Without a master no message is late, and the estimate continues.
  EXPECT_TRUE(in_time([&] { return listener.latest().tick > alone.tick + 32; }));
  Process& next = start_master({scene("paper_beam"), "--duration", "6", "--speed", "3"});
  EXPECT_TRUE(comes_to(received));
  EXPECT_EQ(listener.latest().sessions, 2);
  EXPECT_NE(listener.latest().session, first);
  EXPECT_EQ(listener.latest().speed, 3.0);
  EXPECT_TRUE(comes_to(ended));
  EXPECT_EQ(end_of(next).code, 0);
  EXPECT_EQ(listener.latest().last, 0);
  observer.signal(SIGTERM);
  EXPECT_EQ(end_of(observer).code, 0);
  EXPECT_TRUE(in_time([&] { return listener.latest().last == 1; }));
  EXPECT_EQ(MasterState{listener.latest().master}, ended);
}

}  // namespace
}  // namespace sprag::test
