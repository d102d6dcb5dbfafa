// Replica and master: Theorem 1 and the additional properties of the exact estimator.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "sprag/detail/replica/replica.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

struct Case {
  const char* scene;
  double T;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.scene; }

class Synchronization : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Scenes, Synchronization,
                         testing::Values(Case{"paper_beam", 100.0}, Case{"paper_beam_frame", 50.0},
                                         Case{"paper_beam_chatter", 50.0},
                                         Case{"paper_beam_as_printed", 50.0},
                                         Case{"stiff_beam", 5.0}),
                         [](const auto& parameter) { return std::string(parameter.param.scene); });

// Ticks right before and right after each event, so that no growth within a tick is hidden.
TEST_P(Synchronization, ErrorEnergyDoesNotGrowAcrossAnEvent) {
  const Scene scene = shipped_scene(GetParam().scene);
  const double T = std::min(GetParam().T, 15.0);
  const std::vector<ContactEvent> events = events_of(scene, T);
  Master master(scene.model, scene.truth.start);
  Replica replica(scene.model, 1e-7);
  ErrorEnergy energy(scene.model);
  Replica::State state;
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q_m(f), u_m(f), q_s(f), u_s(f);
  std::vector<ContactEvent> ignored;
  // A replica in another state at each event: the theorem holds for any state.
  for (std::size_t i = 0; i < events.size(); ++i) {
    const std::int64_t k = last_tick(events[i].t, 1e-7);
    if (i > 0 && last_tick(events[i - 1].t, 1e-7) + 2 >= k) continue;
    if (i + 1 < events.size() && last_tick(events[i + 1].t, 1e-7) <= k + 1) continue;
    master.advance(tick_instant(k, 1e-7), ignored);
    const ContactSet chi = master.closed();
    master.state(tick_instant(k, 1e-7), q_m, u_m);
    replica.start({q_m + 0.3 * scene.prior.start.q, u_m + scene.prior.start.q}, k, chi, state);
    replica.output(state, q_s, u_s);
    const double before = energy(q_m, u_m, q_s, u_s)[0];
    replica.tick(std::span(events).subspan(i, 1), state);
    master.advance(tick_instant(k + 1, 1e-7), ignored);
    master.state(tick_instant(k + 1, 1e-7), q_m, u_m);
    replica.output(state, q_s, u_s);
    EXPECT_LE(energy(q_m, u_m, q_s, u_s)[0], before * (1.0 + 1e-13)) << "t = " << events[i].t;
  }
}

TEST(PaperBeam, ErrorEnergyMatchesThePaper) {
  Pair<Replica> pair(shipped_scene("paper_beam"), 1e-2);
  EXPECT_NEAR(pair.V(), 0.4783533, 1e-7);
  EXPECT_NEAR(pair.V_i[1], 0.2283533, 1e-7);
  EXPECT_NEAR(pair.V_i[2], 0.125, 1e-12);
  EXPECT_NEAR(pair.V_i[3], 0.125, 1e-12);
  const double V3 = pair.V_i[3];
  while (pair.k < 10000) pair.step();
  EXPECT_NEAR(pair.V_i[3] / V3 / std::exp(-17.0), 1.0, 0.05);
  while (pair.k < 40000) pair.step();
  EXPECT_LT(pair.V(), 1e-27);
  std::cout << "paper_beam: V(400) = " << pair.V() << '\n';
}

TEST(ExactStepper, StatesDoNotDependOnTheTick) {
  for (const auto& [name, T] :
       {std::pair("paper_beam", 100.0), std::pair("paper_beam_chatter", 40.0)}) {
    const Scene scene = shipped_scene(name);
    Pair<Replica> coarse(scene, 1e-1);
    Pair<Replica> fine(scene, 1e-4);
    double worst = 0.0;
    while (coarse.t() < T) {
      coarse.step();
      for (int i = 0; i < 1000; ++i) fine.step();
      worst = std::max({worst, (coarse.q_s - fine.q_s).cwiseAbs().maxCoeff(),
                        (coarse.u_s - fine.u_s).cwiseAbs().maxCoeff()});
    }
    EXPECT_LE(worst, 1e-12) << name;
    std::cout << name << ": h = 1e-1 and 1e-4 differ by " << worst << '\n';
  }
}

TEST(ExactStepper, StaysSynchronized) {
  for (const auto& [name, T] :
       {std::pair("paper_beam_chatter", 100.0), std::pair("paper_beam_as_printed", 50.0),
        std::pair("stiff_beam", 5.0)}) {
    Scene scene = shipped_scene(name);
    scene.prior.start = scene.truth.start;
    Pair<Replica> pair(scene, 1e-3);
    double worst = 0.0;
    while (pair.t() < T) {
      pair.step();
      worst = std::max(worst, pair.V());
    }
    EXPECT_LT(worst, 1e-22) << name;
  }
}

// Whatever happened before: a closed contact that approaches is stopped without a rebound.
TEST(ExactStepper, AStartWithAClosedContactHoldsIt) {
  const Scene scene = shipped_scene("paper_beam");
  const Contact& contact = scene.model.contacts.front();
  Replica replica(scene.model, 1e-2);
  Replica::State state;
  const sprag::State approaching{scene.prior.start.q, -0.3 * contact.w};
  Eigen::VectorXd q(contact.w.size()), u(contact.w.size());
  for (const bool again : {false, true}) {
    replica.start(approaching, 0, 1, state);
    replica.output(state, q, u);
    EXPECT_NEAR(gap_velocity(contact, u, 0.0), 0.0, 1e-14) << again;
    EXPECT_EQ(state.refused_impacts, 0);
  }
}

TEST(ExactStepper, StateIsAValue) {
  const Scene scene = shipped_scene("paper_beam_chatter");
  const std::vector<ContactEvent> events = events_of(scene, 20.0);
  Replica replica(scene.model, 1e-2);
  Replica::State saved;
  const auto run = [&](Replica::State state) {
    auto event = std::find_if(events.begin(), events.end(), [&](const ContactEvent& e) {
      return at(e.t) - tick_instant(state.tick, 1e-2) > 0.0;
    });
    while (state.tick < 2000) {
      const auto first = event;
      while (event != events.end() && at(event->t) - tick_instant(state.tick + 1, 1e-2) <= 0.0) {
        ++event;
      }
      replica.tick({first, event}, state);
      if (state.tick == 837) saved = state;
    }
    return state;
  };
  Replica::State state;
  replica.start(scene.prior.start, 0, 0, state);
  const Replica::State first = run(state);
  const Replica::State again = run(saved);
  EXPECT_TRUE((first.motion.x.z == again.motion.x.z).all());
  EXPECT_TRUE((first.motion.x.v == again.motion.x.v).all());
}

}  // namespace
}  // namespace sprag::test
