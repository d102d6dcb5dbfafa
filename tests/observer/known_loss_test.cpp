// Reports of inconsistent events at a known loss of records.
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "observer/confidence_record.h"
#include "observer/estimation.h"
#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

/// Reports of a run whose messages between `from` and `to` are lost; each message repeats `repeats`
/// records.
struct LossyRun {
  std::vector<Inconsistency> found;
  std::string lines;
  std::size_t gaps = 0;
};

using Times = std::vector<std::pair<double, double>>;

LossyRun run_with_losses(const Scene& scene, EstimatorKind kind, const Times& lost, double end) {
  constexpr int repeats = 1;
  ObserverOptions options;
  options.tick = 5e-3;
  options.estimator = kind;
  Estimation estimation(scene, options, 1);
  EstimateSample sample = estimation.empty_sample();
  ConfidenceRecord record;
  std::ostringstream out;
  LossyRun run;
  const std::vector<ContactEvent> events = master_events(scene, end);
  const auto times = event_and_heartbeat_times(events, 0.01, end);
  bool first = true;
  std::int64_t count = 0;
  for (const ContactMessage& whole : reports_at(times, events, 1)) {
    const bool is_lost = std::any_of(lost.begin(), lost.end(), [&](const auto& of) {
      return of.first < whole.horizon && whole.horizon < of.second;
    });
    if (is_lost) continue;
    const ContactMessage report = with_repeats(whole, repeats);
    if (first) {
      estimation.time_line.restart(report);
    } else {
      estimation.time_line.receive(report);
    }
    first = false;
    estimation.time_line.run(
        0, [](const auto&) {},
        [&](const Estimation::State& state) {
          estimation.note(state, sample);
          record.note(sample.t, sample.confidence, out);
          if (sample.confidence.inconsistencies > count) {
            run.found.push_back(sample.confidence.last);
          }
          count = sample.confidence.inconsistencies;
          return true;
        });
  }
  run.lines = out.str();
  run.gaps = estimation.time_line.events().degraded().size();
  return run;
}

TEST(KnownLoss, IsReportedAsCause) {
  const Scene& scene = cached_scene("paper_beam_chatter.toml");
  for (const EstimatorKind kind : {EstimatorKind::both, EstimatorKind::timing}) {
    int found = 0;
    for (double from = 12.0; from < 30.0; from += 2.9) {
      SCOPED_TRACE(from);
      const LossyRun run = run_with_losses(scene, kind, {{from, from + 2.5}}, from + 8.0);
      if (run.gaps == 0) continue;
      for (const Inconsistency& one : run.found) {
        ++found;
        EXPECT_NE(one.suspicion, Suspicion::spurious_event) << one.t;
        EXPECT_TRUE(one.known_loss) << one.t;
      }
      EXPECT_EQ(run.lines.find("spurious"), std::string::npos) << run.lines;
    }
    EXPECT_GT(found, 3);
  }
}

// The second loss comes while the track is still tentative.
TEST(KnownLoss, IsReportedAgainWhileTrackIsTentative) {
  const Scene& scene = cached_scene("paper_beam.toml");
  const LossyRun run =
      run_with_losses(scene, EstimatorKind::both, {{20.2, 22.5}, {26.4, 28.5}}, 40.0);
  EXPECT_EQ(run.gaps, 2U);
  int after_second = 0;
  for (const Inconsistency& one : run.found) {
    if (one.t > 26.4) ++after_second;
    EXPECT_TRUE(one.known_loss) << one.t;
  }
  EXPECT_GT(after_second, 0) << run.lines;
  EXPECT_NE(run.lines.find("records before this event were lost"), std::string::npos) << run.lines;
}

// One line per tick, with the number of inconsistencies.
TEST(KnownLoss, SeveralInconsistenciesOfOneTickAreCounted) {
  Confidence confidence;
  confidence.has_filter = confidence.has_replica = true;
  confidence.inconsistencies = 3;
  confidence.last = {1.0, 0, Suspicion::model, 50.0};
  ConfidenceRecord record;
  std::ostringstream out;
  record.note(1.0, confidence, out);
  EXPECT_NE(out.str().find("In the same tick it did not fit 2 times before."), std::string::npos)
      << out.str();
}

}  // namespace
}  // namespace sprag
