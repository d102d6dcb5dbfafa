// A live observer of an abnormal machine: it neither ends, nor stops listening, nor gives wrong
// estimates without a message.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <functional>
#include <sprag/contacts_t.hpp>

#include "lcmtypes/messages.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/end_to_end/fixture.h"
#include "tests/end_to_end/played_master.h"

namespace sprag::test {
namespace {

using enum ContactEventKind;

class LiveTroubleTest : public EndToEnd {
 protected:
  Process& start_observer(const std::string& machine, const Arguments& more = {}) {
    return start_listening(
        "observer",
        Arguments{machine, "--states", file("live.csv"), "--report", file("o.json")} + more);
  }

  bool says(const Process& observer, const std::string& words) {
    return in_time([&] { return observer.err().find(words) != std::string::npos; });
  }

  /// A recorder beside the observer; the live run must equal the replay of the recording.
  void start_recorder() {
    recorder_ = &EndToEnd::start_recorder(file("run.lcmlog"), "SPRAG_CONTACTS");
  }
  void expect_live_as_replay(const std::string& machine, const Arguments& more = {}) {
    end_recorder(*recorder_);
    const std::string offline = read_text(replay(machine, file("run.lcmlog"), more));
    const std::string live = text("live.csv");
    EXPECT_GT(std::ranges::count(live, '\n'), 100);
    EXPECT_TRUE(live == offline) << "live differs from the replay";
  }

  /// Waits until the observer has received everything, then ends it.
  Ended finish(Process& observer) {
    std::this_thread::sleep_for(300ms);
    observer.signal(SIGTERM);
    return end_of(observer);
  }

  Process* recorder_ = nullptr;
};

TEST_F(LiveTroubleTest, SkippedEventsAreReportedAtOnceAndCountAsGap) {
  start_recorder();
  Process& observer = start_observer(scene("paper_beam"));
  PlayedMaster master(url(), 1);
  master.play_until(1.0);
  master.add(std::vector<ContactEvent>{{0.9, 0, pulse}});  // before the declared watermark
  master.play_until(1.3);
  EXPECT_TRUE(says(observer, "event of contact 1 at t = 0.9 skipped: not after")) << observer.err();
  master.add(std::vector<ContactEvent>{{1.4, 0, closes}, {1.5, 0, pulse}});
  master.play_until(2.0);
  EXPECT_TRUE(says(observer, "event of contact 1 at t = 1.5 skipped: it closes while closed"));
  master.send_spoilt([](ContactMessage& report) {
    report.record[static_cast<std::size_t>(report.records++)] = {report.horizon + 1.0, 0, opens};
    ++report.records_total;
  });
  EXPECT_TRUE(says(observer, "skipped: later than its own message's horizon"));
  finish(observer);
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["skipped"]["backwards"], 1);
  EXPECT_EQ(report["skipped"]["contradicting"], 1);
  EXPECT_EQ(report["skipped"]["beyond_horizon"], 1);
  ASSERT_GE(report["degraded"].size(), 1U);
  EXPECT_GE(report["degraded"][0]["from"], 0.9);
  EXPECT_LT(report["degraded"][0]["from"], 1.6);
  EXPECT_TRUE(report["confidence"]["bound"]["final"].is_number());
  expect_live_as_replay(scene("paper_beam"));
}

TEST_F(LiveTroubleTest, RefusedMessagesAreReported) {
  Process& observer = start_observer(scene("paper_beam"));
  EXPECT_TRUE(says(observer, "waiting for a master"));
  const std::size_t before = observer.err().size();
  PlayedMaster two(url(), 2);
  two.play_for(1.2);
  EXPECT_TRUE(says(observer, "message refused: its machine has 2 contacts, the scene 1"));
  PlayedMaster master(url(), 1);
  const auto spoilt = [&](const auto& spoil, const std::string& words) {
    master.send_spoilt(spoil);
    EXPECT_TRUE(says(observer, words)) << words;
  };
  spoilt(
      [](ContactMessage& r) {
        r.record[0] = {0.0, 0, static_cast<ContactEventKind>(9)};
        r.records = 1;
        r.records_total = 1;
      },
      "kind is not 1, 2 or 3");
  contacts_t foreign{};
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(foreign.getEncodedSize()));
  foreign.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  bytes[0] ^= 1U;
  Bus bus(url());
  (void)bus.publish(contacts_channel, bytes);
  EXPECT_TRUE(says(observer, "not of type sprag.contacts_t"));
  bytes[0] ^= 1U;
  bytes.resize(bytes.size() + Key::tag_size);
  (void)bus.publish(contacts_channel, bytes);
  EXPECT_TRUE(says(observer, "a signed one needs --key"));
  // Its message number does not change.
  master.play_for(0.2);
  const std::int64_t number = master.last().sequence;
  const auto until = std::chrono::steady_clock::now() + 1500ms;
  while (std::chrono::steady_clock::now() < until) {
    master.send_spoilt([&](ContactMessage& report) { report.sequence = number; });
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_TRUE(says(observer, "`sequence` must rise by one"));
  const Ended ended = finish(observer);
  EXPECT_EQ(ended.err.find("waiting for a master", before), std::string::npos) << ended.err;
  EXPECT_EQ(ended.err.find("is silent"), std::string::npos) << ended.err;
}

TEST_F(LiveTroubleTest, WrongKeyAndWrongClockAreReported) {
  std::ofstream(file("key")) << std::string(64, 'a') << '\n';
  std::ofstream(file("other")) << std::string(64, 'b') << '\n';
  Process& observer = start_observer(scene("paper_beam"), {"--key", file("key")});
  PlayedMaster stranger(url(), 1, 1.0, 0.0, Key(file("other")));
  stranger.play_for(0.1);
  EXPECT_TRUE(says(observer, "not signed with this key"));
  PlayedMaster master(url(), 1, 1.0, 0.0, Key(file("key")));
  for (int i = 0; i < 5; ++i) {
    master.send_spoilt([](ContactMessage& report) { report.utime -= 15'000'000; });
  }
  EXPECT_TRUE(says(observer, "this message is 15"));
  EXPECT_EQ(finish(observer).code, 0);
  EXPECT_EQ(json("o.json")["sessions"], 0);
}

// A machine's clock may start at any time, and be set.
TEST_F(LiveTroubleTest, AnyClockIsFollowedAndItsStepsAreReported) {
  constexpr double start = 1.7e9;
  start_recorder();
  Process& observer = start_observer(scene("paper_beam"), {"--tick", "0.01"});
  PlayedMaster master(url(), 1, 1.0, start);
  master.add(std::vector<ContactEvent>{{start + 0.3, 0, pulse}, {start + 0.55, 0, pulse}});
  double end = 0.0;
  for (const double step : {0.0, 1e6, -3.0}) {
    master.step_clock(step);
    end = master.now() + 0.8;
    master.play_until(end);
  }
  EXPECT_TRUE(says(observer, "have jumped from t = "));
  const Ended ended = finish(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.err.find("observing from t = "), std::string::npos);
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["events"], 2);
  EXPECT_EQ(report["messages"]["resumed"], 2);
  EXPECT_LT(report["unsettled_ticks"], 500);  // the present tick has followed, too
  EXPECT_GT(report["ticks_with_deadline"], 100);
  EXPECT_EQ(report["sessions"], 1);
  const std::vector<double> t = read_column(file("live.csv"), "t");
  ASSERT_FALSE(t.empty());
  EXPECT_NEAR(t.front(), start, 0.3);
  EXPECT_NEAR(t.back(), end, 0.05);
  expect_live_as_replay(scene("paper_beam"), {"--tick", "0.01"});
}

TEST_F(LiveTroubleTest, ImplausibleMessagesDoNotAffectLaterOnes) {
  const Arguments how{"--duration", "4", "--tick", "0.015625"};
  const std::string events = simulate(scene("paper_beam"), "4", "0.1");
  Process& observer = start_observer(scene("paper_beam"), how);
  PlayedMaster master(url(), 1, 2.0);
  master.add(read_events(events, 1).events);
  double t = 0.8;
  master.play_until(t);
  const std::initializer_list<std::function<void(ContactMessage&)>> oddities{
      [&](ContactMessage& r) { r.speed = infinity; }, [&](ContactMessage& r) { r.horizon = 1e300; },
      [&](ContactMessage& r) { r.horizon = 1e5; },
      [&](ContactMessage& r) { r.records_total = std::int64_t{1} << 53; },
      [&](ContactMessage& r) { r.sequence = std::int64_t{1} << 40; }};
  for (const auto& oddity : oddities) {
    master.send_spoilt(oddity);
    master.play_until(t += 0.6);
  }
  master.play_until(4.0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(json("o.json")["messages"]["refused"]["implausible"], oddities.size());
  EXPECT_NE(ended.err.find("message refused: its horizon t = "), std::string::npos) << ended.err;
  EXPECT_TRUE(text("live.csv") == read_text(replay(scene("paper_beam"), events, how)))
      << "live differs from the replay";
}

TEST_F(LiveTroubleTest, EndOfRunIsNotCountedAsSilenceOrMissedDeadlines) {
  Process& observer = start_observer(scene("paper_beam"), {"--tick", "0.01"});
  Process& master = start_master({scene("paper_beam"), "--duration", "2", "--tick", "0.01"});
  EXPECT_EQ(end_of(master).code, 0);
  std::this_thread::sleep_for(1500ms);
  const Ended ended = finish(observer);
  EXPECT_EQ(ended.err.find("is silent"), std::string::npos) << ended.err;
  EXPECT_EQ(ended.err.find("real time lost"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("its run is over"), std::string::npos) << ended.err;
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["settled_tick"], 200);
  EXPECT_LT(report["ticks_with_deadline"], 220);
}

/// Estimates received over the bus.
class AtOnceTest : public LiveTroubleTest {
 protected:
  void SetUp() override {
    LiveTroubleTest::SetUp();
    bus_.emplace(url());
    bus_->subscribe(estimate_channel,
                    [this](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
                      estimate_t estimate{};
                      if (decode(data, estimate) == Refusal::none) estimates_.push_back(estimate);
                    });
  }

  bool comes(std::int64_t tick, ContactSet closed, std::chrono::milliseconds timeout) {
    return eventually(
        [&] {
          bus_->handle(1ms);
          return std::ranges::any_of(estimates_, [&](const estimate_t& estimate) {
            return estimate.tick == tick && static_cast<ContactSet>(estimate.closed) == closed;
          });
        },
        timeout);
  }

  std::optional<Bus> bus_;
  std::vector<estimate_t> estimates_;
};

TEST_F(AtOnceTest, EventIsPublishedBeforeNextTickIsDue) {
  start_observer(scene("paper_beam"), {"--tick", "4"});
  PlayedMaster master(url(), 1);
  master.add(std::vector<ContactEvent>{{0.2, 0, closes}});
  master.play_until(0.3);
  EXPECT_TRUE(comes(1, 1, 2s)) << "no estimate of the event's tick, which is due in 3.7 s";
}

TEST_F(AtOnceTest, LateEventCorrectsLastTickAtOnce) {
  start_observer(scene("paper_beam"), {"--tick", "4"});
  PlayedMaster master(url(), 1, 4.0);
  master.play_until(3.0);
  EXPECT_TRUE(comes(1, 0, 5s));
  while (master.now() < 5.0) std::this_thread::sleep_for(10ms);
  master.add(std::vector<ContactEvent>{{3.5, 0, closes}});
  estimates_.clear();
  master.play_until(3.6);
  EXPECT_TRUE(comes(1, 1, 500ms)) << "tick 1 was not corrected";
}

}  // namespace
}  // namespace sprag::test
