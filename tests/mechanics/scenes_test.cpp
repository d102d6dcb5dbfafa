// The shipped scenes by properties of every machine, and by the purpose of each scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

// Of V / V(0): the bar needs 1e-13, because of a hundred modes of up to 1e6 rad/s.
constexpr double rounding = 1e-12;

struct SceneRun {
  const char* scene;
  double T, h;
  double fall;           ///< V(T) / V(0) is at most this
  double excited = 1.0;  ///< factor of the first force
};
void PrintTo(const SceneRun& c, std::ostream* out) { *out << c.scene; }

class SceneRuns : public testing::TestWithParam<SceneRun> {};
INSTANTIATE_TEST_SUITE_P(
    All, SceneRuns,
    testing::Values(
        SceneRun{"paper_beam", 30.0, 1e-3, 1.0}, SceneRun{"paper_beam_frame", 30.0, 1e-3, 1.0},
        SceneRun{"paper_beam_chatter", 30.0, 1e-3, 1.0}, SceneRun{"stiff_beam", 5.0, 1e-3, 1.0},
        SceneRun{"two_stops_beam", 100.0, 1e-3, 1e-6},
        SceneRun{"two_supports_beam", 100.0, 1e-3, 1e-6},
        // It hits both supports within 1e-11 s and less: each
        // impact must involve both.
        SceneRun{"two_supports_beam", 50.0, 1e-3, 1e-4, 4.0 / 3.0},
        SceneRun{"two_supports_beam", 50.0, 1e-3, 1e-4, 2.0},
        SceneRun{"two_supports_beam", 50.0, 1e-3, 1e-4, 10.0 / 3.0},
        SceneRun{"three_ball_chain", 2.0, 1e-3, 1.0}, SceneRun{"lab_rig", 20.0, 1e-3, 1e-6},
        SceneRun{"impact_oscillator", 20.0, 1e-3, 1e-6}, SceneRun{"elastic_bar", 2e-3, 1e-6, 1.0},
        SceneRun{"steel_ruler", 20.0, 1e-4, 1e-6}, SceneRun{"non_proportional", 100.0, 1e-3, 1e-6}),
    [](const auto& of) { return std::string(of.param.scene) + "_" + std::to_string(of.index); });

TEST_P(SceneRuns, ErrorEnergyNeverGrowsAndGapsAreComplementary) {
  Scene scene = shipped_scene(GetParam().scene);
  if (GetParam().excited != 1.0) scene.model.forces.at(0).harmonic.amplitude *= GetParam().excited;
  Pair<Replica> pair(scene, GetParam().h);
  const double V0 = pair.V();
  double worst = 0.0, before = V0, closest = infinity;
  std::size_t events = pair.passed.size();
  while (pair.t() < GetParam().T) {
    pair.step();
    events += pair.passed.size();
    worst = std::max(worst, pair.V() - before);
    ASSERT_LE(pair.V(), before + rounding * V0) << "t = " << pair.t();
    before = pair.V();
    for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
      const Contact& contact = scene.model.contacts[i];
      const double g = gap(contact, pair.q_m, pair.t());
      closest = std::min(closest, g);
      ASSERT_GE(g, -1e-12) << "contact " << i + 1 << " at t = " << pair.t();
      if (!contains(pair.master.closed(), static_cast<int>(i))) continue;
      ASSERT_NEAR(g, 0.0, 1e-12) << "contact " << i + 1 << " at t = " << pair.t();
      ASSERT_NEAR(gap_velocity(contact, pair.u_m, pair.t()), 0.0, 1e-12)
          << "contact " << i + 1 << " at t = " << pair.t();
    }
  }
  EXPECT_LE(before, (GetParam().fall + rounding) * V0);
  EXPECT_EQ(pair.state.refused_impacts, 0);
  std::cout << events << " events, V(T)/V(0) = " << before / V0
            << ", largest growth of V/V(0) in a tick " << worst / V0 << ", smallest gap " << closest
            << '\n';
}

// Left and right limits of the master at each event's time.
template <typename Visit>
void at_each_event(const Scene& scene, double T, Visit visit) {
  const std::vector<ContactEvent> events = events_of(scene, T);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> ignored;
  State before = scene.truth.start;
  State after = scene.truth.start;
  for (const ContactEvent& event : events) {
    master.advance(at(std::nextafter(event.t, 0.0)), ignored);
    master.state(at(event.t), before.q, before.u);
    master.advance(at(event.t), ignored);
    master.state(at(event.t), after.q, after.u);
    visit(event, before, after);
  }
}

double energy(const Model& model, const State& x) {
  return 0.5 * x.u.dot(model.M * x.u) + 0.5 * x.q.dot(model.K * x.q);
}

// An impact of one contact: Lambda = -(1 + epsilon) gamma- / G, and the machine gains the energy
// Lambda (gamma- + gamma+) / 2 - Lambda s', the work of Lambda by the mean velocity of the contact.
TEST(TwoStopsBeam, EnergyBalancesAcrossImpacts) {
  const Scene scene = shipped_scene("two_stops_beam");
  const Model& model = scene.model;
  const CholeskyFactor M(model.M);
  double worst = 0.0;
  at_each_event(
      scene, 60.0, [&](const ContactEvent& event, const State& before, const State& after) {
        if (event.kind == ContactEventKind::opens) return;
        const Contact& contact = model.contacts[static_cast<std::size_t>(event.contact)];
        const Eigen::VectorXd MinvW = M.solve(contact.w);
        const double gamma_minus = gap_velocity(contact, before.u, event.t);
        const bool bounces = event.kind == ContactEventKind::pulse;
        const double gamma_plus = bounces ? -contact.restitution * gamma_minus : 0.0;
        const double Lambda = (gamma_plus - gamma_minus) / contact.w.dot(MinvW);
        const double gained = energy(model, after) - energy(model, before);
        const double work =
            Lambda * (0.5 * (gamma_minus + gamma_plus) - rate(contact.motion, event.t));
        EXPECT_LT(gamma_minus, 0.0);
        EXPECT_NEAR(gap(contact, before.q, event.t), 0.0, 1e-14) << "t = " << event.t;
        EXPECT_NEAR(gap_velocity(contact, after.u, event.t), gamma_plus, 1e-13)
            << "t = " << event.t;
        EXPECT_LE((after.u - before.u - Lambda * MinvW).norm(), 1e-13) << "t = " << event.t;
        EXPECT_LE((after.q - before.q).norm(), 1e-15) << "t = " << event.t;
        EXPECT_NEAR(gained, work, 1e-13) << "t = " << event.t;
        worst = std::max(worst, std::abs(gained - work));
      });
  std::cout << "two_stops_beam: energy across an impact balances to " << worst << '\n';
}

// The contact forces from the motion itself: M u' + C u + K q - f by central differences must be
// W lambda with lambda >= 0, and zero where the gap is open.
TEST(TwoSupportsBeam, GapAndForceAreComplementary) {
  const Scene scene = shipped_scene("two_supports_beam");
  const Model& model = scene.model;
  const double d = 1e-5;  // of the differences, whose error is about (61.7 d)^2 / 6 of u'
  Master master(model, scene.truth.start);
  Master later(model, scene.truth.start);
  std::vector<ContactEvent> ignored;
  State x = scene.truth.start;
  State left = x;
  State right = x;
  Eigen::MatrixXd W(3, 2);
  W << model.contacts[0].w, model.contacts[1].w;
  int checked = 0, both_closed = 0;
  double worst = 0.0;
  double pressed = 0.0;
  for (std::int64_t k = 1; k <= 20000; ++k) {
    const Instant t = tick_instant(k, 1e-3);
    ignored.clear();
    later.advance(t + d, ignored);
    const bool eventful = std::any_of(ignored.begin(), ignored.end(),
                                      [&](const ContactEvent& e) { return e.t >= t.hi - d; });
    later.state(t + d, right.q, right.u);
    master.advance(t + -d, ignored);
    master.state(t + -d, left.q, left.u);
    master.advance(t, ignored);
    master.state(t, x.q, x.u);
    if (eventful) continue;
    Eigen::VectorXd force = model.M * (right.u - left.u) / (2.0 * d) + model.C * x.u;
    force += model.K * x.q;
    for (const Force& f : model.forces) {
      force -= f.direction * (f.constant + value(f.harmonic, t.hi));
    }
    const Eigen::VectorXd lambda = PivotedQR(W, 1e-12).solve(force);
    worst = std::max(worst, (force - W * lambda).norm());
    for (int i = 0; i < 2; ++i) {
      const double g = gap(model.contacts[static_cast<std::size_t>(i)], x.q, t.hi);
      pressed = std::max(pressed, lambda[i]);
      ASSERT_GE(lambda[i], -1e-4) << "t = " << t.hi;
      ASSERT_GE(g, -1e-12) << "t = " << t.hi;
      if (!contains(master.closed(), i)) worst = std::max(worst, std::abs(lambda[i]));
    }
    both_closed += master.closed() == 3U ? 1 : 0;
    ++checked;
  }
  EXPECT_GT(checked, 18000);
  EXPECT_GT(both_closed, 100);
  EXPECT_GT(pressed, 0.1);
  EXPECT_LT(worst, 1e-4);
  std::cout << "two_supports_beam: forces up to " << pressed << ", wrong by " << worst
            << " at most\n";
}

TEST(ThreeBallChainScene, OneImpactOfBothContacts) {
  const Scene scene = shipped_scene("three_ball_chain");
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  State x = scene.truth.start;
  const Eigen::Vector3d after(-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0);
  master.advance(at(100.0), events);
  master.state(at(100.0), x.q, x.u);
  EXPECT_LE((x.u - after).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LE((x.q - Eigen::Vector3d(0.0, 2.0, 4.0) - 99.1 * after).cwiseAbs().maxCoeff(), 1e-12);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0], (ContactEvent{0.0, 1, ContactEventKind::closes}));
  EXPECT_NEAR(events[1].t, 0.9, 1e-15);
  EXPECT_EQ(events[1].contact, 0);
  EXPECT_EQ(events[1].kind, ContactEventKind::pulse);
  EXPECT_EQ(master.impacts(), 1);
}

}  // namespace
}  // namespace sprag::test
