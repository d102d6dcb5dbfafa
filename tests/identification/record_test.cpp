#include "sprag/detail/identification/record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <complex>

#include "sprag/detail/identification/linear_path.h"
#include "sprag/detail/identification/record_checks.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/detail/mechanics/instant.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::events_of;
using test::shipped_scene;

RecordSettings record_of(double close) {
  RecordSettings record;
  record.close = close;
  return record;
}

// At a release the machine's own state has neither a gap nor a gap velocity.
TEST(Record, AStretchBeginsWithTheReleaseOfASustainedContact) {
  const Scene scene = shipped_scene("paper_beam_chatter");
  const auto events = events_of(scene, 40.0);
  const MachineFamily family(scene, {});
  const Machine machine = family.at(family.nominal());
  const Eigen::Index n = family.n();
  const Stretches stretches = cut(events, record_of(1e-3), 4);
  int releases = 0;
  for (const Stretch& stretch : stretches) {
    if (stretch.closed == 0) continue;
    ++releases;
    EXPECT_EQ(stretch.equations(), stretch.size() + 2);
    const auto opens = std::find_if(events.begin(), events.end(), [&](const ContactEvent& event) {
      return event.t == stretch.start;
    });
    ASSERT_NE(opens, events.end());
    EXPECT_EQ(opens->kind, ContactEventKind::opens);
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> passed;
    master.advance(at(stretch.start), passed);
    Eigen::VectorXd q(n), u(n);
    master.state(at(stretch.start), q, u);
    const Eigen::VectorXd inputs = family.inputs(family.nominal());
    Eigen::VectorXd z(2 * n + inputs.size());
    z << family.to_modes(q), family.to_modes(u), inputs;
    const double Omega = machine.frequencies[0];
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::complex<double> steady = machine.response(i, 0) *
                                          std::complex<double>(inputs[0], inputs[1]) *
                                          std::polar(1.0, Omega * stretch.start);
      z[i] -= steady.real();
      z[n + i] += Omega * steady.imag();
    }
    PathRows rows;
    start_rows(machine, stretch, rows);
    EXPECT_NEAR((rows.A * z).value(), 0.0, 1e-12);
    EXPECT_NEAR((rows.Gamma * z).value(), 0.0, 1e-11);
  }
  EXPECT_GE(releases, 3);
}

// Its gap opens with a velocity.
TEST(Record, PenetratingStartIsNotARelease) {
  const Scene scene = shipped_scene("paper_beam_as_printed");
  const auto events = events_of(scene, 20.0);
  ASSERT_EQ(events.front().kind, ContactEventKind::closes);
  for (const Stretch& stretch : cut(events, record_of(1e-3), 4)) EXPECT_EQ(stretch.closed, 0U);
}

// The path is interrupted at a gap, and events within it are ignored.
TEST(Record, IsSplitAtGap) {
  using Kind = ContactEventKind;
  std::vector<ContactEvent> events;
  for (int i = 1; i <= 20; ++i) events.push_back({1.0 * i, 0, Kind::pulse});
  const auto times = [&](const std::vector<EventGap>& gaps) {
    RecordSettings record = record_of(1e-3);
    record.gaps = gaps;
    std::vector<std::vector<double>> found;
    for (const Stretch& stretch : cut(events, record, 4)) {
      found.emplace_back();
      for (const Impact& impact : stretch.impacts) found.back().push_back(impact.t);
    }
    return found;
  };
  using Times = std::vector<std::vector<double>>;
  const std::vector<double> whole = times({}).front();
  ASSERT_EQ(whole.size(), 20U);
  const auto part = [&](int first, int last) {
    return std::vector<double>(whole.begin() + first - 1, whole.begin() + last);
  };
  EXPECT_EQ(times({{8.5, 8.5}}), Times{whole});
  EXPECT_EQ(times({{8.5, 8.6}}), (Times{part(1, 8), part(9, 20)}));
  EXPECT_EQ(times({{8.5, 10.0}}), (Times{part(1, 8), part(11, 20)}));
  EXPECT_EQ(times({{4.5, 6.5}, {15.0, 15.5}}), (Times{part(1, 4), part(7, 14), part(16, 20)}));
  EXPECT_EQ(times({{0.5, 30.0}}), Times{});
  EXPECT_EQ(times({{0.5, 4.5}}), Times{part(5, 20)});

  // The contact has been closed since an unknown time in the gap. The machine may be inside the
  // support, and its flight starts at the opening.
  events[9].kind = Kind::closes;
  events[10].kind = Kind::opens;
  RecordSettings record = record_of(1e-3);
  record.gaps = std::span<const EventGap>();
  ASSERT_EQ(cut(events, record, 4).size(), 2U);
  EXPECT_EQ(cut(events, record, 4)[1].closed, bit(0));
  const std::vector<EventGap> before = {{9.5, 10.5}};
  record.gaps = before;
  ASSERT_EQ(cut(events, record, 4).size(), 2U);
  EXPECT_EQ(cut(events, record, 4)[0].size(), 9U);
  EXPECT_EQ(cut(events, record, 4)[1].closed, 0U);
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

// The impact of another contact may have opened it.
TEST(Record, OpeningAtAnotherEventIsNotARelease) {
  using Kind = ContactEventKind;
  std::vector<ContactEvent> events = {{1.0, 0, Kind::closes}, {1.5, 0, Kind::opens}};
  for (int i = 0; i < 6; ++i) events.push_back({2.0 + i, 0, Kind::pulse});
  const auto closed = [&] { return cut(events, record_of(1e-3), 4).front().closed; };
  EXPECT_EQ(closed(), bit(0));
  events.insert(events.begin() + 1, {1.4995, 1, Kind::pulse});
  EXPECT_EQ(closed(), 0U);
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
