// A live run gives the same result as an offline run with the same events.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <set>
#include <sprag/outputs_t.hpp>
#include <sstream>

#include "lcmtypes/channel_log.h"
#include "sprag/detail/files/csv.h"
#include "sprag/events_file.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class LiveAndOfflineTest : public EndToEnd {
 protected:
  /// Runs the three programs to `duration`; files live.csv, events.csv, sync.csv, run.lcmlog.
  /// The observer may have another scene than the master.
  void run_live(const std::string& scene_file, const std::string& duration, const std::string& tick,
                const Arguments& of_observer, const Arguments& of_master = {},
                const std::string& observer_scene = {}) {
    const Arguments common{scene_file, "--duration", duration};
    const Arguments to_observer{observer_scene.empty() ? scene_file : observer_scene, "--duration",
                                duration};
    Process& logger = start_listening(
        "sync_logger",
        common + Arguments{"--csv", file("sync.csv"), "--record", file("run.lcmlog")});
    Process& observer = start_listening(
        "observer",
        to_observer + Arguments{"--tick", tick, "--states", file("live.csv")} + of_observer);
    Process& master = start_master(
        common + Arguments{"--tick", tick, "--speed", "20", "--events", file("events.csv")} +
        of_master);
    EXPECT_EQ(end_of(master).code, 0);
    EXPECT_EQ(end_of(observer).code, 0);
    // Without truth the logger cannot detect the end of the run.
    if (std::ranges::find(of_master, "--no-truth") != of_master.end()) logger.signal(SIGTERM);
    EXPECT_EQ(end_of(logger).code, 0);
  }

  void expect_settled_ticks_as_in_replays(const std::string& name, const Arguments& how,
                                          const std::string& observer_scene = {}) {
    run_live(scene(name), "40", "0.015625", how, {}, observer_scene);
    const std::string replayed = observer_scene.empty() ? scene(name) : observer_scene;
    const std::string live = text("live.csv");
    EXPECT_EQ(read_states_file(file("live.csv")).size(), 2561U);
    const Arguments more = Arguments{"--tick", "0.015625", "--duration", "40"} + how;
    EXPECT_TRUE(live == read_text(replay(replayed, file("events.csv"), more)))
        << "live differs from the replay of the events";
    EXPECT_TRUE(live == read_text(replay(replayed, file("run.lcmlog"), more)))
        << "live differs from the replay of the recording";
  }
};

TEST_F(LiveAndOfflineTest, LiveErrorEnergyEqualsOfflineErrorEnergy) {
  const std::string beam = scene("paper_beam");
  run_live(beam, "60", "0.015625", {});
  simulate(beam, "60", "0.015625");
  const std::string estimate =
      replay(beam, file("events.csv"), {"--tick", "0.015625", "--duration", "60"});
  EXPECT_EQ(run("sync_logger", {beam, "--truth", file("truth.csv"), "--estimate", estimate, "--csv",
                                file("offline.csv")})
                .code,
            0);

  std::map<std::int64_t, SyncLine> offline;
  for (const SyncLine& row : read_sync(file("offline.csv"))) offline[row.k] = row;
  ASSERT_EQ(offline.size(), 3841U);
  EXPECT_NEAR(offline[0].v, 0.4783533, 1e-7);
  EXPECT_LT(offline[3840].v, 1e-4 * offline[0].v);

  const std::vector<SyncLine> live = read_sync(file("sync.csv"));
  EXPECT_GE(live.size(), 3649U);  // UDP may lose some
  for (const SyncLine& row : live) {
    ASSERT_TRUE(offline.contains(row.k)) << row.k;
    const SyncLine& same = offline[row.k];
    EXPECT_EQ(row.t, same.t);
    EXPECT_NEAR(row.v, same.v, std::max(1e-12 * same.v, 1e-20)) << "k " << row.k;
  }
}

// The result of an identification takes effect at the same tick, however long the computation
// takes.
TEST_F(LiveAndOfflineTest, SettledTicksOfTheAdaptiveObserverEqualTheReplayBitForBit) {
  std::string wrong = read_text(scene("paper_beam"));
  for (const auto& [is, given] :
       std::map<std::string, std::string>{{"damping = 0.17", "damping = 0.18"},
                                          {"restitution = 0.7", "restitution = 0.65"},
                                          {"bending_stiffness = 1.0", "bending_stiffness = 1.1"}}) {
    ASSERT_NE(wrong.find(is), std::string::npos);
    wrong.replace(wrong.find(is), is.size(), given);
  }
  write_text(file("wrong.toml"), wrong);
  expect_settled_ticks_as_in_replays("paper_beam",
                                     {"--estimator", "adaptive", "--report", file("report.json")},
                                     file("wrong.toml"));
  EXPECT_NE(text("run.lcmlog").find("SPRAG_PARAMETERS"), std::string::npos);
  const std::string header = text("live.csv").substr(0, text("live.csv").find('\n'));
  EXPECT_NE(header.find(",accepted,impact.restitution,sigma_impact.restitution,beam.damping,"),
            std::string::npos);
  const nlohmann::json report = json("report.json");
  const nlohmann::json& adaptation = report.at("adaptation");
  EXPECT_EQ(adaptation.at("accepted").size(), 1U);
  EXPECT_NEAR(adaptation.at("parameters").at("impact.restitution").at("value").get<double>(), 0.7,
              1e-9);
  // With correct parameters the state is correct, too.
  simulate(scene("paper_beam"), "40", "0.015625");
  EXPECT_EQ(run("sync_logger", {scene("paper_beam"), "--truth", file("truth.csv"), "--estimate",
                                file("live.csv"), "--csv", file("offline.csv")})
                .code,
            0);
  EXPECT_LT(read_sync(file("offline.csv")).back().v, 1e-20);
}

// By default an observer runs both estimators, and publishes all their quantities.
TEST_F(LiveAndOfflineTest, SettledTicksEqualTheReplayBitForBitThroughChatter) {
  expect_settled_ticks_as_in_replays("paper_beam_chatter", {});
  const std::string header = text("live.csv").substr(0, text("live.csv").find('\n'));
  EXPECT_EQ(header,
            "k,t,q1,q2,q3,u1,u2,u3,B,sigma_q1,sigma_q2,sigma_q3,sigma_u1,sigma_u2,sigma_u3,"
            "sigma_g1,closing_t,closing_contact,replica_gap,filter_gap,sigma_filter_gap,"
            "from_filter,inconsistencies,penetrating");
}

// The bound under tolerances is computed with the settled ticks. Estimates of the present that are
// published earlier must not affect it.
TEST_F(LiveAndOfflineTest, BoundUnderTolerancesEqualsTheReplayBitForBitThroughChatter) {
  const std::string machine =
      write_text(file("tolerant.toml"),
                 read_text(scene("paper_beam_chatter")) + "\n[tolerance]\ntime = 1e-6\n");
  expect_settled_ticks_as_in_replays("paper_beam_chatter", {"--estimator", "replica"}, machine);
  const std::vector<double> B = read_column(file("live.csv"), "B");
  EXPECT_EQ(std::ranges::count_if(B, [](double b) { return std::isinf(b); }), 1);
}

// The same for the table of impacts; every row is also on the bus.
TEST_F(LiveAndOfflineTest, SettledImpactsEqualTheReplayBitForBit) {
  const std::string chatter = scene("paper_beam_chatter");
  run_live(chatter, "30", "0.015625", {"--impacts", file("live_impacts.csv")});
  replay(chatter, file("events.csv"),
         {"--tick", "0.015625", "--duration", "30", "--impacts", file("impacts.csv")});
  EXPECT_GT(count_rows(file("live_impacts.csv")), 30U);
  EXPECT_TRUE(text("live_impacts.csv") == text("impacts.csv"))
      << "live differs from the replay of the events";
  EXPECT_NE(text("run.lcmlog").find("SPRAG_IMPACTS"), std::string::npos);
}

/// Columns of a CSV by their names.
std::map<std::string, std::vector<double>> columns_of(const std::string& csv) {
  std::map<std::string, std::vector<double>> columns;
  std::vector<std::string> names;
  std::vector<std::string_view> fields;
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  split_fields(line, fields);
  names.assign(fields.begin(), fields.end());
  while (std::getline(lines, line)) {
    split_fields(line, fields);
    EXPECT_EQ(fields.size(), names.size()) << line;
    for (std::size_t i = 0; i < std::min(fields.size(), names.size()); ++i) {
      columns[names[i]].push_back(std::stod(std::string(fields[i])));
    }
  }
  return columns;
}

// The named outputs of a scene are the same on the bus and in the file.
TEST_F(LiveAndOfflineTest, SettledOutputsOnTheBusEqualTheStatesFile) {
  const std::string outputs = R"(
[[output]]
name = "middle"
position = 0.5
[[output]]
name = "tip_speed"
position = 1.0
quantity = "velocity"
)";
  write_text(file("named.toml"), read_text(scene("paper_beam")) + outputs);
  run_live(file("named.toml"), "20", "0.015625", {});
  const auto states = columns_of(text("live.csv"));
  ASSERT_EQ(states.at("k").size(), 1281U);
  ChannelLogReader log(file("run.lcmlog"));
  ChannelRecord record;
  std::set<std::int64_t> settled;
  std::size_t provisional = 0, known = 0;
  while (log.next(record)) {
    if (record.channel != "SPRAG_OUTPUTS") continue;
    outputs_t message;
    ASSERT_EQ(message.decode(record.data.data(), 0, static_cast<int>(record.data.size())),
              static_cast<int>(record.data.size()));
    EXPECT_EQ(message.name, (std::vector<std::string>{"middle", "tip_speed"}));
    if (message.settled == 0) {
      ++provisional;
      continue;
    }
    const auto row = static_cast<std::size_t>(message.tick);
    ASSERT_LT(row, states.at("k").size());
    settled.insert(message.tick);
    EXPECT_EQ(message.t, states.at("t")[row]);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(message.value.at(i), states.at(message.name[i])[row]) << message.tick;
      const double sigma = states.at("sigma_" + message.name[i])[row];
      EXPECT_EQ(message.sigma.at(i), sigma) << message.tick;
      known += std::isfinite(sigma) ? 1 : 0;
    }
    if (states.contains("from_filter")) {
      EXPECT_EQ(message.from_filter, states.at("from_filter")[row]) << message.tick;
    }
  }
  EXPECT_GE(settled.size(), 1217U);  // UDP may lose some
  EXPECT_GT(provisional, 0U);
  EXPECT_GT(known, 0U);
  std::cout << settled.size() << " settled ticks of 1281, " << provisional
            << " provisional messages, " << known << " finite sigmas\n";
}

// A live observer may predict once for several settled events.
TEST_F(LiveAndOfflineTest, PredictionsMatchTheMaster) {
  const std::string ball = scene("bouncing_ball");
  const Arguments how{"--predict", "2", "--predictions"};
  run_live(ball, "4", "0.015625", how + Arguments{file("live_predictions.csv")}, {}, ball);
  replay(ball, file("events.csv"),
         Arguments{"--tick", "0.015625", "--duration", "4"} + how +
             Arguments{file("predictions.csv")});
  const std::vector<ContactEvent> events = read_events(file("events.csv"), 1).events;
  for (const char* name : {"live_predictions.csv", "predictions.csv"}) {
    SCOPED_TRACE(name);
    std::istringstream rows(text(name));
    std::string row;
    std::getline(rows, row);
    EXPECT_EQ(row, "made_at,certain_until,t,contact,kind,sigma_t");
    int predicted = 0;
    while (std::getline(rows, row)) {
      double made_at = 0.0, t = 0.0, sigma = 0.0;
      if (std::sscanf(row.c_str(), "%lf,%*f,%lf,1,%*[a-z],%lf", &made_at, &t, &sigma) != 3)
        continue;
      EXPECT_LT(made_at, t);
      if (t + 4.0 * sigma > 3.5) continue;  // it may be after the last event
      if (sigma < 1e-6) ++predicted;
      EXPECT_TRUE(std::any_of(events.begin(), events.end(), [&](const ContactEvent& event) {
        return std::abs(event.t - t) < 4.0 * sigma + 1e-9;
      })) << row;
    }
    if (name == std::string("predictions.csv")) {
      EXPECT_GT(predicted, 0);
    }
  }
  EXPECT_NE(text("run.lcmlog").find("SPRAG_PREDICTION"), std::string::npos);
}

// Smoothing makes the estimate accurate from the first tick on.
TEST_F(LiveAndOfflineTest, SmoothedReplayIsAccurateFromFirstTick) {
  const std::string with_jitter = read_text(scene("paper_beam")) + "\n[events]\njitter = 1e-6\n";
  write_text(file("with_jitter.toml"), with_jitter);
  simulate(scene("paper_beam"), "20", "0.1");
  const Arguments more{"--tick", "0.1", "--duration", "20", "--report", file("report.json")};
  const auto energy_at_the_start = [&](const Arguments& how) {
    const std::string estimate = replay(file("with_jitter.toml"), file("events.csv"), more + how);
    EXPECT_EQ(read_states_file(estimate).size(), 201U);
    EXPECT_EQ(run("sync_logger", {scene("paper_beam"), "--truth", file("truth.csv"), "--estimate",
                                  estimate, "--csv", file("V.csv")})
                  .code,
              0);
    return read_sync(file("V.csv")).front().v;
  };
  EXPECT_GT(energy_at_the_start({}), 0.1);
  EXPECT_LT(energy_at_the_start({"--smooth"}), 1e-6);
  EXPECT_EQ(json("report.json").at("smoothed_ticks"), 201);
  // A recording without its beginning is not smoothed.
  write_text(file("late.csv"), "t,contact,closed\n0.5,1,0\n");
  EXPECT_EQ(run("observer", {file("with_jitter.toml"), "--replay", file("late.csv"), "--smooth",
                             "--states", file("late_states.csv")})
                .code,
            2);
}

TEST_F(LiveAndOfflineTest, TickAtDurationIsIncludedForAnyTickLength) {
  // As doubles 0.1 and the others are slightly larger than the decimal numbers.
  for (const auto& [tick, rows] :
       std::map<std::string, std::size_t>{{"0.1", 401}, {"0.02", 2001}, {"0.001", 40001}}) {
    simulate(scene("paper_beam"), "40", tick);
    EXPECT_EQ(read_states_file(file("truth.csv")).size(), rows) << tick;
    const std::string estimate =
        replay(scene("paper_beam"), file("events.csv"), {"--tick", tick, "--duration", "40"});
    EXPECT_EQ(read_states_file(estimate).size(), rows) << tick;
  }
}

TEST_F(LiveAndOfflineTest, ObserverDoesNotNeedTheTruth) {
  const std::string beam = scene("paper_beam");
  run_live(beam, "30", "0.015625", {});
  const std::string with_truth = text("live.csv");
  const Arguments more{"--tick", "0.015625", "--duration", "30"};
  EXPECT_TRUE(with_truth == read_text(replay(beam, file("events.csv"), more)));

  set_url(udp_url());
  run_live(beam, "30", "0.015625", {}, {"--no-truth"});
  EXPECT_TRUE(text("live.csv") == read_text(replay(beam, file("events.csv"), more)));
  EXPECT_TRUE(text("live.csv") == with_truth) << "the observer's output depends on the truth";
  EXPECT_EQ(count_rows(file("sync.csv")), 0U) << "truth was sent in spite of --no-truth";
}

}  // namespace
}  // namespace sprag::test
