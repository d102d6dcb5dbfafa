// import_events with the other programs: a master's events in an engineer's format are recovered
// unchanged, and an observer replays them to the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_log.h"
#include "lcmtypes/contacts_codec.h"
#include "sprag/events_file.h"
#include "tests/support/program_test.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using test::Arguments;
using test::read_text;
using test::write_text;

std::string scene(const std::string& name) { return SPRAG_SOURCE_DIR "/scenes/" + name + ".toml"; }

/// t on a clock in milliseconds that is `offset` seconds ahead, digit by digit, because a
/// multiplication would not be exact.
std::string milliseconds(double t, int offset, char mark) {
  char text[64];
  std::snprintf(text, sizeof text, "%.24f", t);
  const std::string digits(text);
  const std::size_t point = digits.find('.');
  return std::to_string(std::stoi(digits.substr(0, point)) + offset) + digits.substr(point + 1, 3) +
         mark + digits.substr(point + 4);
}

class ImportEventsTest : public test::ProgramTest {
 protected:
  std::string text(const std::string& name) const { return read_text(directory_ / name); }
  nlohmann::json report() const { return nlohmann::json::parse(text("report.json")); }

  Ended import(const Arguments& arguments) {
    Arguments command{"--report", path("report.json")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run(IMPORT_EVENTS, command);
  }

  /// The events of a master, also in original.csv.
  std::vector<ContactEvent> simulate(const std::string& name, const std::string& duration,
                                     int contacts) {
    const Ended ended = run(MASTER_SIM, {scene(name), "--duration", duration, "--speed", "max",
                                         "--no-lcm", "--events", path("original.csv")});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return read_events(path("original.csv"), contacts).events;
  }

  /// The observer's states, and its events in used.csv.
  std::string replay(const std::string& name, const std::string& recording, Arguments more = {}) {
    Arguments command{scene(name), "--replay",         recording,  "--tick",        "0.01",
                      "--states",  path("states.csv"), "--events", path("used.csv")};
    command.insert(command.end(), more.begin(), more.end());
    const Ended ended = run(OBSERVER, command);
    EXPECT_EQ(ended.code, 0) << ended.err;
    return text("states.csv");
  }
};

TEST_F(ImportEventsTest, ImpactsOnOtherClockAreRestored) {
  auto events = simulate("paper_beam", "100", 1);
  std::erase_if(events, [](const ContactEvent& event) { return event.kind != pulse; });
  ASSERT_GT(events.size(), 100U);
  EventsWriter original(path("original.csv"));
  for (const ContactEvent& event : events) original.write(event);
  ASSERT_TRUE(original.close());
  std::string file = "\xEF\xBB\xBFNr.;Impact [ms]\r\n";
  for (std::size_t i = events.size(); i-- > 0;) {
    file += std::to_string(i) + ";\"" + milliseconds(events[i].t, 1732190400, ',') + "\"\r\n";
  }
  write_text(path("rig.csv"), file);
  const Arguments arguments{
      path("rig.csv"), scene("paper_beam"), "--impacts", "Impact [ms]", "--unit", "ms",
      "--offset",      "1732190400000"};
  const Ended csv = import(arguments);
  EXPECT_EQ(csv.code, 0) << csv.err;
  EXPECT_EQ(csv.out, text("original.csv"));
  EXPECT_EQ(report()["events"], events.size());
  EXPECT_EQ(report()["contacts"][0]["pulses"], events.size());

  Arguments to_log = arguments;
  to_log.insert(to_log.end(), {"--output", path("rig.lcmlog")});
  EXPECT_EQ(import(to_log).code, 0);
  const std::string states = replay("paper_beam", write_text(path("rig_events.csv"), csv.out));
  EXPECT_GT(states.size(), 100'000U);
  EXPECT_TRUE(replay("paper_beam", path("rig.lcmlog")) == states);
  EXPECT_EQ(text("used.csv"), text("original.csv"));
}

TEST_F(ImportEventsTest, SustainedContactsAreRestored) {
  const auto events = simulate("paper_beam_chatter", "20", 1);
  std::string file = "closes\topens\n";
  std::size_t sustained = 0;
  std::size_t pulses = 0;
  for (const ContactEvent& event : events) {
    // A closing and its opening stand in rows of their own.
    const std::string t = milliseconds(event.t, 0, '.');
    if (event.kind != opens) file += t;
    file += '\t';
    if (event.kind != closes) file += t;
    file += '\n';
    sustained += event.kind == closes ? 1 : 0;
    pulses += event.kind == pulse ? 1 : 0;
  }
  ASSERT_GT(sustained, 1U);
  write_text(path("rig.tsv"), file);
  const Arguments arguments{path("rig.tsv"), scene("paper_beam_chatter"),
                            "--on",          "closes",
                            "--off",         "opens",
                            "--unit",        "ms"};
  const Ended csv = import(arguments);
  EXPECT_EQ(csv.code, 0) << csv.err;
  EXPECT_EQ(csv.out, text("original.csv"));
  EXPECT_EQ(report()["contacts"][0]["sustained"], sustained);
  EXPECT_EQ(report()["contacts"][0]["pulses"], pulses);

  Arguments to_log = arguments;
  to_log.insert(to_log.end(), {"--output", path("rig.lcmlog"), "--duration", "20"});
  EXPECT_EQ(import(to_log).code, 0);
  const std::string states =
      replay("paper_beam_chatter", path("original.csv"), {"--duration", "20"});
  EXPECT_GT(states.size(), 50'000U);
  EXPECT_TRUE(replay("paper_beam_chatter", path("rig.lcmlog")) == states);
}

TEST_F(ImportEventsTest, SeveralContactsAreRestored) {
  const auto events = simulate("two_stops_beam", "20", 2);
  std::string file = "below on,below off,above on,above off\n";
  bool both[2] = {false, false};
  for (const ContactEvent& event : events) {
    both[event.contact] = true;
    std::string t;
    append_number(t, event.t);
    if (event.contact == 1) file += ",,";
    if (event.kind != opens) file += t;
    file += ',';
    if (event.kind != closes) file += t;
    file += event.contact == 0 ? ",,\n" : "\n";
  }
  ASSERT_TRUE(both[0] && both[1]);
  write_text(path("rig.csv"), file);
  const Ended ended = import({path("rig.csv"), scene("two_stops_beam"), "--on", "2=above on",
                              "--off", "2=above off", "--on", "1=below on", "--off", "1=below off",
                              "--output", path("events.csv")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_TRUE(ended.out.empty());
  EXPECT_EQ(text("events.csv"), text("original.csv"));
  EXPECT_EQ(import({path("rig.csv"), scene("two_stops_beam"), "--on", "below on", "--on",
                    "above on", "--off", "below off", "--off", "above off"})
                .out,
            text("original.csv"));
}

TEST_F(ImportEventsTest, BadRowsAreReportedAndSkipped) {
  std::string file = "t\n0.5\n";
  for (int i = 0; i < 25; ++i) file += "x\n";
  write_text(path("rig.csv"), file + "1.5");
  const Ended ended = import({path("rig.csv"), scene("paper_beam")});
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(ended.out, "t,contact,closed\n0.5,1,1\n0.5,1,0\n1.5,1,1\n1.5,1,0\n");
  const std::string at = path("rig.csv") + ":";
  EXPECT_NE(ended.err.find(at + "3: column t: x is not a finite number"), std::string::npos);
  EXPECT_NE(ended.err.find(at + "22: "), std::string::npos);
  EXPECT_EQ(ended.err.find(at + "23: "), std::string::npos);
  EXPECT_NE(ended.err.find(at + " 5 more bad rows"), std::string::npos) << ended.err;
  EXPECT_EQ(report()["bad_rows"], 25);
}

TEST_F(ImportEventsTest, NoEventIsAFailureWithoutOutput) {
  write_text(path("rig.csv"), "t\n1\n2\nx\n");
  const Ended ended = import(
      {path("rig.csv"), scene("paper_beam"), "--offset", "5", "--output", path("events.csv")});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("no event is left"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(path("events.csv")));
  EXPECT_EQ(report()["before_start"], 2);
  EXPECT_EQ(report()["bad_rows"], 1);
}

TEST_F(ImportEventsTest, ClockNotSetToZeroIsReported) {
  write_text(path("rig.csv"), "t\n1732190400.5\n");
  const Arguments arguments{path("rig.csv"), scene("paper_beam")};
  EXPECT_NE(import(arguments).err.find("--offset"), std::string::npos);
  EXPECT_EQ(import({arguments[0], arguments[1], "--offset", "1732190400"}).err.find("--offset"),
            std::string::npos);
}

TEST_F(ImportEventsTest, UnitIsTakenFromHeader) {
  write_text(path("rig.csv"), "Impact [ms];other [us]\r500,0;1\r1000;2\r");
  const std::string expected = "t,contact,closed\n0.5,1,1\n0.5,1,0\n1,1,1\n1,1,0\n";
  const Arguments arguments{path("rig.csv"), scene("paper_beam"), "--impacts", "Impact [ms]"};
  const Ended ended = import(arguments);
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.out, expected);
  Arguments contradicted = arguments;
  contradicted.insert(contradicted.end(), {"--unit", "s"});
  const Ended in_seconds = import(contradicted);
  EXPECT_EQ(in_seconds.out, "t,contact,closed\n500,1,1\n500,1,0\n1000,1,1\n1000,1,0\n");
  EXPECT_NE(in_seconds.err.find("says ms; --unit says something else"), std::string::npos)
      << in_seconds.err;
  const Ended asked =
      import({path("rig.csv"), scene("paper_beam"), "--on", "Impact [ms]", "--off", "other [us]"});
  EXPECT_EQ(asked.code, 2);
  EXPECT_NE(asked.err.find("--unit s, ms, us, ns or a number"), std::string::npos) << asked.err;
}

TEST_F(ImportEventsTest, BadUsageAndInputExitWithTwo) {
  const std::string rig = write_text(path("rig.csv"), "impact,on,off\n1,2,3\n").string();
  const std::string beam = scene("paper_beam");
  const struct {
    Arguments arguments;
    const char* said;
  } cases[] = {
      {{}, "FILE is required"},
      {{rig}, "SCENE is required"},
      {{path("absent.csv"), beam}, "absent.csv: No such file"},
      {{path(""), beam}, "is a directory"},
      {{rig, path("absent.toml")}, "absent.toml"},
      {{rig, beam}, "name the columns with --impacts"},
      {{rig, beam, "--impacts", "impcat"}, "did you mean 'impact'?"},
      {{rig, beam, "--impacts", "2=impact"}, "the scene has 1 contact"},
      {{rig, beam, "--on", "on"}, "--on without --off"},
      {{rig, beam, "--impacts", "impact", "--unit", "min"},
       "--unit: min; choose s, ms, us, ns or a number of seconds > 0\n"},
      {{rig, beam, "--impacts", "impact", "--offset", "nan"}, "a finite number"},
      {{rig, beam, "--impacts", "impact", "--debounce", "0"}, "finite number > 0"},
      {{rig, beam, "--impacts", "impact", "--separator", "x"},
       "--separator: x; choose comma, semicolon or tab\n"},
      {{rig, beam, "--impacts", "impact", "--output", "x.txt"}, ".csv or .lcmlog"},
      {{rig, beam, "--impacts", "impact", "--output", rig}, "FILE and --output are the same file"}};
  for (const auto& [arguments, said] : cases) {
    const Ended ended = import(arguments);
    EXPECT_EQ(ended.code, 2) << said;
    EXPECT_NE(ended.err.find(said), std::string::npos) << ended.err;
  }
  EXPECT_EQ(read_text(rig), "impact,on,off\n1,2,3\n");
}

TEST_F(ImportEventsTest, AnOutputThatCannotBeWrittenFails) {
  write_text(path("rig.csv"), "t\n1\n");
  for (const char* output : {"/nowhere/events.csv", "/nowhere/events.lcmlog"}) {
    const Ended ended = import({path("rig.csv"), scene("paper_beam"), "--output", output});
    EXPECT_EQ(ended.code, 1);
    EXPECT_NE(ended.err.find("/nowhere/events"), std::string::npos) << ended.err;
  }
}

TEST_F(ImportEventsTest, SignedLogIsReadOnlyWithKey) {
  write_text(path("rig.csv"), "t\n0.5\n1\n");
  write_text(path("key"), std::string(64, 'a') + "\n");
  ASSERT_EQ(import({path("rig.csv"), scene("paper_beam"), "--key", path("key"), "--output",
                    path("rig.lcmlog")})
                .code,
            0);
  replay("paper_beam", path("rig.lcmlog"), {"--key", path("key")});
  EXPECT_EQ(text("used.csv"), "t,contact,closed\n0.5,1,1\n0.5,1,0\n1,1,1\n1,1,0\n");
  replay("paper_beam", path("rig.lcmlog"));
  EXPECT_EQ(text("used.csv"), "t,contact,closed\n");
}

// Output of a logic analyser without a header, of contacts that bounce.
TEST_F(ImportEventsTest, CaptureWithoutHeaderIsReadAndBouncesAreReported) {
  std::string capture;
  char row[64];
  for (int k = 1; k <= 40; ++k) {
    for (int edge = 0; edge < 6; ++edge) {  // three closings within 0.3 ms
      std::snprintf(row, sizeof row, "%.6f,%d\n", 0.05 * k + 5e-5 * edge, edge % 2 == 0 ? 1 : 0);
      capture += row;
    }
  }
  const std::string file = write_text(path("capture.csv"), capture);
  const Ended without = import({file, scene("paper_beam"), "--level", "level"});
  EXPECT_EQ(without.code, 2);
  EXPECT_NE(without.err.find("--columns NAME,..."), std::string::npos) << without.err;

  const Arguments arguments{"--columns",         "time,level", file,
                            scene("paper_beam"), "--level",    "level"};
  const Ended bounces = import(arguments);
  EXPECT_EQ(bounces.code, 0) << bounces.err;
  EXPECT_NE(bounces.err.find("contact 1: 120 of 120 sustained contacts last less than 0.001 s"),
            std::string::npos)
      << bounces.err;
  EXPECT_EQ(report()["hints"].size(), 1U);
  EXPECT_FALSE(report().contains("batches"));

  Arguments corrected = arguments;
  corrected.insert(corrected.end(), {"--debounce", "1e-3", "--pulse-shorter-than", "1e-3"});
  const Ended clean = import(corrected);
  EXPECT_EQ(clean.code, 0) << clean.err;
  EXPECT_EQ(clean.err.find("sustained contacts last"), std::string::npos) << clean.err;
  EXPECT_EQ(report()["contacts"][0]["pulses"], 40);
  EXPECT_TRUE(report()["hints"].empty());

  const Ended fewer = import({file, scene("paper_beam"), "--columns", "time", "--impacts", "time"});
  EXPECT_EQ(fewer.code, 2);
  EXPECT_NE(fewer.err.find(":1: has 2 fields; --columns names 1 column"), std::string::npos)
      << fewer.err;
}

TEST_F(ImportEventsTest, BatchedTimeStampsAreReported) {
  std::string file = "t [ms]\n";
  for (int k = 1; k <= 400; ++k) {
    const int read = 20 * static_cast<int>(std::ceil((7.3 * k + 5.0 * std::sin(k)) / 20.0));
    file += std::to_string(read) + "." + std::to_string(100 + k % 900) + "\n";
  }
  const Ended ended = import({write_text(path("polled.csv"), file), scene("paper_beam")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.err.find("time stamps come in batches"), std::string::npos) << ended.err;
  EXPECT_NEAR(report()["batches"]["period"].get<double>(), 0.02, 1e-3);
}

TEST_F(ImportEventsTest, ATimeThatGoesBackIsNamed) {
  write_text(directory_ / "ascending.csv", "Impact [s]\n0.5\n0.75\n1.25\n");
  const Ended ascending = import({path("ascending.csv"), scene("bouncing_ball")});
  EXPECT_EQ(ascending.err.find("goes back"), std::string::npos) << ascending.err;
  write_text(directory_ / "back.csv", "Impact [s]\n0.5\n1.25\n0.75\n");
  const Ended back = import({path("back.csv"), scene("bouncing_ball")});
  EXPECT_EQ(back.code, 0) << back.err;
  EXPECT_NE(back.err.find("back.csv:4: column Impact [s]: the time goes back, to 0.75"),
            std::string::npos)
      << back.err;
}

TEST_F(ImportEventsTest, ARowOfUnitsIsRefusedUnlessTheUnitIsKnown) {
  write_text(directory_ / "units.csv", "Time,Channel A\n(ms),(V)\n\n451,0\n452,5\n453,0\n");
  const Arguments command{path("units.csv"), scene("bouncing_ball"), "--level",
                          "Channel A",       "--threshold",          "2.5"};
  const Ended refused = import(command);
  EXPECT_EQ(refused.code, 2) << refused.err;
  EXPECT_NE(refused.err.find("units.csv:2: is a row of units, '(ms)'"), std::string::npos)
      << refused.err;
  Arguments known = command;
  known.insert(known.end(), {"--unit", "ms"});
  const Ended read = import(known);
  EXPECT_EQ(read.code, 0) << read.err;
  EXPECT_NE(read.out.find("0.45200000000000001,1,1"), std::string::npos) << read.out;
}

class ContactLogTest : public ImportEventsTest {
 protected:
  struct Sent {
    std::int64_t utime;
    ContactMessage report;
  };

  std::vector<Sent> write(const std::vector<ContactEvent>& events, double end) {
    const std::int64_t count =
        write_contact_log(path("x.lcmlog"), events, max_contacts, end, std::nullopt);
    ChannelLogReader reader(path("x.lcmlog"));
    std::vector<Sent> sent;
    ChannelRecord record;
    while (reader.next(record)) {
      EXPECT_EQ(record.channel, contacts_channel);
      sent.push_back({record.utime, {}});
      EXPECT_EQ(decode(record.data, sent.back().report), Refusal::none);
    }
    EXPECT_TRUE(reader.damages().empty());
    EXPECT_EQ(std::ssize(sent), count);
    return sent;
  }
};

TEST_F(ContactLogTest, MessagesEqualThoseOfMaster) {
  const auto sent = write({{0.0, 0, closes}, {0.5, 1, pulse}, {1.0000005, 0, opens}}, 2.5);
  ASSERT_EQ(sent.size(), 4U);
  const double horizons[] = {0.0, 0.5, 1.0000005, 2.5};
  const std::int64_t utimes[] = {0, 500'000, 1'000'001, 2'500'000};
  const ContactSet closed[] = {1, 1, 0, 0};
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const ContactMessage& report = sent[i].report;
    EXPECT_EQ(report.sequence, sent[0].report.sequence + static_cast<std::int64_t>(i));
    EXPECT_EQ(report.session, sent[0].report.session);
    EXPECT_EQ(report.speed, 1.0);
    EXPECT_EQ(report.horizon, horizons[i]);
    EXPECT_EQ(sent[i].utime, utimes[i]);
    EXPECT_EQ(report.utime, utimes[i]);
    EXPECT_EQ(report.closed, closed[i]);
    EXPECT_EQ(report.records_total, std::min<std::int64_t>(static_cast<std::int64_t>(i) + 1, 3));
    EXPECT_EQ(report.records, report.records_total);
  }
}

TEST_F(ContactLogTest, NoEventIsLostWithEveryOtherMessage) {
  std::vector<ContactEvent> events;
  events.reserve(2000);
  for (int i = 0; i < 2000; ++i) events.push_back({1.0 + 1e-6 * i, i % 3, pulse});
  const auto sent = write(events, 0.0);
  EXPECT_GT(sent.size(), 2000U / 60);
  EXPECT_LT(sent.size(), 100U);
  std::int64_t last = 0;
  std::int64_t before_last = 0;
  for (const Sent& message : sent) {
    EXPECT_LE(message.report.records_total - before_last, max_records);
    EXPECT_GE(message.report.records, std::min<std::int64_t>(message.report.records_total, 120));
    before_last = std::exchange(last, message.report.records_total);
  }
  EXPECT_EQ(last, 2000);
  EXPECT_EQ(sent.back().report.horizon, events.back().t);
}

TEST_F(ContactLogTest, CloseEventsShareAMessageWithinOneHeartbeat) {
  std::vector<ContactEvent> events;
  for (int i = 0; i < 3000; ++i) events.push_back({1.0 + 3e-3 * i, 0, pulse});
  const auto sent = write(events, 0.0);
  EXPECT_LT(sent.size(), 1000U);
  std::size_t known = 0;
  for (const Sent& message : sent) {
    const auto now = static_cast<std::size_t>(message.report.records_total);
    for (std::size_t i = known; i < now; ++i) {
      EXPECT_LE(events[i].t, message.report.horizon);
      EXPECT_LE(message.report.horizon - events[i].t, 0.010000001);
    }
    // Not sent before its last event, and containing all events up to then.
    EXPECT_GE(1e-6 * static_cast<double>(message.utime), message.report.horizon - 1e-9);
    EXPECT_LE(1e-6 * static_cast<double>(message.utime), message.report.horizon + 1.1e-6);
    EXPECT_EQ(message.report.horizon, now > 0 ? events[now - 1].t : 0.0);
    known = now;
  }
  EXPECT_EQ(known, events.size());
}

TEST_F(ContactLogTest, SimultaneousEventsAreNotSplit) {
  std::vector<ContactEvent> events;
  for (int k = 0; k < 20; ++k) {
    const double t = 1.0 + 1e-5 * k;
    for (int i = 0; i < 7; ++i) events.push_back({t, i, k % 2 == 0 ? closes : opens});
  }
  std::int64_t seen = 0;
  for (const Sent& message : write(events, 0.0)) {
    const auto next = static_cast<std::size_t>(message.report.records_total);
    EXPECT_LE(message.report.records_total - seen, message.report.records);
    if (next < events.size()) {
      EXPECT_GT(events[next].t, message.report.horizon);
    }
    seen = message.report.records_total;
  }
  EXPECT_EQ(seen, std::ssize(events));
}

TEST_F(ContactLogTest, SessionDependsOnEvents) {
  const std::vector<ContactEvent> events{{0.5, 0, pulse}, {1.0, 0, pulse}};
  const auto first = write(events, 2.0);
  const std::string bytes = text("x.lcmlog");
  write(events, 2.0);
  EXPECT_TRUE(text("x.lcmlog") == bytes);
  EXPECT_NE(write({{0.5, 0, pulse}}, 2.0)[0].report.session, first[0].report.session);
}

}  // namespace
}  // namespace sprag
