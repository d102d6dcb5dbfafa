// The master compared with event times of 50 digits (tests/reference).
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "tests/mechanics/reference_rows.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

struct Case {
  const char* scene;
  const char* reference;
  double exact_until;  // |dt| <= 1e-11
  double horizon;      // of the reference
  bool chatters;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.scene; }

class ReferenceTimes : public testing::TestWithParam<Case> {
 protected:
  static constexpr double tolerance = 1e-11;
  static constexpr double least_impact = 1e-4;  // of |gamma-|, for scenes with chatter

  void SetUp() override {
    const Scene scene = shipped_scene(GetParam().scene);
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> events;
    master.advance(at(GetParam().horizon), events);
    for (const ContactEvent& event : events) {
      if (event.kind == ContactEventKind::pulse) pulses_.push_back(event.t);
      if (event.kind == ContactEventKind::closes) closes_.push_back(event.t);
      if (event.kind == ContactEventKind::opens) opens_.push_back(event.t);
    }
    for (const auto& row : reference_rows(std::string(GetParam().reference) + "_impacts")) {
      if (!GetParam().chatters || std::abs(row[2]) > least_impact) impacts_.push_back(row[1]);
    }
    sticks_ = reference_rows(std::string(GetParam().reference) + "_sticks");
  }

  static double distance(double t, const std::vector<double>& times) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const double other : times) nearest = std::min(nearest, std::abs(t - other));
    return nearest;
  }

  std::vector<double> pulses_, closes_, opens_, impacts_;
  std::vector<std::vector<double>> sticks_;
};

TEST_P(ReferenceTimes, EveryImpactIsFoundAtItsTime) {
  int compared = 0;
  for (const double t : impacts_) {
    if (t > GetParam().exact_until) break;
    EXPECT_LE(distance(t, pulses_), tolerance) << "impact at " << t;
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

TEST_P(ReferenceTimes, NoImpactIsInvented) {
  if (GetParam().chatters) {
    // The files leave out the tail of a chatter, as does the master, but at another impact.
    const auto all = reference_rows(std::string(GetParam().reference) + "_impacts");
    std::vector<double> times;
    for (const auto& row : all) times.push_back(row[1]);
    for (const double t : pulses_) {
      if (t > GetParam().exact_until) break;
      EXPECT_LE(distance(t, times), 1e-10) << "pulse at " << t;
    }
    return;
  }
  for (const double t : pulses_) {
    if (t > GetParam().exact_until) break;
    EXPECT_LE(distance(t, impacts_), tolerance) << "pulse at " << t;
  }
  EXPECT_TRUE(closes_.empty() || closes_.front() > GetParam().exact_until);
}

TEST_P(ReferenceTimes, SustainedContactsBeginAndEndAtTheirTimes) {
  std::size_t compared = 0;
  for (const auto& stick : sticks_) {
    if (stick[1] > GetParam().exact_until) break;
    EXPECT_LE(distance(stick[0], closes_), tolerance);
    EXPECT_LE(distance(stick[1], opens_), tolerance);
    ++compared;
  }
  EXPECT_EQ(compared > 0, GetParam().chatters);
  std::size_t closed = 0;
  for (const double t : closes_) closed += t <= GetParam().exact_until ? 1U : 0U;
  EXPECT_EQ(closed, compared);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, ReferenceTimes,
    testing::Values(Case{"paper_beam", "A_n3_c0", 15.0, 100.0, false},
                    Case{"paper_beam_frame", "D_n3_s0_c0.005", 15.0, 100.0, false},
                    Case{"paper_beam_chatter", "B_n3_c0.0125", 15.0, 100.0, true},
                    Case{"stiff_beam", "C_n20_c0", 2.0, 20.0, true}),
    [](const auto& parameter) { return std::string(parameter.param.scene); });

TEST(ReferenceStates, MasterIsAtTheReferenceStateAtItsSamples) {
  for (const auto& [name, reference] :
       {std::pair("paper_beam", "A_n3_c0"), std::pair("paper_beam_chatter", "B_n3_c0.0125"),
        std::pair("paper_beam_frame", "D_n3_s0_c0.005")}) {
    const Scene scene = shipped_scene(name);
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> events;
    Eigen::VectorXd q(3);
    Eigen::VectorXd u(3);
    for (const auto& row : reference_rows(std::string(reference) + "_samples")) {
      if (row[0] > 10.0) break;
      master.advance(at(row[0]), events);
      master.state(at(row[0]), q, u);
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(q[i], row[static_cast<std::size_t>(1 + i)], 1e-11) << name << " " << row[0];
        EXPECT_NEAR(u[i], row[static_cast<std::size_t>(4 + i)], 1e-10) << name << " " << row[0];
      }
    }
  }
}

}  // namespace
}  // namespace sprag::test
