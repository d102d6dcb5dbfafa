// diagnose with the other programs: a master that differs from the scene.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_log.h"
#include "lcmtypes/contact_messages.h"
#include "recording/recorded_events.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/detail/files/csv.h"
#include "tests/support/program_test.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::Arguments;
using test::read_text;
using test::write_text;

constexpr const char* paper_beam = SPRAG_SOURCE_DIR "/scenes/paper_beam.toml";

class DiagnoseProgramTest : public test::ProgramTest {
 protected:
  Ended diagnose(const Arguments& arguments) { return run(DIAGNOSE, arguments); }

  static RecordedEvents read(const std::string& file, double end = 1e9) {
    return read_recorded_events(file, 1, end, AfterLoss::dropped, std::nullopt);
  }

  /// The events of the paper's beam with another restitution.
  std::string simulate(const std::string& restitution) {
    std::string text = read_text(paper_beam);
    const std::string line = "restitution = 0.7";
    text.replace(text.find(line), line.size(), "restitution = " + restitution);
    write_text(path("real.toml"), text);
    const Ended ended = run(MASTER_SIM, {path("real.toml"), "--duration", "60", "--speed", "max",
                                         "--no-lcm", "--events", path("events.csv")});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return path("events.csv");
  }
};

TEST_F(DiagnoseProgramTest, NamesWrongRestitutionAsIdentifyOneParameterAtATime) {
  const std::string events = simulate("0.65");
  const Ended ended = diagnose({events, paper_beam, "--report", path("report.json")});
  EXPECT_EQ(ended.code, 3) << ended.err;
  EXPECT_NE(ended.out.find("paper_beam: impact.restitution 0.65 instead of 0.7 explains more than "
                           "99.99 % of the misfit"),
            std::string::npos)
      << ended.out;
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_EQ(report["explanation"], "impact.restitution");
  EXPECT_EQ(report["fits"], false);
  EXPECT_EQ(report["exit"], 3);
  EXPECT_EQ(report["parameters"].size(), 9U);
  EXPECT_NEAR(report["parameters"][0]["value"], 0.65, 1e-7);

  // From an LCM log, with two parameters.
  const std::string keys = "impact.restitution,clock.offset";
  const std::string log = path("events.lcmlog");
  write_contact_log(log, read(events, 60.0).events, 1, 60.0, std::nullopt);
  const Ended of_log = diagnose({log, paper_beam, "--free", keys, "--json"});
  EXPECT_EQ(of_log.code, 3);
  const auto object = test::parse_json(of_log.out);
  EXPECT_EQ(object["parameters"].size(), 2U);
  EXPECT_EQ(object["parameters"][0], report["parameters"][0]);
  EXPECT_EQ(run(IDENTIFY, {events, paper_beam, "--each", "--free", keys, "--json"}).out,
            of_log.out);
}

TEST_F(DiagnoseProgramTest, BadUsageAndInputExitWithTwo) {
  const std::string events = simulate("0.7");
  for (const Arguments& arguments :
       {Arguments{}, Arguments{events}, Arguments{path("absent.csv"), paper_beam},
        Arguments{events, path("absent.toml")}, Arguments{events, paper_beam, "--jitter", "-1"},
        Arguments{events, paper_beam, "--duration", "0"},
        Arguments{events, paper_beam, "--free", "mass"}}) {
    const Ended ended = diagnose(arguments);
    EXPECT_EQ(ended.code, 2);
  }
  EXPECT_EQ(run(IDENTIFY, {events, paper_beam, "--each", "--accept"}).code, 2);
}

TEST_F(DiagnoseProgramTest, DamageAndTooFewEventsFail) {
  const std::string events = simulate("0.7");
  const Ended few = diagnose({events, paper_beam, "--duration", "2"});
  EXPECT_EQ(few.code, 1);
  EXPECT_NE(few.err.find("contacts close at"), std::string::npos) << few.err;
  write_text(path("cut.csv"), read_text(events) + "61.5,1");
  // With a jitter larger than that of the events.
  const Ended cut = diagnose({path("cut.csv"), paper_beam, "--jitter", "1e-4"});
  EXPECT_EQ(cut.code, 1);
  EXPECT_NE(cut.err.find("everything before is used"), std::string::npos) << cut.err;
  EXPECT_NE(cut.out.find("events fit the model"), std::string::npos) << cut.out;
}

TEST_F(DiagnoseProgramTest, EventsAfterAGapOrBeforeALateBegin) {
  const auto events = test::events_of(test::shipped_scene("paper_beam"), 400.0);
  const std::string log = path("whole.lcmlog");
  write_contact_log(log, events, 1, 400.0, std::nullopt);
  EXPECT_EQ(read(log).events, events);
  EXPECT_EQ(std::ranges::count_if(events, [](const ContactEvent& e) { return e.t <= 20.0; }),
            std::ssize(read(log, 20.0).events));
  const auto part = [&](auto keep) {
    ChannelLogReader whole(log);
    ChannelLogWriter writer(path("part.lcmlog"));
    ChannelRecord record;
    for (int i = 0; whole.next(record); ++i) {
      if (keep(i)) writer.write(record.utime, record.channel, record.data);
    }
    EXPECT_TRUE(writer.close());
    return read(path("part.lcmlog"));
  };
  const RecordedEvents before = part([](int i) { return i < 100 || i > 300; });
  ASSERT_FALSE(before.problems.empty());
  EXPECT_NE(before.problems[0].find("may be missing"), std::string::npos);
  EXPECT_NEAR(static_cast<double>(before.events.size()), 100.0, 1.0);
  EXPECT_TRUE(std::equal(before.events.begin(), before.events.end(), events.begin()));
  // The recording starts long after the machine, on the machine's own clock.
  const RecordedEvents later = part([](int i) { return i >= 200; });
  EXPECT_GT(later.begins, 100.0);
  ASSERT_EQ(later.problems.size(), 1U);
  EXPECT_NE(later.problems[0].find("begins at t = "), std::string::npos) << later.problems[0];
  EXPECT_TRUE(std::equal(later.events.rbegin(), later.events.rend(), events.rbegin()));
  const Ended ended = diagnose({path("part.lcmlog"), paper_beam});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
}

// Gaps of separate runs: in the first run, in the last run, and with a clock that is set back.
TEST_F(DiagnoseProgramTest, GapOfEarlierRunDoesNotAffectLastRun) {
  const auto events = test::events_of(test::shipped_scene("paper_beam"), 200.0);
  std::int64_t utime = 1'000'000;
  std::vector<std::uint8_t> message;
  const auto write = [&](ChannelLogWriter& log, std::int64_t session, double lost_from,
                         double lost_to, double turned_at, double turned_by) {
    utime += 10'000'000;
    MessageBuilder builder(session, 1.0, 1);
    std::span<const ContactEvent> left = events;
    for (double t = 0.0; t <= 200.0; t += 0.5) {
      const auto later =
          std::find_if(left.begin(), left.end(), [&](const ContactEvent& e) { return e.t > t; });
      builder.add(left.first(static_cast<std::size_t>(later - left.begin())));
      left = left.subspan(static_cast<std::size_t>(later - left.begin()));
      do {
        ContactMessage report = builder.next(t, utime += 500'000);
        if (t > turned_at) {
          report.horizon -= turned_by;
          for (int i = 0; i < report.records; ++i) {
            report.record[static_cast<std::size_t>(i)].t -= turned_by;
          }
        }
        if (t > lost_from && t < lost_to) continue;
        encode(report, message);
        log.write(report.utime, contacts_channel, message);
      } while (builder.pending());
    }
  };
  const auto events_with = [&](double lost_from_2, double turned_at) {
    ChannelLogWriter log(path("runs.lcmlog"));
    write(log, 7, 20.0, 120.0, 1e9, 0.0);
    write(log, 8, lost_from_2, lost_from_2 + 100.0, turned_at, 30.0);
    EXPECT_TRUE(log.close());
    EXPECT_EQ(read(path("runs.lcmlog")).sessions, 2);
    return read(path("runs.lcmlog")).events;
  };
  EXPECT_EQ(events_with(1e9, 1e9), events);
  for (const auto& part : {events_with(60.0, 1e9), events_with(1e9, 60.0)}) {
    ASSERT_FALSE(part.empty());
    EXPECT_NEAR(part.back().t, 60.0, 2.0);
    EXPECT_TRUE(std::equal(part.begin(), part.end(), events.begin()));
  }
}

}  // namespace
}  // namespace sprag
