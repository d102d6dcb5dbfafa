// A run's report of its own error, on stderr and in the report file.
#include "observer/confidence_record.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "sprag/detail/live/time_line.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

struct Said {
  std::string lines;
  nlohmann::ordered_json report;
};

/// Report of a run that receives `events` tick by tick.
template <Estimator E>
Said said_of(const Scene& scene, const std::vector<ContactEvent>& events, double end) {
  E estimator(scene, 1e-2);
  Confidence confidence = estimator.no_confidence();
  ConfidenceRecord record;
  std::ostringstream out;
  run_time_line(estimator, scene, events, end, false, [&](const auto& state) {
    estimator.confidence(state, confidence);
    record.note(tick_instant(state.tick, 1e-2).hi, confidence, out);
    record.conclude(confidence, 0.5);
  });
  Said said;
  record.print(false, out);
  said.lines = out.str();
  record.to_json(said.report);
  return said;
}

struct MissingEvent {
  std::vector<ContactEvent> events;
  double t, next;
};

MissingEvent missing_event(const Scene& scene, double end) {
  MissingEvent missing{master_events(scene, end), 0.0, 0.0};
  missing.t = missing.events[30].t;
  missing.next = missing.events[31].t;
  missing.events.erase(missing.events.begin() + 30);
  return missing;
}

template <Estimator E>
void expect_missing_event_reported(const std::string& words) {
  const Scene& scene = cached_scene("paper_beam.toml");
  const MissingEvent missing = missing_event(scene, 30.0);
  const Said said = said_of<E>(scene, missing.events, 30.0);
  const auto& confidence = said.report["confidence"];
  ASSERT_GE(confidence["inconsistencies"], 1) << said.lines;
  const auto& first = confidence["first_inconsistencies"][0];
  EXPECT_EQ(first["suspicion"], "missing event");
  EXPECT_EQ(first["contact"], 1);
  EXPECT_GT(first["t"], missing.t);
  EXPECT_LT(first["t"], missing.next);
  EXPECT_NE(said.lines.find(words), std::string::npos) << said.lines;
}

TEST(ConfidenceRecord, ReportsMissingEventOfTimingFilter) {
  expect_missing_event_reported<TimingEstimator>(", contact 1: an event has not come");
}

TEST(ConfidenceRecord, ReportsMissingEventOfBoth) {
  expect_missing_event_reported<BothEstimator>("a missing event? The estimate is");
}

TEST(ConfidenceRecord, ReportsNothingWithCompleteEvents) {
  const Scene& scene = cached_scene("paper_beam.toml");
  const Said said = said_of<TimingEstimator>(scene, master_events(scene, 30.0), 30.0);
  EXPECT_EQ(said.report["confidence"]["inconsistencies"], 0);
  EXPECT_EQ(said.report["confidence"]["forgotten_covariances"], 0);
  EXPECT_EQ(said.lines, "timing filter: did not fit 0 times\n");
}

// The same for a wrong model, and that no sigma is claimed.
TEST(ConfidenceRecord, ReportsModelMismatchOfTimingFilter) {
  const Scene& scene = cached_scene("paper_beam.toml");
  Scene given = scene;
  given.model.contacts[0].restitution *= 0.98;
  given.prior.jitter = 1e-4;
  const Said said = said_of<TimingEstimator>(given, master_events(scene, 100.0), 100.0);
  const auto& confidence = said.report["confidence"];
  EXPECT_GE(confidence["inconsistencies"], 1);
  EXPECT_EQ(confidence["first_inconsistencies"][0]["suspicion"], "model");
  EXPECT_EQ(confidence["sigma_q"].dump(), "[null,null,null]");
  EXPECT_NE(said.lines.find(", contact 1: the timing filter does not fit, "), std::string::npos);
  EXPECT_NE(said.lines.find("Sigma is infinite until events have fitted again."),
            std::string::npos);
}

// For a machine without external force no later event makes the scale observable again.
TEST(ConfidenceRecord, ReportsPermanentLossOfScale) {
  Scene scene = cached_scene("paper_beam.toml");
  scene.model.forces.clear();
  scene.model.contacts[0].motion = {};
  const Said said = said_of<TimingEstimator>(scene, missing_event(scene, 100.0).events, 100.0);
  EXPECT_GE(said.report["confidence"]["inconsistencies"], 1) << said.lines;
  EXPECT_NE(said.lines.find("Sigma is infinite from here on: "), std::string::npos) << said.lines;
  EXPECT_EQ(said.lines.find("have fitted again"), std::string::npos) << said.lines;
}

}  // namespace
}  // namespace sprag
