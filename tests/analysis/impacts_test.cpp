// Impacts and predictions of a recording, on a machine with two stops.
#include "sprag/impacts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sprag/prediction.h"
#include "sprag/simulate.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

TEST(Impacts, FollowTheImpactLaw) {
  const Scene scene = shipped_scene("two_stops_beam");
  const Simulation machine = simulate(scene.model, scene.truth.start, 30.0, 0.0);
  std::vector<ContactEvent> events = machine.events;
  // Contradicts the events before it, and is skipped.
  events.push_back({events[4].t + 1e-6, events[4].contact, ContactEventKind::opens});
  const std::vector<ImpactRecord> records = impacts(scene, events, 30.0);
  ASSERT_EQ(records.size(), machine.events.size());
  int known = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const ImpactRecord& record = records[i];
    EXPECT_EQ(record.t, machine.events[i].t);
    EXPECT_EQ(record.contact, machine.events[i].contact);
    if (record.kind != ContactEventKind::pulse || !std::isfinite(record.before.sigma)) continue;
    const double epsilon =
        scene.model.contacts[static_cast<std::size_t>(record.contact)].restitution;
    EXPECT_NEAR(record.after.value, -epsilon * record.before.value, 1e-9);
    EXPECT_GT(record.impulse.value, -4.0 * record.impulse.sigma);
    ++known;
  }
  EXPECT_GT(known, 20);
}

TEST(Impacts, PredictionsAreTheLaterEvents) {
  const Scene scene = shipped_scene("lab_rig");
  const Simulation machine = simulate(scene.model, scene.truth.start, 25.0, 0.0);
  const Prediction prediction = predict(scene, machine.events, 20.0, 2.0);
  EXPECT_EQ(prediction.made_at, 20.0);
  ASSERT_GE(prediction.events.size(), 2U);
  std::size_t i = 0;
  while (machine.events[i].t <= 20.0) ++i;
  for (const PredictedEvent& event : prediction.events) {
    EXPECT_NEAR(event.t, machine.events[i].t, 1e-6 + 5.0 * event.sigma);
    EXPECT_EQ(event.contact, machine.events[i++].contact);
  }
}

TEST(Impacts, WrongArgumentsAreRefused) {
  const Scene scene = shipped_scene("lab_rig");
  EXPECT_THROW(impacts(scene, {}, -1.0), std::invalid_argument);
  EXPECT_THROW(impacts(scene, {}, 1.0, {.tick = 0.0}), std::invalid_argument);
  EXPECT_THROW(predict(scene, {}, 1.0, 0.0), std::invalid_argument);
  EXPECT_THROW(predict(scene, {}, NAN, 1.0), std::invalid_argument);
  EXPECT_TRUE(predict(scene, {}, 1.0, 1.0).events.empty());
}

}  // namespace
}  // namespace sprag::test
