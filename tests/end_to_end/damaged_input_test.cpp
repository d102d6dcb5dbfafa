// Damaged and contradictory recordings: the readable part is used, and the damage is reported.
#include <algorithm>
#include <cstring>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_log.h"
#include "sprag/detail/files/csv.h"
#include "sprag/events_file.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class DamagedInputTest : public EndToEnd {
 protected:
  Ended replay_file(const std::string& recording, const Arguments& more = {}) {
    return run("observer",
               Arguments{scene("paper_beam"), "--replay", recording, "--tick", "0.02", "--states",
                         file("states.csv"), "--report", file("report.json")} +
                   more);
  }

  /// Records a run of master and logger to t = 20; returns the log's bytes.
  std::string record() {
    Process& logger = start_listening(
        "sync_logger",
        {scene("paper_beam"), "--csv", file("sync.csv"), "--record", file("whole.lcmlog")});
    Process& master =
        start_master({scene("paper_beam"), "--duration", "20", "--speed", "20", "--no-truth"});
    EXPECT_EQ(end_of(master).code, 0);
    logger.signal(SIGTERM);
    EXPECT_EQ(end_of(logger).code, 0);
    return text("whole.lcmlog");
  }

  static std::vector<std::size_t> record_offsets(const std::string& log) {
    const auto number = [&](std::size_t at) {
      std::size_t value = 0;
      for (std::size_t i = 0; i < 4; ++i)
        value = value << 8U | static_cast<unsigned char>(log[at + i]);
      return value;
    };
    std::vector<std::size_t> offsets;
    for (std::size_t at = 0; at + 28 <= log.size();) {
      offsets.push_back(at);
      at += 28 + number(at + 20) + number(at + 24);
    }
    return offsets;
  }

  /// `damaged` is whole.lcmlog with damage from `begin` to before `end` that affects few messages.
  void expect_left_out(std::size_t begin, std::size_t end, const std::string& damaged) {
    ASSERT_EQ(replay_file(file("whole.lcmlog")).code, 0);
    const std::string all = text("states.csv");
    const Ended ended = replay_file(write_text(file("damaged.lcmlog"), damaged));
    EXPECT_EQ(ended.code, 1);
    EXPECT_NE(ended.err.find(file("damaged.lcmlog") + ": bytes " + std::to_string(begin) + " to " +
                             std::to_string(end - 1) + ": "),
              std::string::npos)
        << ended.err;
    const auto damage = json("report.json")["damage"];
    ASSERT_EQ(damage.size(), 1U);
    EXPECT_EQ(damage[0].value("from", std::size_t{0}), begin);
    EXPECT_EQ(damage[0].value("to", std::size_t{0}), end);
    // Each message repeats the records of those before it.
    EXPECT_TRUE(text("states.csv") == all);
  }

  /// `damaged` is whole.lcmlog, cut in the record that begins at `offset`.
  void expect_used_up_to(std::size_t offset, const std::string& damaged) {
    const std::string whole = file("whole.lcmlog");
    ASSERT_EQ(replay_file(whole).code, 0);
    const std::string all = text("states.csv");
    const Ended ended = replay_file(write_text(file("damaged.lcmlog"), damaged));
    EXPECT_EQ(ended.code, 1);
    EXPECT_NE(ended.err.find("from byte " + std::to_string(offset)), std::string::npos)
        << ended.err;
    EXPECT_EQ(json("report.json")["damage"][0].value("from", std::size_t{0}), offset);
    const std::string used = text("states.csv");
    EXPECT_GT(used.size(), all.size() / 4);
    EXPECT_LT(used.size(), all.size());
    EXPECT_TRUE(all.starts_with(used));
    // The result equals that of the records before the cut.
    write_text(file("before.lcmlog"), damaged.substr(0, offset));
    EXPECT_EQ(replay_file(file("before.lcmlog")).code, 0);
    EXPECT_TRUE(text("states.csv") == used);
  }

  void expect_damage_in_line(std::size_t line, const std::string& recording,
                             const std::string& all) {
    const Ended ended = replay_file(recording);
    EXPECT_EQ(ended.code, 1);
    EXPECT_NE(ended.err.find(recording + ":" + std::to_string(line) + ":"), std::string::npos)
        << ended.err;
    EXPECT_EQ(json("report.json")["damage"].value("line", std::size_t{0}), line);
    const std::string used = text("states.csv");
    EXPECT_GT(used.size(), all.size() / 4);
    EXPECT_LT(used.size(), all.size());
    EXPECT_TRUE(all.starts_with(used));
  }
};

TEST_F(DamagedInputTest, TruncatedLogIsReadUpToTheCut) {
  const std::string log = record();
  const std::vector<std::size_t> offsets = record_offsets(log);
  ASSERT_GT(offsets.size(), 20U);
  const std::size_t offset = offsets[offsets.size() / 2];
  expect_used_up_to(offset, log.substr(0, offset + 100));
}

TEST_F(DamagedInputTest, StrayBytesLoseOnlyCoveredMessages) {
  std::string log = record();
  const std::vector<std::size_t> offsets = record_offsets(log);
  ASSERT_GT(offsets.size(), 20U);
  const std::size_t offset = offsets[offsets.size() / 2];
  log.insert(offset, std::string(1000, '\xED'));
  expect_left_out(offset, offset + 1000, log);
}

TEST_F(DamagedInputTest, CorruptEventsAreReadUpToTheCorruptLine) {
  const std::string whole = simulate(scene("paper_beam"), "20", "0.1");
  ASSERT_EQ(replay_file(whole).code, 0);
  const std::string all = text("states.csv");
  const std::string rows = read_text(whole);
  const std::size_t cut = rows.find('\n', rows.size() / 2) + 1;
  const auto line = static_cast<std::size_t>(std::count(
                        rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(cut), '\n')) +
                    1;
  for (const char* garbage :
       {"x,1,1\n", "1.0,1\n", "nan,1,1\n", "-1,1,1\n", "inf,1,0\n", "9.0,1,1,1\n"}) {
    const std::string damaged =
        write_text(file("damaged.csv"), rows.substr(0, cut) + garbage + rows.substr(cut));
    expect_damage_in_line(line, damaged, all);
  }
}

TEST_F(DamagedInputTest, ContradictoryEventsAreSkippedReportedAndCounted) {
  const std::string clean =
      write_text(file("clean.csv"), "t,contact,closed\n1.0,1,1\n1.0,1,0\n2.0,1,1\n2.5,1,0\n");
  ASSERT_EQ(replay_file(clean, {"--duration", "4"}).code, 0);
  const std::vector<StateLine> expected = read_states_file(file("states.csv"));
  EXPECT_EQ(json("report.json").value("skipped_rows", -1), 0);
  EXPECT_FALSE(json("report.json")["confidence"]["bound"]["final"].is_null());

  const std::string contradictory = write_text(file("contradictory.csv"),
                                               "t,contact,closed\n"
                                               "0.5,1,0\n"  // line 2: opens while open
                                               "1.0,1,1\n"
                                               "1.0,1,0\n"
                                               "0.9,1,1\n"  // line 5: backwards
                                               "2.0,1,1\n"
                                               "2.2,1,1\n"  // line 7: closes while closed
                                               "2.5,1,0\n"
                                               "2.6,1,0\n");  // line 9: opens while open
  const Ended ended = replay_file(contradictory, {"--duration", "4"});
  EXPECT_EQ(ended.code, 0);
  for (const int line : {2, 5, 7, 9}) {
    EXPECT_NE(ended.err.find(contradictory + ":" + std::to_string(line) + ": skipped: "),
              std::string::npos)
        << line << '\n'
        << ended.err;
  }
  EXPECT_EQ(json("report.json").value("skipped_rows", -1), 4);
  EXPECT_EQ(json("report.json").value("events", -1), 3);
  const std::vector<StateLine> actual = read_states_file(file("states.csv"));
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t k = 0; k < actual.size(); ++k) ASSERT_EQ(actual[k].values, expected[k].values);
  // A skipped event may have occurred: the bound restarts from the one that needs no events.
  EXPECT_GT(json("report.json")["confidence"]["bound"]["final"], 0.1);
  ASSERT_EQ(json("report.json")["degraded"].size(), 1U);
  EXPECT_EQ(json("report.json")["degraded"][0]["from"], 0.0);
  EXPECT_EQ(json("report.json")["degraded"][0]["to"], 2.6);
}

TEST_F(DamagedInputTest, LoggerReadsDamagedStatesUpToTheDamage) {
  const std::string beam = scene("paper_beam");
  simulate(beam, "5", "0.1");
  const std::string estimate =
      replay(beam, file("events.csv"), {"--tick", "0.1", "--duration", "5"});
  const std::string rows = read_text(estimate);
  const std::string cut = write_text(file("cut.csv"), rows.substr(0, rows.size() / 2));
  const Ended ended = run("sync_logger", {beam, "--truth", file("truth.csv"), "--estimate", cut,
                                          "--csv", file("sync.csv")});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find(cut + ":"), std::string::npos) << ended.err;
  const std::size_t used = read_sync(file("sync.csv")).size();
  EXPECT_GT(used, 15U);
  EXPECT_LT(used, 35U);
}

}  // namespace
}  // namespace sprag::test
