// Records of events, before any fit: would catch paths across gaps and merged bounces that pass.
#include <gtest/gtest.h>

#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/identification/events.h"
#include "sprag/detail/identification/record_checks.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::events_of;
using test::shipped_scene;

// The path is interrupted at a gap.
TEST(Record, IsSplitAtGap) {
  std::vector<ContactEvent> events;
  for (int i = 1; i <= 20; ++i) events.push_back({1.0 * i, 0, ContactEventKind::pulse});
  const FamilyFlight flight(shipped_scene("paper_beam"), {});
  const auto starts = [&](const std::vector<EventGap>& gaps) {
    IdentificationSettings settings;
    settings.gaps = gaps;
    std::vector<double> found;
    for (const FitStretch& stretch : fit_record(events, settings, 1e-3, flight).stretches) {
      found.push_back(stretch.start);
    }
    std::sort(found.begin(), found.end());
    return found;
  };
  using Times = std::vector<double>;
  EXPECT_EQ(starts({}), Times{1.0});
  EXPECT_EQ(starts({{8.5, 8.5}}), Times{1.0});
  EXPECT_EQ(starts({{8.5, 8.6}}), (Times{1.0, 9.0}));
  EXPECT_EQ(starts({{4.5, 6.5}, {15.0, 15.5}}), (Times{1.0, 5.0, 6.0, 7.0, 16.0}));
}

TEST(EventGaps, AdjacentGapsAreMerged) {
  using Gaps = std::vector<EventGap>;
  Gaps gaps;
  for (const EventGap gap : Gaps{{5, 6}, {1, 2}, {8, 9}, {3, 3}}) add(gap, gaps);
  EXPECT_EQ(gaps, (Gaps{{1, 2}, {3, 3}, {5, 6}, {8, 9}}));
  add({2.5, 5}, gaps);
  EXPECT_EQ(gaps, (Gaps{{1, 2}, {2.5, 6}, {8, 9}}));
  add({0, 10}, gaps);
  EXPECT_EQ(gaps, (Gaps{{0, 10}}));
}

// A sensor that reports one event per chatter, and one that reports each impact.
TEST(RecordChecks, DetectsSensorThatMergesBounces) {
  for (const char* name : {"paper_beam_chatter", "steel_ruler"}) {
    const Scene scene = shipped_scene(name);
    const std::vector<ContactEvent> all =
        events_of(scene, name == std::string("steel_ruler") ? 10.0 : 120.0);
    EXPECT_FALSE(has_merged_bounces(scene, all)) << name;
    const double least = 0.01;
    std::vector<ContactEvent> merged;
    double last = -least;
    for (const ContactEvent& event : all) {
      if (event.kind != ContactEventKind::opens && event.t - last > least) merged.push_back(event);
      if (event.kind != ContactEventKind::opens) last = event.t;
    }
    ASSERT_LT(merged.size(), all.size() / 2) << name;
    ASSERT_GT(merged.size(), 10U) << name;
    EXPECT_TRUE(has_merged_bounces(scene, merged)) << name;
  }
}

}  // namespace
}  // namespace sprag
