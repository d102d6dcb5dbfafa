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

  void expect_beginning_of(const std::string& all) {
    const std::string used = text("states.csv");
    EXPECT_GT(used.size(), all.size() / 4);
    EXPECT_LT(used.size(), all.size());
    EXPECT_TRUE(all.starts_with(used));
  }
};

// Stray bytes lose no event, since messages repeat records; after a cut nothing is known.
TEST_F(DamagedInputTest, ADamagedLogIsUsedExceptForItsDamage) {
  const auto events = read_events(simulate(scene("paper_beam"), "20", "0.1"), 1).events;
  write_contact_log(file("whole.lcmlog"), events, 1, 20.0, std::nullopt);
  ASSERT_EQ(replay_file(file("whole.lcmlog")).code, 0);
  const std::string all = text("states.csv");
  std::string log = text("whole.lcmlog");
  const auto record_after = [&](std::size_t place) { return log.find("\xED\xA1\xDA\x01", place); };
  const std::size_t stray = record_after(log.size() / 3), cut = record_after(2 * log.size() / 3);
  const auto expect_damage = [&](const std::string& bytes, std::size_t from, std::size_t to) {
    const Ended ended = replay_file(write_text(file("damaged.lcmlog"), bytes));
    EXPECT_EQ(ended.code, 1);
    EXPECT_NE(ended.err.find("damaged.lcmlog: "), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find("byte" + std::string(to == 0 ? " " : "s ") + std::to_string(from)),
              std::string::npos)
        << ended.err;
    const auto damage = json("report.json")["damage"];
    ASSERT_EQ(damage.size(), 1U);
    EXPECT_EQ(damage[0]["from"], from);
    if (to > 0) {
      EXPECT_EQ(damage[0]["to"], to);
    }
  };
  expect_damage(std::string(log).insert(stray, std::string(1000, '\xED')), stray, stray + 1000);
  EXPECT_TRUE(text("states.csv") == all);
  expect_damage(log.substr(0, cut + 100), cut, 0);
  expect_beginning_of(all);
  const std::string used = text("states.csv");
  EXPECT_EQ(replay_file(write_text(file("before.lcmlog"), log.substr(0, cut))).code, 0);
  EXPECT_TRUE(text("states.csv") == used);
}

TEST_F(DamagedInputTest, CorruptEventsAreReadUpToTheCorruptLine) {
  const std::string whole = simulate(scene("paper_beam"), "20", "0.1");
  ASSERT_EQ(replay_file(whole).code, 0);
  const std::string all = text("states.csv"), rows = read_text(whole);
  const std::size_t cut = rows.find('\n', rows.size() / 2) + 1;
  const auto line = std::ranges::count(rows.substr(0, cut), '\n') + 1;
  const std::string damaged =
      write_text(file("damaged.csv"), rows.substr(0, cut) + "x,1,1\n" + rows.substr(cut));
  const Ended ended = replay_file(damaged);
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find(damaged + ":" + std::to_string(line) + ":"), std::string::npos)
      << ended.err;
  EXPECT_EQ(json("report.json")["damage"]["line"], line);
  expect_beginning_of(all);
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

}  // namespace
}  // namespace sprag::test
