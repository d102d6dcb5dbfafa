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

long count(const std::vector<ContactEvent>& events, int contact, ContactEventKind kind) {
  return std::count_if(events.begin(), events.end(), [&](const ContactEvent& event) {
    return event.contact == contact && event.kind == kind;
  });
}

struct SceneRun {
  const char* scene;
  double T, h;
  double fall;  ///< V(T) / V(0) is at most this
};
void PrintTo(const SceneRun& c, std::ostream* out) { *out << c.scene; }

class SceneRuns : public testing::TestWithParam<SceneRun> {};
INSTANTIATE_TEST_SUITE_P(All, SceneRuns,
                         testing::Values(SceneRun{"paper_beam", 30.0, 1e-3, 1.0},
                                         SceneRun{"paper_beam_frame", 30.0, 1e-3, 1.0},
                                         SceneRun{"paper_beam_chatter", 30.0, 1e-3, 1.0},
                                         SceneRun{"stiff_beam", 5.0, 1e-3, 1.0},
                                         SceneRun{"two_stops_beam", 100.0, 1e-3, 1e-6},
                                         SceneRun{"two_supports_beam", 100.0, 1e-3, 1e-6},
                                         SceneRun{"three_ball_chain", 2.0, 1e-3, 1.0},
                                         SceneRun{"lab_rig", 20.0, 1e-3, 1e-6},
                                         SceneRun{"impact_oscillator", 20.0, 1e-3, 1e-6},
                                         SceneRun{"elastic_bar", 2e-3, 1e-6, 1.0},
                                         SceneRun{"steel_ruler", 20.0, 1e-4, 1e-6},
                                         SceneRun{"non_proportional", 100.0, 1e-3, 1e-6}),
                         [](const auto& parameter) { return std::string(parameter.param.scene); });

TEST_P(SceneRuns, ErrorEnergyFallsAndNeverGrows) {
  Pair<Replica> pair(shipped_scene(GetParam().scene), GetParam().h);
  const double V0 = pair.V();
  double worst = 0.0;
  double before = V0;
  std::size_t events = pair.passed.size();
  while (pair.t() < GetParam().T) {
    pair.step();
    events += pair.passed.size();
    worst = std::max(worst, pair.V() - before);
    ASSERT_LE(pair.V(), before + rounding * V0) << "t = " << pair.t();
    before = pair.V();
  }
  EXPECT_LE(before, (GetParam().fall + rounding) * V0);
  EXPECT_EQ(pair.state.refused_impacts, 0);
  std::cout << GetParam().scene << ": " << events << " events, V(T)/V(0) = " << before / V0
            << ", largest growth of V/V(0) in a tick " << worst / V0 << '\n';
}

TEST_P(SceneRuns, GapsAreNeverNegativeAndZeroInSustainedContact) {
  const Scene scene = shipped_scene(GetParam().scene);
  const std::vector<Contact>& contacts = scene.model.contacts;
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  State x = scene.truth.start;
  std::vector<double> closest(contacts.size(), infinity);
  for (std::int64_t k = 0; tick_instant(k, GetParam().h).hi <= GetParam().T; ++k) {
    const Instant t = tick_instant(k, GetParam().h);
    master.advance(t, events);
    master.state(t, x.q, x.u);
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const double g = gap(contacts[i], x.q, t.hi);
      closest[i] = std::min(closest[i], g);
      ASSERT_GE(g, -1e-12) << "contact " << i + 1 << " at t = " << t.hi;
      if (!contains(master.closed(), static_cast<int>(i))) continue;
      ASSERT_NEAR(g, 0.0, 1e-12) << "contact " << i + 1 << " at t = " << t.hi;
      ASSERT_NEAR(gap_velocity(contacts[i], x.u, t.hi), 0.0, 1e-12)
          << "contact " << i + 1 << " at t = " << t.hi;
    }
  }
  std::cout << GetParam().scene << ": smallest gap "
            << *std::min_element(closest.begin(), closest.end()) << '\n';
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

TEST(TwoStopsBeam, HitsBothStops) {
  const std::vector<ContactEvent> events = events_of(shipped_scene("two_stops_beam"), 100.0);
  const long below = count(events, 0, ContactEventKind::pulse);
  const long above = count(events, 1, ContactEventKind::pulse);
  EXPECT_GT(below, 20);
  EXPECT_GT(above, 20);
  std::cout << "two_stops_beam: " << below << " impacts below, " << above << " above\n";
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

TEST(TwoSupportsBeam, BothContactsAreClosedTogetherAtTimes) {
  const Scene scene = shipped_scene("two_supports_beam");
  const std::vector<ContactEvent> events = events_of(scene, 100.0);
  ContactSet chi = 0;
  int together = 0;
  double duration = 0.0;
  for (std::size_t i = 0; i + 1 < events.size(); ++i) {
    const ContactSet before = chi;
    chi = after(chi, events[i]);
    if (chi == 3 && before != 3) ++together;
    if (chi == 3) duration += events[i + 1].t - events[i].t;
  }
  EXPECT_GT(together, 20);
  EXPECT_GT(duration, 2.0);
  EXPECT_LT(duration, 50.0);
  for (int i = 0; i < 2; ++i) EXPECT_GT(count(events, i, ContactEventKind::closes), 20);
  std::cout << "two_supports_beam: " << events.size() << " events, closed together " << together
            << " times, for " << duration << " of 100 s\n";
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
  int checked = 0;
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
    ++checked;
  }
  EXPECT_GT(checked, 18000);
  EXPECT_GT(pressed, 0.1);
  EXPECT_LT(worst, 1e-4);
  std::cout << "two_supports_beam: forces up to " << pressed << ", wrong by " << worst
            << " at most\n";
}

// With a larger excitation the beam hits both supports within 1e-11 s and less: each impact must
// involve both.
TEST(TwoSupportsBeam, LargerExcitationStaysOutsideAndSynchronizes) {
  for (const double amplitude : {0.02, 0.03, 0.05}) {
    Scene scene = shipped_scene("two_supports_beam");
    scene.model.forces.at(0).harmonic.amplitude *= amplitude / 0.015;
    Pair<Replica> pair(scene, 1e-3);
    const double V0 = pair.V();
    double before = V0;
    while (pair.t() < 50.0) {
      pair.step();
      ASSERT_LE(pair.V(), before + rounding * V0) << "t = " << pair.t();
      before = pair.V();
      for (const Contact& contact : scene.model.contacts) {
        ASSERT_GE(gap(contact, pair.q_m, pair.t()), -1e-12) << "t = " << pair.t();
      }
    }
    EXPECT_LT(before, 1e-4 * V0);
  }
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
