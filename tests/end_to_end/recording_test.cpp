// Runs are recorded, replayed and played back with the same bits.
#include <sys/stat.h>

#include <cmath>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_log.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/events_file.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class RecordingTest : public EndToEnd {
 protected:
  const std::string beam_ = scene("paper_beam");
  const Arguments common_{beam_, "--duration", "40", "--tick", "0.015625"};
};

TEST_F(RecordingTest, RecordingOfLcmLoggerReplaysLikeTheRun) {
  const std::string recording = file("recording");
  Process& recorder = start_recorder(recording, "SPRAG_CONTACTS");
  Process& observer =
      start_listening("observer", common_ + Arguments{"--states", file("live.csv")});
  Process& master = start_master(common_ + Arguments{"--speed", "20"});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  end_recorder(recorder);
  const std::string live = text("live.csv");
  EXPECT_EQ(count_rows(file("live.csv")), 2561U);
  const Arguments more{"--tick", "0.015625", "--duration", "40"};
  EXPECT_TRUE(live == read_text(replay(beam_, recording, more))) << "the replay differs";

  set_url(udp_url());
  Process& second =
      start_listening("observer", common_ + Arguments{"--states", file("played.csv")});
  Process& player =
      start_command({LCM_LOGPLAYER, "--lcm-url=" + url(), "--speed", "1.5", recording});
  EXPECT_EQ(end_of(player).code, 0);
  EXPECT_EQ(end_of(second).code, 0);
  EXPECT_TRUE(live == text("played.csv")) << "the played recording differs";
}

// Without a states file a replay outputs few ticks. Only the share of ticks inside a support, which
// needs all ticks, is then not reported.
TEST_F(RecordingTest, ReplayReportDoesNotDependOnStatesFile) {
  const std::string chatter = scene("paper_beam_chatter");
  simulate(chatter, "30", "0.1");
  for (const char* duration : {"20", "40"}) {  // and after the last event
    const auto reported = [&](const Arguments& more) {
      EXPECT_EQ(
          run("observer", Arguments{chatter, "--replay", file("events.csv"), "--tick", "0.001",
                                    "--duration", duration, "--report", file("report.json")} +
                              more)
              .code,
          0);
      nlohmann::ordered_json report = json("report.json");
      report.erase("command");
      return report;
    };
    nlohmann::ordered_json in_full = reported({"--states", file("states.csv")});
    EXPECT_EQ(in_full["ticks"], std::stoi(duration) * 1000 + 1);
    in_full["confidence"].erase("penetration");
    EXPECT_EQ(reported({}).dump(1), in_full.dump(1)) << duration;
  }
}

// An events file has no watermark: the time after its last event may lack events.
TEST_F(RecordingTest, WarnsOfFreePredictionAfterLastEventOfFile) {
  const std::string events = write_text(file("few.csv"), "t,contact,closed\n1.5,1,1\n1.5,1,0\n");
  const auto replayed = [&](const Arguments& more) {
    return run("observer",
               Arguments{beam_, "--replay", events, "--report", file("report.json")} + more);
  };
  const std::string words = events + ": no event after t = 1.5: from there on the estimate runs";
  EXPECT_NE(replayed({"--duration", "2"}).err.find(words), std::string::npos);
  EXPECT_EQ(json("report.json")["runs_free_from"], 1.5);
  EXPECT_EQ(replayed({}).err.find("runs free"), std::string::npos);
  EXPECT_FALSE(json("report.json").contains("runs_free_from"));
}

/// A recording of a paced run with a pulse at each time, and stamps from 0 on.
std::string recording_of(std::int64_t session, const std::vector<double>& times,
                         const std::filesystem::path& log) {
  ChannelLogWriter writer(log);
  MessageBuilder builder(session, 1.0, 1);
  std::vector<std::uint8_t> bytes;
  for (const double t : times) {
    const std::vector<ContactEvent> event{{t, 0, ContactEventKind::pulse}};
    builder.add(event);
    const auto utime = static_cast<std::int64_t>(1e6 * t);
    encode(builder.next(t, utime), bytes);
    writer.write(utime, contacts_channel, bytes);
  }
  EXPECT_TRUE(writer.close());
  return read_text(log);
}

// The stamps of the second recording begin again, and its events are further apart than a master's
// time may jump.
TEST_F(RecordingTest, RecordingsJoinedByCatAreAllReplayed) {
  const std::string beam = scene("bouncing_ball");
  const std::string first = recording_of(1, {0.5, 1.5}, file("first.lcmlog"));
  const std::string second = recording_of(2, {0.25, 20.0}, file("second.lcmlog"));
  const Arguments log{
      beam,       "--replay",         file("joined.lcmlog"), "--events", file("events.csv"),
      "--report", file("report.json")};
  const auto times = [&] {
    std::vector<double> closings;
    const std::vector<double> t = read_column(file("events.csv"), "t");
    for (std::size_t i = 0; i < t.size(); i += 2) closings.push_back(t[i]);
    return closings;
  };
  write_text(file("joined.lcmlog"), first + second);
  const Ended joined = run("observer", log);
  EXPECT_EQ(joined.code, 0) << joined.err;
  EXPECT_EQ(joined.err.find("left out"), std::string::npos) << joined.err;
  EXPECT_EQ(times(), (std::vector<double>{0.5, 1.5, 0.25, 20.0}));
  EXPECT_EQ(json("report.json")["messages"]["sessions"], 2);

  // The last run is fitted, which is said.
  const Ended fitted = run("identify", {file("joined.lcmlog"), beam, "--free", "impact.restitution",
                                        "--report", file("fit.json")});
  EXPECT_NE(fitted.err.find("2 runs of a master; the last is used"), std::string::npos);

  write_text(file("joined.lcmlog"), first + first);
  const Ended doubled = run("observer", log);
  EXPECT_EQ(doubled.code, 0) << doubled.err;
  EXPECT_NE(doubled.err.find("2 messages are left out, since they are repeated"), std::string::npos)
      << doubled.err;
  EXPECT_EQ(times(), (std::vector<double>{0.5, 1.5}));
}

// A second master beside the one that is followed, in one recording.
TEST_F(RecordingTest, MessagesThatAReplayLeavesOutAreNamed) {
  recording_of(1, {0.5, 0.51}, file("first.lcmlog"));
  recording_of(2, {0.505}, file("second.lcmlog"));
  ChannelLogReader first(file("first.lcmlog")), second(file("second.lcmlog"));
  ChannelLogWriter both(file("both.lcmlog"));
  ChannelRecord record;
  for (ChannelLogReader* log : {&first, &second, &first}) {
    ASSERT_TRUE(log->next(record));
    both.write(record.utime, record.channel, record.data);
  }
  ASSERT_TRUE(both.close());
  const Ended replayed = run("observer", {scene("bouncing_ball"), "--replay", file("both.lcmlog")});
  EXPECT_EQ(replayed.code, 0) << replayed.err;
  EXPECT_NE(replayed.err.find("1 message is left out, of other masters"), std::string::npos)
      << replayed.err;
}

TEST_F(RecordingTest, PipesAreReadLikeFiles) {
  const std::string events = simulate(beam_, "15", "0.1");
  const std::string impacts = write_text(file("impacts.csv"), "t\n0.5\n1\n");
  const std::vector<ContactEvent> pulses{{0.5, 0, ContactEventKind::pulse},
                                         {1.0, 0, ContactEventKind::pulse}};
  write_contact_log(file("impacts.lcmlog"), pulses, 1, 0.0, std::nullopt);
  const auto piped = [&](const char* script, const Arguments& arguments) {
    const Ended ended = end_of(start_command(Arguments{"sh", "-c", script} + arguments));
    EXPECT_EQ(ended.code, 0) << ended.err;
    return ended.out;
  };
  for (const std::string& recording : {events, file("impacts.lcmlog")}) {
    const std::string from_file = read_text(replay(beam_, recording, {}));
    for (const char* script : {R"(cat "$3" | "$0" "$1" --replay /dev/stdin --states "$2")",
                               R"("$0" "$1" --replay /dev/stdin --states "$2" < "$3")"}) {
      piped(script, {OBSERVER, beam_, file("piped.csv"), recording});
      EXPECT_TRUE(text("piped.csv") == from_file) << recording << ' ' << script;
    }
    ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
    piped(R"(cat "$3" > "$4" & "$0" "$1" --replay "$4" --states "$2")",
          {OBSERVER, beam_, file("piped.csv"), recording, file("pipe")});
    EXPECT_TRUE(text("piped.csv") == from_file) << recording;
    std::filesystem::remove(file("pipe"));
  }
  EXPECT_EQ(piped(R"(cat "$2" | "$0" /dev/stdin "$1")", {DIAGNOSE, beam_, events}),
            run("diagnose", {events, beam_}).out);
  EXPECT_EQ(piped(R"(cat "$2" | "$0" /dev/stdin "$1")", {IMPORT_EVENTS, beam_, impacts}),
            run("import_events", {impacts, beam_}).out);
}

}  // namespace
}  // namespace sprag::test
