// Would catch rows paired from different instants, uncounted losses, and an incomplete recording
// without a report.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tests/support/random.h"
#include "tests/support/udp_url.h"
#include "tools/sync_logger/live.h"
#include "tools/sync_logger/logger.h"
#include "tools/sync_logger/losses.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;
using test::read_text;
using test::operator+;  // NOLINT(misc-unused-using-decls): used by operators
using test::write_text;

/// V = (u1^2 + 2 u2^2 + 3 q1^2 + 4 q2^2) / 2.
constexpr const char* two_masses_scene = R"(
system = { M = [[1, 0], [0, 2]], C = [[0, 0], [0, 0]], K = [[3, 0], [0, 4]] }
impact = { restitution = 0.5 }
contact = [{ direction = [1, 0], clearance = 100 }]
master = {}
replica = {}
)";

Model two_masses() { return parse_scene(two_masses_scene, "two_masses.toml").model; }

template <class Message>
Message message(std::int64_t tick, double t, double q1, std::int64_t session) {
  Message result{};
  result.session = session;
  result.tick = tick;
  result.t = t;
  result.f = 2;
  result.q = {q1, 0.0};
  result.u = {0.0, 0.0};
  return result;
}

state_t truth(std::int64_t tick, double t, double q1 = 0.0, std::int64_t session = 1) {
  return message<state_t>(tick, t, q1, session);
}

estimate_t estimate(std::int64_t tick, double t, double q1 = 0.0, std::int64_t session = 1) {
  return message<estimate_t>(tick, t, q1, session);
}

TEST(PairingTest, RowIsWrittenAtSecondSampleOfPair) {
  Pairing pairing(two_masses());
  EXPECT_EQ(pairing.add_truth(truth(0, 0.0, 2.0)), nullptr);
  const SyncRow* row = pairing.add_estimate(estimate(0, 0.0, 1.0));
  ASSERT_NE(row, nullptr);
  EXPECT_EQ(row->energy, Eigen::Vector3d(1.5, 1.5, 0.0));
  EXPECT_EQ(pairing.add_estimate(estimate(1, 0.1)), nullptr);
  row = pairing.add_truth(truth(1, 0.1, 2.0));
  ASSERT_NE(row, nullptr);
  EXPECT_EQ(row->k, 1);
  EXPECT_EQ(row->energy[0], 6.0);
  EXPECT_EQ(pairing.waiting_truth() + pairing.waiting_estimate(), 0U);
}

TEST(PairingTest, SameInstantIsWithinRelativeBillionth) {
  Pairing pairing(two_masses());
  pairing.add_truth(truth(1, 1.0));
  EXPECT_EQ(pairing.add_estimate(estimate(1, 1.0 + 3e-9)), nullptr);
  EXPECT_NE(pairing.add_estimate(estimate(1, 1.0 - 0.9e-9)), nullptr);
}

TEST(PairingTest, ReplicaMayHaveFewerModes) {
  Pairing pairing(two_masses());
  state_t state = truth(0, 0.0);
  state.u = {0.0, 3.0};
  pairing.add_truth(state);
  estimate_t smaller = estimate(0, 0.0);
  smaller.f = 1;
  smaller.q = smaller.u = {0.0};
  const SyncRow* row = pairing.add_estimate(smaller);
  ASSERT_NE(row, nullptr);
  EXPECT_EQ(row->energy, Eigen::Vector3d(9.0, 0.0, 9.0));
}

TEST(PairingTest, WrongSizesAreRefusedAndCounted) {
  Pairing pairing(two_masses());
  state_t smaller = truth(0, 0.0);
  smaller.f = 1;
  smaller.q = smaller.u = {0.0};
  EXPECT_EQ(pairing.add_truth(smaller), nullptr);
  estimate_t larger = estimate(0, 0.0);
  larger.f = 3;
  larger.q = larger.u = {0.0, 0.0, 0.0};
  EXPECT_EQ(pairing.add_estimate(larger), nullptr);
  EXPECT_EQ(pairing.figures().wrong_truth_size, 1);
  EXPECT_EQ(pairing.figures().wrong_estimate_size, 1);
  EXPECT_EQ(pairing.waiting_truth() + pairing.waiting_estimate(), 0U);
}

TEST(PairingTest, DoubledAndLateSamplesGiveNoRow) {
  Pairing pairing(two_masses());
  pairing.add_truth(truth(0, 0.0));
  pairing.add_truth(truth(0, 0.0));
  EXPECT_EQ(pairing.figures().doubled, 1);
  EXPECT_NE(pairing.add_estimate(estimate(0, 0.0)), nullptr);
  EXPECT_EQ(pairing.add_estimate(estimate(0, 0.0)), nullptr);
  EXPECT_EQ(pairing.add_truth(truth(0, 0.0)), nullptr);
  EXPECT_EQ(pairing.figures().late, 2);
  EXPECT_EQ(pairing.figures().rows, 1);
}

TEST(PairingTest, NewSessionReplacesOldOne) {
  Pairing pairing(two_masses());
  pairing.add_truth(truth(50, 5.0, 0.0, 1));
  EXPECT_NE(pairing.add_estimate(estimate(50, 5.0, 1.0, 1)), nullptr);
  pairing.add_truth(truth(0, 0.0, 0.0, 2));
  EXPECT_EQ(pairing.add_estimate(estimate(0, 0.0, 0.0, 1)), nullptr);  // of the previous master
  EXPECT_EQ(pairing.add_truth(truth(51, 5.1, 0.0, 1)), nullptr);
  const SyncRow* row = pairing.add_estimate(estimate(0, 0.0, 4.0, 2));
  ASSERT_NE(row, nullptr);
  EXPECT_EQ(row->energy[0], 24.0);
  EXPECT_EQ(pairing.figures().sessions, 2);
  EXPECT_EQ(pairing.figures().old_session, 2);
  EXPECT_EQ(pairing.figures().max_growth, 0.0);  // V of two sessions is not compared
}

TEST(PairingTest, MemoryIsBounded) {
  Pairing pairing(two_masses(), 10);
  for (int k = 0; k < 1000; ++k) {
    pairing.add_truth(truth(k, k, 0.0, 1));
    pairing.add_estimate(estimate(k, k + 0.5, 0.0, 2));  // another session, then other instants
    pairing.add_estimate(estimate(k, k + 0.5, 0.0, 1));
  }
  EXPECT_EQ(pairing.waiting_truth(), 10U);
  EXPECT_EQ(pairing.waiting_estimate(), 20U);
  EXPECT_EQ(pairing.figures().unpaired_truth, 990);
  EXPECT_EQ(pairing.figures().unpaired_estimate, 1980);
}

TEST(PairingTest, FiguresReportLargestGrowthOfV) {
  Pairing pairing(two_masses());
  const double q[] = {4.0, 2.0, 3.0, 1.0, 1.5};
  for (int k = 0; k < 5; ++k) {
    pairing.add_truth(truth(k, k, q[k]));
    pairing.add_estimate(estimate(k, k));
  }
  EXPECT_EQ(pairing.figures().first_v, 24.0);
  EXPECT_EQ(pairing.figures().last_v, 3.375);
  EXPECT_EQ(pairing.figures().max_growth, 7.5);
  EXPECT_EQ(pairing.figures().max_growth_t, 2.0);
}

std::vector<std::vector<double>> read_rows(const std::filesystem::path& file) {
  std::istringstream lines(read_text(file));
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "k,t,V,V1,V2");
  std::vector<std::string_view> fields;
  while (std::getline(lines, line)) {
    split_fields(line, fields);
    rows.emplace_back();
    for (const std::string_view field : fields)
      rows.back().push_back(parse_double(field).value_or(NAN));
  }
  return rows;
}

class SyncLoggerTest : public test::ProgramTest {
 protected:
  nlohmann::json report() const { return test::parse_json(read_text(path("report.json"))); }

  std::string scene_ = write_text(directory_ / "scene.toml", two_masses_scene).string();
};

class OfflineTest : public SyncLoggerTest {
 protected:
  void write_states(const std::string& name, int ticks, double step, double q1) const {
    StatesWriter writer(path(name), 2);
    for (int k = 0; k <= ticks; ++k)
      writer.write(k, k * step, Eigen::Vector2d(q1, 0.0), Eigen::Vector2d::Zero());
    ASSERT_TRUE(writer.close());
  }

  std::string run_logger(int expected_code) {
    const Ended ended =
        run(SYNC_LOGGER, {scene_, "--truth", path("truth.csv"), "--estimate", path("estimate.csv"),
                          "--csv", path("sync.csv"), "--report", path("report.json")});
    EXPECT_EQ(ended.code, expected_code) << ended.err;
    return ended.err;
  }
};

TEST_F(OfflineTest, PairsTwoFilesOfDifferentSteps) {
  write_states("truth.csv", 1000, 0.001, 2.0);
  write_states("estimate.csv", 100, 0.01, 0.0);
  run_logger(0);
  const auto rows = read_rows(path("sync.csv"));
  ASSERT_EQ(rows.size(), 101U);
  for (std::size_t k = 0; k < rows.size(); ++k)
    EXPECT_EQ(rows[k], (std::vector<double>{double(k), double(k) * 0.01, 6.0, 6.0, 0.0}));
  EXPECT_EQ(report()["rows"], 101);
  EXPECT_EQ(report()["V"]["last"], 6.0);
  EXPECT_EQ(report()["unpaired"]["truth"], 900);
}

TEST_F(OfflineTest, DamagedFileIsReadUpToTheDamage) {
  write_states("truth.csv", 10, 0.1, 2.0);
  write_states("estimate.csv", 10, 0.1, 0.0);
  const std::string whole = read_text(path("estimate.csv"));
  write_text(path("estimate.csv"), whole.substr(0, whole.size() - 3));
  const std::string said = run_logger(1);
  EXPECT_NE(said.find("estimate.csv:12: truncated line"), std::string::npos) << said;
  EXPECT_EQ(read_rows(path("sync.csv")).size(), 10U);
  EXPECT_EQ(report()["damage"].size(), 1U);
}

TEST_F(OfflineTest, FilesThatDoNotFitAreBadInput) {
  write_states("truth.csv", 10, 0.1, 2.0);
  EXPECT_NE(run_logger(2).find("estimate.csv: No such file"), std::string::npos);
  for (const auto& [file, header, why] :
       {std::array{"estimate.csv", "k,t,q1,q2,u1,u2\n", "no time is in both"},
        std::array{"estimate.csv", "k,t,x\n", "header must be"},
        std::array{"estimate.csv", "k,t,q1,q2,q3,u1,u2,u3\n", "has 3 coordinates; the scene has 2"},
        std::array{"truth.csv", "k,t,q1,u1\n", "has 1 coordinates; the scene has 2"}}) {
    write_text(path(file), header);
    const std::string said = run_logger(2);
    EXPECT_NE(said.find(why), std::string::npos) << said;
  }
}

class LiveTest : public SyncLoggerTest {
 protected:
  /// Starts a logger that writes sync.csv and returns once it listens.
  void start(const test::Arguments& more, const std::string& of_url = "") {
    process_.emplace(test::Arguments{SYNC_LOGGER, scene_, "--url", url_ + of_url, "--report",
                                     path("report.json"), "--csv", path("sync.csv")} +
                         more,
                     directory_ / "", "logger");
    EXPECT_TRUE(says("listening"));
  }
  bool says(const std::string& text) {
    return test::eventually([&] { return process_->err().find(text) != std::string::npos; }, 60s);
  }
  /// The exit code, after a signal if one is given.
  std::optional<int> end(int signal = 0) {
    if (signal != 0) process_->signal(signal);
    return process_->wait(60s);
  }

  void publish(const char* channel, std::span<const std::uint8_t> bytes) {
    ASSERT_TRUE(bus_.publish(channel, bytes));
  }
  void publish_truth(const state_t& state) { publish(truth_channel, encode(state, buffer_)); }
  void publish_estimate(const char* channel, const estimate_t& of) {
    publish(channel, encode(of, buffer_));
  }
  /// Truth and settled estimate of tick k at k/10, with V = 1.5 q1^2.
  void publish_pair(int k, double q1, std::int64_t session = 1) {
    publish_truth(truth(k, 0.1 * k, q1, session));
    publish_estimate(settled_channel, estimate(k, 0.1 * k, 0.0, session));
  }

  std::optional<test::Process> process_;
  std::string url_ = test::udp_url();
  Bus bus_{url_};
  std::vector<std::uint8_t> buffer_;
};

TEST_F(LiveTest, EndsWithoutLastMessage) {
  start({"--duration", "1"});
  for (int k = 0; k <= 9; ++k) publish_pair(k, 2.0);
  publish_truth(truth(10, 1.0));
  EXPECT_EQ(end(), 0);
  EXPECT_TRUE(says("the last row did not come"));
  EXPECT_EQ(read_rows(path("sync.csv")).size(), 10U);
}

// States of the second master wait until the first is silent, those after --duration as well.
TEST_F(LiveTest, RestartedMasterIsReportedAndItsRowsFollowUpToTheDuration) {
  start({"--duration", "1"});
  for (int k = 0; k < 5; ++k) publish_pair(k, 2.0, 1);
  for (int k = 0; k <= 15; ++k) publish_pair(k, 4.0, 2);
  EXPECT_EQ(end(), 0);
  EXPECT_TRUE(says("new session"));
  const auto rows = read_rows(path("sync.csv"));
  ASSERT_EQ(rows.size(), 16U);
  EXPECT_EQ(rows[4][2], 6.0);
  EXPECT_EQ(rows[5], (std::vector<double>{0.0, 0.0, 24.0, 24.0, 0.0}));
  EXPECT_EQ(report()["sessions"], 2);
}

TEST_F(LiveTest, NowWritesTheProvisionalTicksNextToTheSettledOnes) {
  EXPECT_EQ(now_file("runs/a.csv"), "runs/a_now.csv");
  start({"--now", "--duration", "1"});
  for (int k = 0; k <= 10; ++k) {
    publish_estimate(estimate_channel, estimate(k, 0.1 * k, 7.0));
    // Corrected after a late event: the last estimate counts.
    publish_estimate(estimate_channel, estimate(k, 0.1 * k, 1.0));
    publish_pair(k, 2.0);
  }
  EXPECT_EQ(end(), 0);
  EXPECT_EQ(read_rows(path("sync.csv")).size(), 11U);
  const auto now = read_rows(path("sync_now.csv"));
  ASSERT_EQ(now.size(), 11U);
  EXPECT_EQ(now[3][2], 1.5);
  EXPECT_EQ(report()["now"]["rows"], 11);
}

TEST_F(LiveTest, RecordHoldsEveryChannelAsItArrived) {
  start({"--record", path("all.lcmlog"), "--duration", "0.1"});
  ContactMessage contacts;
  contacts.contacts = 1;
  std::vector<std::uint8_t> message;
  encode(contacts, message);
  publish(contacts_channel, message);
  publish_estimate(estimate_channel, estimate(0, 0.0));
  publish("SPRAG_OTHER", std::vector<std::uint8_t>{1, 2});
  publish("ELSEWHERE", std::vector<std::uint8_t>{1, 2});
  publish_pair(0, 1.0);
  publish_pair(1, 1.0);
  EXPECT_EQ(end(), 0);
  ChannelLogReader reader(path("all.lcmlog"));
  std::vector<std::string> channels;
  ChannelRecord record;
  while (reader.next(record)) {
    channels.push_back(record.channel);
    if (record.channel != contacts_channel) continue;
    EXPECT_TRUE(std::equal(message.begin(), message.end(), record.data.begin()));
  }
  EXPECT_TRUE(reader.damages().empty());
  EXPECT_EQ(channels, (std::vector<std::string>{contacts_channel, estimate_channel, "SPRAG_OTHER",
                                                truth_channel, settled_channel, truth_channel,
                                                settled_channel}));
}

// By a random plan: some numbers of three streams are lost, others are duplicated or late.
TEST(LossesTest, MissingNumbersAreCountedInAnyOrder) {
  Random random(20262);
  Losses losses;
  std::array<std::int64_t, 3> lost{};
  for (std::uint64_t sender = 1; sender <= 3; ++sender) {
    for (int channel = 0; channel < 3; ++channel) {
      std::vector<std::pair<double, std::int64_t>> arrivals;
      const int first = random.integer(0, 1000), last = first + 500;
      for (int n = first; n <= last; ++n) {
        const bool inner = n > first && n < last;
        if (inner && random.chance(0.1)) {
          ++lost[static_cast<std::size_t>(channel)];
          continue;
        }
        const double late = inner ? random.uniform(0.0, 60.0) : 0.0;
        arrivals.emplace_back(n == first ? -1.0 : n - first + late, n);
        if (random.chance(0.1)) arrivals.emplace_back(n - first + 61.0, n);
      }
      std::sort(arrivals.begin(), arrivals.end());
      for (const auto& [when, n] : arrivals) {
        losses.take(static_cast<Losses::Channel>(channel), sender, 7, n);
      }
    }
  }
  for (std::size_t channel = 0; channel < 3; ++channel) {
    EXPECT_EQ(losses.missing(static_cast<Losses::Channel>(channel)), lost[channel]);
  }
}

TEST(LossesTest, RestartIsNotALoss) {
  Losses losses;
  losses.take(Losses::Channel::settled, 1, 7, 100);
  losses.take(Losses::Channel::settled, 2, 7, 900);  // another observer of the same master
  losses.take(Losses::Channel::settled, 2, 8, 5);    // another master
  losses.take(Losses::Channel::settled, 2, 8, 6);
  EXPECT_EQ(losses.missing(Losses::Channel::settled), 0);
  EXPECT_EQ(describe(losses, 0), "");
  losses.take(Losses::Channel::settled, 2, 8, 8);
  EXPECT_EQ(describe(losses, 3), "3 packets at a full receive buffer, 1 tick of SPRAG_SETTLED");
  losses.take(Losses::Channel::settled, 2, 8, 1000000);  // the machine's clock has jumped
  EXPECT_EQ(losses.missing(Losses::Channel::settled), 1);
}

TEST(LossesTest, ForeignNumbersTakeNoMemoryAndDoNotOverflow) {
  Losses losses;
  constexpr std::int64_t most = std::numeric_limits<std::int64_t>::max();
  for (std::uint64_t sender = 0; sender < 1000; ++sender) {
    losses.take(Losses::Channel::truth, sender, 1, 0);
    losses.take(Losses::Channel::truth, sender, 1, most);
  }
  EXPECT_EQ(losses.missing(Losses::Channel::truth), most);
  for (std::int64_t n = 0; n < 100000; n += 2) losses.take(Losses::Channel::contacts, 1, 1, n);
  EXPECT_EQ(losses.missing(Losses::Channel::contacts), 49999);
}

TEST_F(LiveTest, IncompleteRecordingIsReportedAtOnceAndFails) {
  start({"--record", path("all.lcmlog")});
  for (int k = 0; k < 10; ++k) {
    ContactMessage contacts;
    contacts.session = 1;
    contacts.contacts = 1;
    contacts.sequence = k;
    std::vector<std::uint8_t> message;
    encode(contacts, message);
    if (k != 4) publish(contacts_channel, message);
    if (k < 4 || k > 5) publish_truth(truth(k, 0.1 * k, 1.0));
    if (k < 4 || k > 6) publish_estimate(settled_channel, estimate(k, 0.1 * k));
  }
  EXPECT_TRUE(says(std::string("lost on the way here: 1 message of ") + contacts_channel +
                   ", 3 ticks of " + settled_channel + ", 2 ticks of " + truth_channel + "; " +
                   path("all.lcmlog") + " is not complete\n"))
      << process_->err();
  EXPECT_EQ(end(SIGTERM), 1);
  EXPECT_EQ(report()["lost"][contacts_channel], 1);
  EXPECT_EQ(report()["lost"][truth_channel], 2);
  EXPECT_EQ(report()["lost"][settled_channel], 3);
}

// A buffer far too small, and a logger that does not read. Message numbers do not show losses after
// the last received message, but the kernel's counter does.
TEST_F(LiveTest, PacketsThatTheKernelDropsAreALossOfTheRecording) {
  start({"--record", path("all.lcmlog")}, "&recv_buf_size=20000");
  process_->signal(SIGSTOP);
  for (int i = 0; i < 500; ++i) publish("SPRAG_OTHER", std::vector<std::uint8_t>(1000));
  process_->signal(SIGCONT);
  EXPECT_TRUE(says("packets at a full receive buffer; " + path("all.lcmlog")));
  EXPECT_EQ(end(SIGTERM), 1) << process_->err();
  ChannelLogReader reader(path("all.lcmlog"));
  ChannelRecord record;
  std::int64_t recorded = 0;
  while (reader.next(record)) ++recorded;
  EXPECT_EQ(report()["overflowed"], 500 - recorded);
  EXPECT_LT(recorded, 500);
}

TEST_F(LiveTest, BadMessagesAreRefusedAndCounted) {
  start({"--duration", "0.1"});
  publish(truth_channel, std::vector<std::uint8_t>{1, 2, 3});
  publish(settled_channel, std::vector<std::uint8_t>(500));
  publish_truth(truth(0, -1.0));
  state_t larger = truth(0, 0.0);
  larger.f = 3;
  larger.q = larger.u = {0.0, 0.0, 0.0};
  publish_truth(larger);
  publish_truth(larger);
  publish_pair(0, 1.0);
  publish_pair(1, 1.0);
  EXPECT_EQ(end(), 0);
  const auto figures = report();
  EXPECT_EQ(figures["refused"],
            test::parse_json(R"({"truncated": 1, "wrong_type": 1, "bad_time": 1})"));
  EXPECT_EQ(figures["ignored"]["wrong_truth_size"], 2);
  EXPECT_EQ(figures["rows"], 2);
  EXPECT_TRUE(says("the master has 3 coordinates, the scene has 2"));
}

TEST_F(SyncLoggerTest, BadUsageAndInputExitWithTwo) {
  for (const test::Arguments& bad : std::vector<test::Arguments>{
           {scene_, "--duration", "0"},
           {scene_, "--estimate", "a.csv"},
           {scene_, "--truth", "a", "--estimate", "b"},
           {scene_, "--truth", "a", "--estimate", "b", "--csv", "c", "--record", "d"}}) {
    const Ended ended = run(SYNC_LOGGER, bad);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_FALSE(ended.err.empty());
  }
}

}  // namespace
}  // namespace sprag
