// A live run gives the same result as an offline run with the same events.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/messages.h"
#include "sprag/events_file.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

const Arguments to_40{"--tick", "0.015625", "--duration", "40"};

class LiveAndOfflineTest : public EndToEnd {
 protected:
  /// Runs the three programs; files live.csv, events.csv, sync.csv, run.lcmlog. The observer may
  /// have another scene than the master.
  void run_live(const std::string& of_master, const std::string& of_observer,
                const std::string& duration, const Arguments& more) {
    Process& logger =
        start_listening("sync_logger", {of_master, "--duration", duration, "--csv",
                                        file("sync.csv"), "--record", file("run.lcmlog")});
    const Arguments how{"--duration", duration, "--tick", "0.015625"};
    Process& observer = start_listening(
        "observer", Arguments{of_observer, "--states", file("live.csv")} + how + more);
    Process& master =
        start_master(Arguments{of_master, "--speed", "20", "--events", file("events.csv")} + how);
    EXPECT_EQ(end_of(master).code, 0);
    EXPECT_EQ(end_of(observer).code, 0);
    EXPECT_EQ(end_of(logger).code, 0);
  }

  void expect_settled_ticks_as_in_replays(const std::string& of_master,
                                          const std::string& of_observer, const Arguments& how) {
    run_live(of_master, of_observer, "40", how);
    const std::string live = text("live.csv");
    EXPECT_EQ(count_rows(file("live.csv")), 2561U);
    for (const char* recording : {"events.csv", "run.lcmlog"}) {
      EXPECT_TRUE(live == read_text(replay(of_observer, file(recording), to_40 + how)))
          << "live differs from the replay of " << recording;
    }
  }

  /// V of the estimate live.csv, offline.
  std::vector<SyncLine> offline_energy(const std::string& machine) {
    simulate(machine, "40", "0.015625");
    EXPECT_EQ(run("sync_logger", {machine, "--truth", file("truth.csv"), "--estimate",
                                  file("live.csv"), "--csv", file("offline.csv")})
                  .code,
              0);
    return read_sync(file("offline.csv"));
  }
};

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
  expect_settled_ticks_as_in_replays(scene("paper_beam"), file("wrong.toml"),
                                     {"--estimator", "adaptive", "--report", file("report.json")});
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
  EXPECT_LT(offline_energy(scene("paper_beam")).back().v, 1e-20);
}

// A machine with all that an observer computes with its settled ticks: both estimators, a bound,
// named outputs, impacts. Estimates of the present that are published earlier must not affect them.
TEST_F(LiveAndOfflineTest, SettledTicksEqualTheReplayBitForBitThroughChatter) {
  const std::string machine =
      write_text(file("all.toml"), read_text(scene("paper_beam_chatter")) + R"(
[tolerance]
time = 1e-6
[[output]]
name = "middle"
position = 0.5
[[output]]
name = "tip_speed"
position = 1.0
quantity = "velocity"
)");
  const Arguments impacts{"--impacts", file("impacts.csv")};
  run_live(machine, machine, "40", impacts);
  const std::string live = text("live.csv"), live_impacts = text("impacts.csv");
  EXPECT_GT(count_rows(file("impacts.csv")), 30U);
  for (const char* recording : {"events.csv", "run.lcmlog"}) {
    SCOPED_TRACE(recording);
    EXPECT_TRUE(live == read_text(replay(machine, file(recording), to_40 + impacts)));
    EXPECT_TRUE(live_impacts == text("impacts.csv"));
  }
  EXPECT_NE(text("run.lcmlog").find("SPRAG_IMPACTS"), std::string::npos);
  const std::vector<double> B = read_column(file("live.csv"), "B");
  ASSERT_EQ(B.size(), 2561U);
  EXPECT_EQ(std::ranges::count_if(B, [](double b) { return std::isinf(b); }), 1);

  // The logger's energies are those of the files.
  const std::vector<SyncLine> offline = offline_energy(machine),
                              energies = read_sync(file("sync.csv"));
  EXPECT_GE(energies.size(), 2432U);  // UDP may lose some
  for (const SyncLine& row : energies) {
    const SyncLine& same = offline.at(static_cast<std::size_t>(row.k));
    EXPECT_EQ(row.t, same.t);
    EXPECT_NEAR(row.v, same.v, std::max(1e-12 * same.v, 1e-20)) << "k " << row.k;
  }
  EXPECT_LT(offline.back().v, 1e-2 * offline.front().v);

  // The named outputs on the bus are those of the file.
  ChannelLogReader log(file("run.lcmlog"));
  ChannelRecord record;
  std::map<std::string, std::vector<double>> columns;
  for (const char* name : {"middle", "tip_speed"}) {
    for (const std::string& column : {std::string(name), std::string("sigma_") + name})
      columns[column] = read_column(file("live.csv"), column);
  }
  std::set<std::int64_t> settled;
  std::size_t provisional = 0, known = 0;
  while (log.next(record)) {
    if (record.channel != "SPRAG_OUTPUTS") continue;
    outputs_t message;
    ASSERT_EQ(decode(record.data, message), Refusal::none);
    EXPECT_EQ(message.name, (std::vector<std::string>{"middle", "tip_speed"}));
    if (message.settled == 0) {
      ++provisional;
      continue;
    }
    settled.insert(message.tick);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto row = static_cast<std::size_t>(message.tick);
      const double sigma = columns["sigma_" + message.name[i]].at(row);
      EXPECT_EQ(message.value.at(i), columns[message.name[i]].at(row)) << message.tick;
      EXPECT_EQ(message.sigma.at(i), sigma) << message.tick;
      known += std::isfinite(sigma) ? 1 : 0;
    }
  }
  EXPECT_GE(settled.size(), 2432U);
  EXPECT_GT(provisional, 0U);
  EXPECT_GT(known, 0U);
}

// The observer's clock is the machine's: its estimates are those from the true times.
TEST_F(LiveAndOfflineTest, AContactClockThatIsFastDoesNotChangeTheEstimates) {
  const std::string beam = scene("paper_beam");
  const std::string clocked =
      write_text(file("clock.toml"), read_text(beam) + "\n[clock]\nrate = 1.0002\noffset = 0.37\n");
  expect_settled_ticks_as_in_replays(clocked, clocked, {});
  const auto estimate = read_states_file(file("live.csv"));
  const auto expected = read_states_file(replay(beam, simulate(beam, "40", "1"), to_40));
  ASSERT_EQ(estimate.size(), expected.size());
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    ASSERT_EQ(estimate[k].t, expected[k].t);
    for (std::size_t i = 0; i < estimate[k].values.size(); ++i)
      ASSERT_NEAR(estimate[k].values[i], expected[k].values[i], 1e-9) << "tick " << k;
  }
}

// A live observer may predict once for several settled events.
TEST_F(LiveAndOfflineTest, PredictionsMatchTheMaster) {
  const std::string ball = scene("bouncing_ball");
  const Arguments how{"--predict", "2", "--predictions"};
  run_live(ball, ball, "4", how + Arguments{file("live_predictions.csv")});
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

}  // namespace
}  // namespace sprag::test
