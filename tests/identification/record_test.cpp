#include "sprag/identification/record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <complex>

#include "sprag/identification/linear_path.h"
#include "sprag/mechanics/instant.h"
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

// The machine's own state there has neither a gap nor a gap velocity.
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
    Master master(scene.model, scene.master);
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

// Its gap opens while it moves.
TEST(Record, AMachineThatStartsInsideIsNoRelease) {
  const Scene scene = shipped_scene("paper_beam_as_printed");
  const auto events = events_of(scene, 20.0);
  ASSERT_EQ(events.front().kind, ContactEventKind::closes);
  for (const Stretch& stretch : cut(events, record_of(1e-3), 4)) EXPECT_EQ(stretch.closed, 0U);
}

// Another contact's impact may have opened it.
TEST(Record, WhatOpensBesideAnotherEventIsNoRelease) {
  using Kind = ContactEventKind;
  std::vector<ContactEvent> events = {{1.0, 0, Kind::closes}, {1.5, 0, Kind::opens}};
  for (int i = 0; i < 6; ++i) events.push_back({2.0 + i, 0, Kind::pulse});
  const auto closed = [&] { return cut(events, record_of(1e-3), 4).front().closed; };
  EXPECT_EQ(closed(), bit(0));
  events.insert(events.begin() + 1, {1.4995, 1, Kind::pulse});
  EXPECT_EQ(closed(), 0U);
}

}  // namespace
}  // namespace sprag
