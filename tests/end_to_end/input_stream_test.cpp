// A streamed excitation over a bad network between master and observer. The network harms both
// channels, or one of them. The live run is compared with the replay of a log without losses.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>
#include <set>
#include <tuple>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/messages.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/end_to_end/fixture.h"
#include "tests/support/streamed_scene.h"

namespace sprag::test {
namespace {

class InputStreamTest : public EndToEnd {
 protected:
  /// Writes the streamed scene with these further lines in [excitation].
  std::string streamed(const std::string& lines = {}) {
    return write_text(file("streamed.toml"), streamed_scene(lines));
  }

  Process& start_relay(std::uint16_t near, std::uint16_t far, const Arguments& plan) {
    Process& relay =
        start_command(Arguments{RELAY, std::to_string(near), std::to_string(far)} + plan);
    EXPECT_TRUE(in_time([&] { return relay.err().find("listening") != std::string::npos; }));
    return relay;
  }
};

TEST_F(InputStreamTest, SettledTicksEqualTheReplayBitForBitInSpiteOfTrouble) {
  const std::string machine = streamed();
  write_text(machine, read_text(machine) +
                          "\n[parameters]\nimpact.restitution = { sigma = 0.001 }\n"
                          "excitation.gain = { sigma = 0.001 }\n");
  const std::uint16_t near = free_port(), far = free_port();
  Process& relay = start_relay(
      near, far,
      {"--seed", "26", "--loss", "0.3", "--double", "0.2", "--reorder", "0.25", "--delay", "50"});
  set_url(udp_url(far));
  const Arguments how{"--duration", "6", "--tick", "0.005"};
  Process& observer = start_listening(
      "observer",
      Arguments{machine, "--states", file("live.csv"), "--report", file("o.json")} + how);
  set_url(udp_url(near));
  Process& recorder = start_recorder(file("run.lcmlog"), "SPRAG_.*");
  Process& master = start_master(
      Arguments{machine, "--publish-input", "--speed", "2", "--states", file("truth.csv")} + how);
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  end_recorder(recorder);
  relay.signal(SIGTERM);
  std::cout << end_of(relay).err;

  EXPECT_EQ(count_rows(file("live.csv")), 1201U);
  EXPECT_TRUE(text("live.csv") == read_text(replay(machine, file("run.lcmlog"), how)))
      << "live differs from the replay of the recording";
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["input"]["gaps"], 0);
  EXPECT_GE(report["input"]["samples"], 3000);
  EXPECT_EQ(report["degraded"].size(), 0U);
  EXPECT_EQ(report["unsettled_ticks"], 0);
  const double estimate = read_column(file("live.csv"), "q1").back();
  const double truth = read_column(file("truth.csv"), "q1").back();
  EXPECT_NEAR(estimate, truth, 1e-6 * std::max(1e-3, std::abs(truth)));
}

// Logs and events that `master_sim` of versions 0.2 and 0.3 has written, the second one with
// --publish-input.
TEST_F(InputStreamTest, RecordingsOfEarlierVersionsGiveTheStatesOfTheirEvents) {
  const auto expect_same = [this](const std::string& machine, const std::string& version,
                                  const Arguments& how, std::size_t rows) {
    const std::string recording = SPRAG_SOURCE_DIR "/tests/end_to_end/recordings/" + version;
    const std::string of_log =
        replay(machine, recording + ".lcmlog", how + Arguments{"--report", file("o.json")});
    const std::string of_events = replay(machine, recording + ".csv", how);
    EXPECT_EQ(count_rows(of_log), rows);
    EXPECT_TRUE(read_text(of_log) == read_text(of_events)) << version;
    EXPECT_EQ(json("o.json")["messages"]["refused"], 0) << version;
  };
  expect_same(scene("paper_beam"), "version_0.2", {"--tick", "0.015625", "--duration", "12"}, 769);
  expect_same(streamed(), "version_0.3", {"--tick", "0.005", "--duration", "1.25"}, 251);
  EXPECT_EQ(json("o.json")["input"]["refused"], 0);
  EXPECT_GT(json("o.json")["input"]["samples"], 600);
}

// The record of the scene and its stream are the same input.
TEST_F(InputStreamTest, TheStreamEqualsTheRecord) {
  const std::string machine = streamed();
  Process& recorder = start_recorder(file("run.lcmlog"), "SPRAG_.*");
  Process& master = start_master({machine, "--duration", "6", "--speed", "4", "--publish-input",
                                  "--no-truth", "--events", file("events.csv")});
  EXPECT_EQ(end_of(master).code, 0);
  end_recorder(recorder);
  EXPECT_EQ(text("run.lcmlog").find("SPRAG_TRUTH"), std::string::npos) << "--no-truth";
  const Arguments how{"--tick", "0.005", "--duration", "6"};
  const auto streamed = read_states_file(
      replay(machine, file("run.lcmlog"), how + Arguments{"--report", file("o.json")}));
  ASSERT_EQ(json("o.json")["input"]["gaps"], 0);
  const auto recorded = read_states_file(replay(machine, file("events.csv"), how));
  // Impacts and smoothing of the log are those of the record, too.
  const std::string jittered =
      write_text(file("jittered.toml"), read_text(machine) + "\n[events]\njitter = 1e-6\n");
  for (const Arguments& source :
       {Arguments{file("run.lcmlog"), "log"}, Arguments{file("events.csv"), "csv"}}) {
    const std::string name = file(source[1]);
    for (const Arguments& more : {Arguments{"--impacts", name + "_i.csv"},
                                  Arguments{"--smooth", "--states", name + "_s.csv"}}) {
      const Ended ended = run("observer", Arguments{jittered, "--replay", source[0]} + how + more);
      ASSERT_EQ(ended.code, 0) << ended.err;
    }
  }
  EXPECT_GT(count_rows(file("log_i.csv")), 20U);
  EXPECT_EQ(count_rows(file("log_i.csv")), count_rows(file("csv_i.csv")));
  const auto smoothed_log = read_states_file(file("log_s.csv"));
  const auto smoothed_csv = read_states_file(file("csv_s.csv"));
  ASSERT_EQ(smoothed_log.size(), 1201U);
  ASSERT_EQ(smoothed_csv.size(), 1201U);
  for (std::size_t k = 0; k < 1201; ++k) {
    ASSERT_NEAR(smoothed_log[k].values[0], smoothed_csv[k].values[0], 1e-9) << "k " << k;
  }
  ASSERT_EQ(streamed.size(), 1201U);
  ASSERT_EQ(recorded.size(), 1201U);
  for (std::size_t k = 0; k < streamed.size(); ++k) {
    for (std::size_t i = 0; i < streamed[k].values.size(); ++i) {
      const double scale = i < 4 ? 1e-3 : 1.0;
      ASSERT_NEAR(streamed[k].values[i], recorded[k].values[i], 1e-7 * scale) << "k " << k;
    }
  }
}

// Without the input nothing settles, the observer says so, and sigma grows.
TEST_F(InputStreamTest, AMissingInputIsReported) {
  const std::string machine = streamed();
  Process& observer =
      start_listening("observer", {machine, "--duration", "6", "--tick", "0.005", "--states",
                                   file("live.csv"), "--report", file("o.json")});
  Process& master = start_master({machine, "--duration", "4", "--no-truth"});
  EXPECT_TRUE(in_time([&] {
    return observer.err().find("no sample of the excitation for 1 s") != std::string::npos;
  })) << observer.err();
  EXPECT_EQ(end_of(master).code, 0);
  observer.signal(SIGTERM);
  const Ended ended = end_of(observer);
  EXPECT_NE(ended.err.find("no sample on SPRAG_INPUT: nothing settles"), std::string::npos)
      << ended.err;
  EXPECT_EQ(count_rows(file("live.csv")), 0U);
  EXPECT_TRUE(json("o.json")["input"]["newest"].is_null());
}

// The input stops for two seconds while the contacts go on.
TEST_F(InputStreamTest, AnInputThatStopsIsReportedAndSigmaGrows) {
  const std::string machine = streamed();
  const std::uint16_t near = free_port(), far = free_port();
  Process& relay = start_relay(near, far,
                               {"--seed", "25", "--outages", "1", "--outage", "2", "--every", "3.5",
                                "--only", "SPRAG_INPUT"});
  set_url(udp_url(far));
  Process& recorder = start_recorder(file("far.lcmlog"), "SPRAG_.*");
  Process& observer =
      start_listening("observer", {machine, "--duration", "6", "--tick", "0.005", "--states",
                                   file("live.csv"), "--report", file("o.json")});
  set_url(udp_url(near));
  Process& master = start_master({machine, "--duration", "6", "--publish-input", "--no-truth"});
  EXPECT_TRUE(in_time([&] {
    return observer.err().find("samples of the excitation arrive again") != std::string::npos;
  })) << observer.err();
  EXPECT_EQ(end_of(master).code, 0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 0);
  end_recorder(recorder);
  relay.signal(SIGTERM);
  end_of(relay);
  EXPECT_NE(ended.err.find("no sample of the excitation for 1 s"), std::string::npos);
  EXPECT_NE(ended.err.find("gaps and interpolated"), std::string::npos) << ended.err;
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["input"]["gaps"], 1);
  // Health says so as well.
  std::set<InputState> states;
  {
    ChannelLogReader log(file("far.lcmlog"));
    ChannelRecord record;
    health_t health{};
    while (log.next(record)) {
      if (record.channel != "SPRAG_HEALTH") continue;
      ASSERT_EQ(decode(record.data, health), Refusal::none);
      states.insert(InputState{health.input});
    }
  }
  EXPECT_TRUE(states.contains(InputState::received));
  EXPECT_TRUE(states.contains(InputState::silent));
  EXPECT_FALSE(states.contains(InputState::none));
  EXPECT_GT(report["input"]["filled"], 500);
  ASSERT_EQ(report["input"]["lost"].size(), 1U);
  EXPECT_GT(report["input"]["lost"][0]["to"],
            report["input"]["lost"][0]["from"].get<double>() + 1.0);
  // Provisional estimates 0.3 s after the newest sample, against those just after one. An infinite
  // deviation means that the estimate is unknown.
  ChannelLogReader log(file("far.lcmlog"));
  ChannelRecord record;
  estimate_t estimate{};
  double before = infinity, within = infinity;
  int within_count = 0;
  while (log.next(record)) {
    if (record.channel != "SPRAG_ESTIMATE") continue;
    ASSERT_EQ(decode(record.data, estimate), Refusal::none);
    if (estimate.deviations == 0 || estimate.settled_tick < 0) continue;
    const double age = 0.005 * static_cast<double>(estimate.tick - estimate.settled_tick);
    const double sigma = as_vector(estimate.sigma_u).maxCoeff();
    if (estimate.t > 1.0 && estimate.t < 1.4 && age < 0.02) before = std::min(before, sigma);
    if (age < 0.3) continue;
    within = std::min(within, sigma);
    ++within_count;
  }
  std::cout << "sigma of a velocity: " << before << ", after 0.3 s without input at least "
            << within << " in " << within_count << " estimates\n";
  EXPECT_GT(within_count, 50);
  ASSERT_LT(before, infinity);
  EXPECT_GT(within, 5.0 * before);
}

TEST_F(InputStreamTest, WhatAStreamExcludes) {
  const std::string machine = streamed();
  const std::string delayed =
      write_text(file("delayed.toml"),
                 read_text(machine) + "\n[parameters]\nexcitation.delay = { sigma = 1e-5 }\n");
  const std::string stream = "streamed excitation";
  for (const auto& [program, arguments, why] :
       std::vector<std::tuple<std::string, Arguments, std::vector<std::string>>>{
           {"observer", {machine, "--predict", "1"}, {"--predict", stream}},
           {"observer", {machine, "--impacts", file("i.csv")}, {"--impacts", stream}},
           {"observer", {machine, "--estimator", "adaptive"}, {"--estimator adaptive", stream}},
           {"observer", {delayed}, {"excitation.delay"}},
           {"observer",
            {machine, "--duration", "700"},
            {"--duration is longer than excitation.stream_duration"}},
           {"master_sim",
            {scene("paper_beam"), "--publish-input", "--duration", "1"},
            {"--publish-input: paper_beam must have a recorded"}}}) {
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    for (const std::string& part : why)
      EXPECT_NE(ended.err.find(part), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace sprag::test
