// The rules that turn the edges of contacts and levels into events.
#include "sprag/detail/import/recorded_edges.h"

#include <gtest/gtest.h>

#include <vector>

#include "sprag/detail/import/level_edges.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using Events = std::vector<ContactEvent>;
using Times = std::vector<double>;

RecordedEvents contacts(const Times& closings, const Times& openings, const EdgeRules& rules = {}) {
  return events_of(0, {closings, openings, {}}, rules);
}

RecordedEvents impacts(const Times& times, const EdgeRules& rules = {}) {
  return events_of(0, {{}, {}, times}, rules);
}

/// The refusals, after the list and the index of their edge.
std::vector<std::string> texts(const std::vector<RefusedEdge>& refused) {
  std::vector<std::string> result;
  for (const RefusedEdge& edge : refused) {
    const char* const list = edge.kind == EdgeKind::closes  ? "closing "
                             : edge.kind == EdgeKind::opens ? "opening "
                                                            : "impact ";
    result.push_back(list + std::to_string(edge.index) + " " + edge.what);
  }
  return result;
}

TEST(LevelEdgesTest, TheFirstLevelIsAnEdgeOnlyOfAKnownChannel) {
  using enum LevelChange;
  const auto changes = [](LevelEdges edges) {
    std::vector<LevelChange> result;
    for (const double level : {1.0, 1.0, 0.0, 0.4, 0.6}) result.push_back(edges.take(level));
    return result;
  };
  EXPECT_EQ(changes(LevelEdges(0.5, false)),
            (std::vector<LevelChange>{none, none, falls, none, rises}));
  EXPECT_EQ(changes(LevelEdges(0.5, true)),
            (std::vector<LevelChange>{none, none, rises, none, falls}));
  EXPECT_EQ(changes(LevelEdges(0.5, false, true)),
            (std::vector<LevelChange>{rises, none, falls, none, rises}));
  LevelEdges edges(0.5, true);
  EXPECT_FALSE(edges.high());
  edges.take(0.5);
  EXPECT_EQ(edges.high(), true);
}

TEST(RecordedEdgesTest, EdgesBecomeEvents) {
  struct Case {
    const char* what;
    RecordedEvents made;
    Events events;
    EdgeCounts counts;
  };
  const EdgeRules debounce{.debounce = 0.005}, short_ones{.pulse_shorter_than = 0.005};
  const EdgeRules both{.debounce = 0.005, .pulse_shorter_than = 0.010};
  const std::vector<Case> cases{
      {"impacts outside the run are skipped",
       impacts({-1, -0.001, 0, 4, 5, 5.001}, {.duration = 5.0}),
       {{0, 0, pulse}, {4, 0, pulse}, {5, 0, pulse}},
       {.pulses = 3, .before_start = 2, .after_duration = 1}},
      {"contacts close and open",
       contacts({1, 3.5, 5}, {2, 3.5}),
       {{1, 0, closes}, {2, 0, opens}, {3.5, 0, pulse}, {5, 0, closes}},
       {.pulses = 1, .sustained = 2}},
      {"one instant may open and close",
       contacts({1, 2, 3}, {2, 3, 3}),
       {{1, 0, closes}, {2, 0, opens}, {2, 0, closes}, {3, 0, opens}, {3, 0, pulse}},
       {.pulses = 1, .sustained = 2}},
      {"a contact that is closed at the start closes there",
       contacts({-1}, {2}),
       {{0, 0, closes}, {2, 0, opens}},
       {.sustained = 1}},
      {"and may stay closed", contacts({-1}, {}), {{0, 0, closes}}, {.sustained = 1}},
      {"contacts before the start", contacts({-3, -1}, {-2, 0}), {}, {.before_start = 4}},
      {"a contact that outlasts the duration stays closed",
       contacts({1, 7}, {6, 8}, {.duration = 5.0}),
       {{1, 0, closes}},
       {.sustained = 1, .after_duration = 3}},
      {"bounces of impacts chain from the last one",
       impacts({0.010, 0.013, 0.017, 0.022, 0.026}, debounce),
       {{0.010, 0, pulse}, {0.022, 0, pulse}},
       {.pulses = 2, .merged = 3}},
      // Gaps of 3, 4 and 5 ms; the last one is not shorter than the limit.
      {"bounces of contacts chain from the last opening",
       contacts({0.100, 0.113, 0.119, 0.155}, {0.110, 0.115, 0.150, 0.160}, debounce),
       {{0.100, 0, closes}, {0.150, 0, opens}, {0.155, 0, closes}, {0.160, 0, opens}},
       {.sustained = 2, .merged = 2}},
      {"a bounce may stay closed",
       contacts({1, 1.002}, {1.001}, debounce),
       {{1, 0, closes}},
       {.sustained = 1, .merged = 1}},
      {"short contacts are pulses at their closing",
       contacts({0.1, 0.2, 0.3}, {0.104999, 0.205, 0.305001}, short_ones),
       {{0.1, 0, pulse},
        {0.2, 0, closes},
        {0.205, 0, opens},
        {0.3, 0, closes},
        {0.305001, 0, opens}},
       {.pulses = 1, .sustained = 2}},
      {"each part is short, but the whole is not",
       contacts({0.100, 0.106, 0.111}, {0.104, 0.109, 0.112}, both),
       {{0.100, 0, closes}, {0.112, 0, opens}},
       {.sustained = 1, .merged = 2}},
      {"the whole is short",
       contacts({0.100, 0.106}, {0.104, 0.109}, both),
       {{0.100, 0, pulse}},
       {.pulses = 1, .merged = 1}}};
  for (const auto& [what, made, events, counts] : cases) {
    SCOPED_TRACE(what);
    EXPECT_EQ(made.events, events);
    EXPECT_TRUE(made.refused.empty());
    EXPECT_EQ(made.counts.pulses, counts.pulses);
    EXPECT_EQ(made.counts.sustained, counts.sustained);
    EXPECT_EQ(made.counts.merged, counts.merged);
    EXPECT_EQ(made.counts.before_start, counts.before_start);
    EXPECT_EQ(made.counts.after_duration, counts.after_duration);
  }
  // The whole length counts, not the part after the start.
  EXPECT_TRUE(contacts({-1}, {1}, {.pulse_shorter_than = 3.0}).events.empty());
}

TEST(RecordedEdgesTest, ContradictoryEdgesAreRefused) {
  const RecordedEvents result = contacts({1, 1, 1.5, 3}, {0.5, 2, 4, 5});
  EXPECT_EQ(result.events,
            (Events{{1.0, 0, closes}, {2.0, 0, opens}, {3.0, 0, closes}, {4.0, 0, opens}}));
  EXPECT_EQ(
      texts(result.refused),
      (std::vector<std::string>{"opening 0 opens at t = 0.5, but is open already",
                                "closing 1 closes at t = 1, but is closed already since t = 1",
                                "closing 2 closes at t = 1.5, but is closed already since t = 1",
                                "opening 3 opens at t = 5, but is open already"}));
  EXPECT_EQ(texts(contacts({2, 2}, {2, 2}).refused),
            (std::vector<std::string>{"closing 1 closes at t = 2, where it has closed already",
                                      "opening 1 opens at t = 2, but is open already"}));
  EXPECT_EQ(texts(impacts({1, 1, 2}).refused),
            (std::vector<std::string>{"impact 1 impact at t = 1, where there is one already"}));
  // Repeated closings and openings are bounces.
  const RecordedEvents bounces =
      contacts({0.100, 0.102, 0.106}, {0.110, 0.112, 0.130}, {.debounce = 0.005});
  EXPECT_EQ(bounces.events, (Events{{0.100, 0, closes}, {0.112, 0, opens}}));
  EXPECT_EQ(bounces.counts.merged, 3);
  EXPECT_EQ(texts(bounces.refused),
            (std::vector<std::string>{"opening 2 opens at t = 0.13, but is open already"}));
}

TEST(RecordedEdgesTest, SpanOfLimitIsNotShorterDespiteRounding) {
  // In doubles every second of these differences is below 5 ms.
  Times on, off;
  for (int i = 1; i <= 1000; ++i) {
    on.push_back(13 * i / 1000.0);
    off.push_back((13 * i + 5) / 1000.0);
  }
  EXPECT_EQ(contacts(on, off, {.pulse_shorter_than = 0.005}).counts.sustained, 1000);
  EXPECT_EQ(contacts(on, off, {.pulse_shorter_than = 0.005000001}).counts.pulses, 1000);
  EXPECT_EQ(contacts(on, off, {.debounce = 0.008}).counts.merged, 0);
  EXPECT_EQ(contacts(on, off, {.debounce = 0.008000001}).counts.merged, 999);
}

}  // namespace
}  // namespace sprag
