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
    EXPECT_TRUE(live == offline) << "live differs from the replay: " << difference(live, offline);
  }

  /// The first line in which two texts differ.
  static std::string difference(const std::string& one, const std::string& other) {
    const auto [a, b] = std::ranges::mismatch(one, other);
    const auto line = [](const std::string& text, auto at) {
      const auto from = static_cast<std::size_t>(at - text.begin());
      const std::size_t begin = from == 0 ? 0 : text.rfind('\n', from - 1) + 1;
      return text.substr(begin, text.find('\n', from) - begin);
    };
    return "line " + std::to_string(std::count(one.begin(), a, '\n') + 1) + ": " + line(one, a) +
           " | " + line(other, b);
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

TEST_F(LiveTroubleTest, MachineClockMayStartAtAnyTime) {
  constexpr double start = 1.7e9;
  start_recorder();
  Process& observer = start_observer(scene("paper_beam"));
  PlayedMaster master(url(), 1, 1.0, start);
  master.add(std::vector<ContactEvent>{{start + 0.5, 0, pulse}, {start + 1.25, 0, pulse}});
  master.play_until(start + 2.0);
  const Ended ended = finish(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.err.find("observing from t = "), std::string::npos);
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["events"], 2);
  EXPECT_EQ(report["sessions"], 1);
  const std::vector<StateLine> rows = read_states_file(file("live.csv"));
  ASSERT_FALSE(rows.empty());
  EXPECT_GT(rows.front().t, start);
  EXPECT_LT(rows.front().t, start + 0.3);
  EXPECT_NEAR(rows.back().t, start + 2.0, 2e-3);
  EXPECT_GT(report["ticks_with_deadline"], 1500);
  expect_live_as_replay(scene("paper_beam"));
}

class ClockStepTest : public LiveTroubleTest, public testing::WithParamInterface<double> {};

TEST_P(ClockStepTest, IsFollowedWithinOneSecondAndReported) {
  const double step = GetParam();
  start_recorder();
  Process& observer = start_observer(scene("paper_beam"), {"--tick", "0.01"});
  PlayedMaster master(url(), 1, 1.0, 40.0);
  master.play_for(1.0);
  master.step_clock(step);
  const double stepped = master.now();
  master.play_for(1.0);
  EXPECT_TRUE(says(observer, "have jumped from t = "));
  const Ended ended = finish(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(json("o.json")["messages"]["resumed"], 1);
  EXPECT_LT(json("o.json")["unsettled_ticks"], 500);  // the present tick has followed, too
  EXPECT_EQ(json("o.json")["sessions"], 1);
  const std::string live = text("live.csv");
  const std::string last = live.substr(live.rfind('\n', live.size() - 2) + 1);
  EXPECT_NEAR(std::atof(last.c_str() + last.find(',') + 1), stepped + 1.0, 0.05) << last;
  expect_live_as_replay(scene("paper_beam"), {"--tick", "0.01"});
}

INSTANTIATE_TEST_SUITE_P(Steps, ClockStepTest, testing::Values(-3.0, 1e6), [](const auto& step) {
  return std::string(step.param < 0.0 ? "Back" : "Ahead") +
         std::to_string(std::abs(static_cast<int>(step.param)));
});

// The messages after an invalid one are received as if there had been none.
TEST_F(LiveTroubleTest, ImplausibleMessagesDoNotAffectLaterOnes) {
  const std::string events = simulate(scene("paper_beam"), "8", "0.1");
  const std::vector<ContactEvent> of_beam = read_events(events, 1).events;
  Process& observer =
      start_observer(scene("paper_beam"), {"--duration", "8", "--tick", "0.015625"});
  PlayedMaster master(url(), 1, 2.0);
  master.add(of_beam);
  master.play_until(1.0);
  const std::initializer_list<std::function<void(ContactMessage&)>> oddities{
      [&](ContactMessage& r) { r.speed = 1e300; },
      [&](ContactMessage& r) { r.speed = infinity; },
      [&](ContactMessage& r) { r.horizon = 1e300; },
      [&](ContactMessage& r) { r.horizon = 1e5; },
      [&](ContactMessage& r) { r.records_total = std::int64_t{1} << 53; },
      [&](ContactMessage& r) { r.sequence = std::int64_t{1} << 53; },
      [&](ContactMessage& r) { r.sequence = std::int64_t{1} << 40; }};
  double t = 1.0;
  for (const auto& oddity : oddities) {
    master.send_spoilt(oddity);
    master.play_until(t += 0.9);
  }
  master.play_until(8.0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(json("o.json")["messages"]["refused"]["implausible"], oddities.size());
  EXPECT_NE(ended.err.find("message refused: its horizon t = "), std::string::npos) << ended.err;
  EXPECT_TRUE(text("live.csv") == read_text(replay(scene("paper_beam"), events,
                                                   {"--tick", "0.015625", "--duration", "8"})))
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
