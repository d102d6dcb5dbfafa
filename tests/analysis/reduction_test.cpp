// Machines in fewer modes: the effect of the corrections on a beam of 20 modes with three kinds of
// damping, and properties on any machine.
#include "sprag/reduction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <numeric>

#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

using Eigen::Index;

constexpr double T = 100.0;
constexpr double h = 0.01;

enum class Damping { uniform, zeta, kprop };

Scene beam_with(Damping damping) {
  Scene scene = shipped_scene("stiff_beam");
  Beam& beam = *scene.beam;
  if (damping == Damping::uniform) return scene;
  beam.damping = 0.0;
  beam.damping_ratio.setConstant(beam.modes, 0.01);
  if (damping == Damping::kprop) {
    const Eigen::VectorXd omega = (stiffness(beam).cwiseQuotient(mass(beam))).cwiseSqrt();
    beam.damping_ratio = 0.01 * omega / omega[0];
  }
  scene.model.C = sprag::damping(beam).asDiagonal();
  return scene;
}

std::vector<Index> first(int n) {
  std::vector<Index> kept(static_cast<std::size_t>(n));
  std::iota(kept.begin(), kept.end(), Index{0});
  return kept;
}

// The beam and its events.
struct Truth {
  explicit Truth(Damping damping) : whole(modal_machine(beam_with(damping))) {
    Master(whole.model, whole.master).advance(at(T), events);
  }

  ModalMachine whole;
  std::vector<ContactEvent> events;
};

Reduction of_correction(const std::vector<Reduction>& all, std::string_view correction) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const Reduction& reduction) {
    return reduction.correction == correction ||
           (correction == "restitution" && reduction.share.has_value());
  });
  EXPECT_NE(found, all.end()) << correction;
  return found == all.end() ? all.front() : *found;
}

// The largest growth of the distance of two replicas of a machine between ticks, as a share of the
// distance at the start. Both follow the same events, from different states.
double growth_of_distance(const ModalMachine& machine, const std::vector<ContactEvent>& events,
                          double duration) {
  Replica replica(machine.model, h);
  Replica::State first, second;
  replica.start(machine.master, 0, 0, first);
  replica.start(machine.replica, 0, 0, second);
  const ErrorEnergy energy(machine.model);
  const Index f = machine.model.coordinates();
  Eigen::VectorXd q_a(f), u_a(f), q_b(f), u_b(f);
  double before =
      energy(machine.master.q, machine.master.u, machine.replica.q, machine.replica.u)[0];
  const double start = before;
  double growth = 0.0;
  auto next = events.begin();
  for (std::int64_t k = 1; k <= last_tick(duration, h); ++k) {
    const auto since = next;
    while (next != events.end() && next->t <= tick_instant(k, h).hi) ++next;
    replica.tick({since, next}, first);
    replica.tick({since, next}, second);
    replica.output(first, q_a, u_a);
    replica.output(second, q_b, u_b);
    const double V = energy(q_a, u_a, q_b, u_b)[0];
    growth = std::max(growth, (V - before) / start);
    before = V;
  }
  EXPECT_LT(before, start);
  return growth;
}

class ReducedBeam : public testing::TestWithParam<Damping> {};
std::string name_of(const testing::TestParamInfo<Damping>& parameter) {
  if (parameter.param == Damping::uniform) return "uniform";
  return parameter.param == Damping::zeta ? "zeta" : "kprop";
}
INSTANTIATE_TEST_SUITE_P(Dampings, ReducedBeam,
                         testing::Values(Damping::uniform, Damping::zeta, Damping::kprop), name_of);

TEST_P(ReducedBeam, ReplicasConvergeWithEveryCorrection) {
  const Truth truth(GetParam());
  for (const Reduction& reduction : reductions(truth.whole, first(2), second_half(truth.events))) {
    EXPECT_LE(growth_of_distance(reduction.machine, truth.events, 40.0), 1e-13)
        << reduction.correction;
  }
  // Any value within the range of the correction, and one beyond it that increases the distance.
  ModalMachine machine = reduced(truth.whole, first(2));
  for (const double share : {0.0, 0.2, 0.6, 1.0, 2.0 / 1.7}) {
    set_impulse_share(share, machine.model);
    EXPECT_LE(growth_of_distance(machine, truth.events, 40.0), 1e-13) << share;
  }
  machine.model.contacts[0].replica_restitution = 1.3;
  EXPECT_GT(growth_of_distance(machine, truth.events, 2.0), 1e-6);
}

// A machine of 12 coupled coordinates, excited near its first mode against two contacts.
Scene two_contacts(Random& random) {
  Scene scene;
  scene.name = "two_contacts";
  Model& model = scene.model;
  const Index f = 12;
  model.M = random.positive_definite(f, 0.5, 3.0);
  model.K = random.positive_definite(f, 5.0, 5000.0);
  model.C = 0.2 * model.M + 1e-3 * model.K;
  const NaturalModes modes = natural_modes(model);
  const double omega = std::sqrt(modes.stiffness[0] / modes.mass[0]);
  model.forces.push_back({model.M * modes.Phi.col(0), 0.0, {1.0, 1.1 * omega, 0.0}});
  add_contacts(random, model, 2);
  for (Contact& contact : model.contacts) {
    contact.restitution = 0.6;
    contact.motion = {};
    contact.clearance = random.uniform(0.0, 1e-3);
  }
  scene.truth.start.q = scene.truth.start.u = Eigen::VectorXd::Zero(f);
  scene.prior.start = random_state(random, model);
  scene.prior.start.q *= 0.1;
  scene.prior.start.u *= 0.1;
  return scene;
}

double periods(const Scene& scene, int count) {
  return 2.0 * std::numbers::pi * count / scene.model.forces[0].harmonic.frequency;
}

Eigen::MatrixXd W_of(const Model& model) {
  Eigen::MatrixXd W(model.coordinates(), static_cast<Index>(model.contacts.size()));
  for (Index i = 0; i < W.cols(); ++i) W.col(i) = model.contacts[static_cast<std::size_t>(i)].w;
  return W;
}

// W^T A^-1 W.
Eigen::MatrixXd seen(const Model& model, const Eigen::MatrixXd& A) {
  const Eigen::MatrixXd W = W_of(model);
  return congruent(W, inverse(A));
}

TEST(StaticVectors, GiveContactsInertiaAndFlexibilityOfWholeMachine) {
  constexpr std::uint64_t seed = 31;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (int i = 0; i < repetitions(40); ++i) {
    const Scene scene = two_contacts(random);
    const ModalMachine machine = modal_machine(scene);
    const Eigen::MatrixXd G = seen(scene.model, scene.model.M);
    const Eigen::MatrixXd flexibility = seen(scene.model, scene.model.K);
    const auto error = [](const Eigen::MatrixXd& of, const Eigen::MatrixXd& right) {
      return (of - right).norm() / right.norm();
    };
    const Model plain = reduced(machine, first(2)).model;
    EXPECT_GT(error(seen(plain, plain.M), G), 1e-3);
    for (const auto& [orders, with_G, with_flexibility] :
         std::vector<std::tuple<std::vector<int>, bool, bool>>{
             {{0}, true, false}, {{0, 1}, true, true}, {{1, 2}, false, true}}) {
      const ModalMachine part = with_static_vectors(machine, first(2), orders);
      const Model& model = part.model;
      ASSERT_EQ(model.coordinates(), 2 + 2 * static_cast<Index>(orders.size()));
      EXPECT_EQ(error(seen(model, model.M), G) < 1e-11, with_G);
      EXPECT_EQ(error(seen(model, model.K), flexibility) < 1e-11, with_flexibility);
      EXPECT_TRUE(model.M.isDiagonal(0.0) && model.K.isDiagonal(0.0));
      EXPECT_EQ(model.C, model.C.transpose());
      // The form C = a M + b K is preserved.
      EXPECT_LT(error(model.C, 0.2 * model.M + 1e-3 * model.K), 1e-11);
    }
  }
}

TEST(StaticVectors, AllVectorsReproduceWholeMachine) {
  constexpr std::uint64_t seed = 32;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (int i = 0; i < repetitions(10); ++i) {
    const Scene scene = two_contacts(random);
    const ModalMachine machine = modal_machine(scene);
    const ModalMachine part = with_static_vectors(machine, first(6), std::array{0, 1, 2, 3});
    ASSERT_EQ(part.model.coordinates(), 12);  // of 6 + 8: two are linearly dependent
    const std::vector<ContactEvent> expected = events_of(scene, periods(scene, 5));
    const std::vector<ContactEvent> events =
        events_of(reduced_scene(scene, part), periods(scene, 5));
    ASSERT_GT(expected.size(), 3U);
    ASSERT_EQ(events.size(), expected.size());
    for (std::size_t k = 0; k < events.size(); ++k) {
      EXPECT_NEAR(events[k].t, expected[k].t, 1e-7);
      EXPECT_EQ(events[k].contact, expected[k].contact);
    }
    // For the replica, too, this is only a change of coordinates.
    const Followed followed{.events = expected, .start = &ModalMachine::master};
    EXPECT_LT(rms_gap(part, followed), 1e-9);
    EXPECT_GT(rms_gap(reduced(machine, first(6)), followed), 1e-6);
  }
}

TEST(StaticVectors, LinearlyDependentVectorsAreOmitted) {
  Random random(33);
  Scene scene = two_contacts(random);
  scene.model.contacts[1].w = -2.0 * scene.model.contacts[0].w;
  const ModalMachine machine = modal_machine(scene);
  EXPECT_EQ(with_static_vectors(machine, first(3), std::array{0, 1}).model.coordinates(), 5);
  // All modes are kept.
  EXPECT_EQ(with_static_vectors(machine, first(12), std::array{0, 1}).model.coordinates(), 12);
}

TEST(StaticVectors, DampingRatioHasGivenMinimum) {
  const ModalMachine machine = modal_machine(beam_with(Damping::zeta));
  const Model model = with_static_vectors(machine, first(3), std::array{0, 1, 2, 3}, 0.05).model;
  for (Index k = 3; k < 7; ++k) {
    EXPECT_GE(model.C(k, k), 2.0 * 0.05 * std::sqrt(model.K(k, k)) * (1.0 - 1e-12));
  }
  EXPECT_EQ(model.C, model.C.transpose());
  EXPECT_EQ(model.C.topLeftCorner(3, 3), machine.model.C.topLeftCorner(3, 3));
}

TEST(StaticVectors, OmittedRigidBodyModeIsRefused) {
  Scene scene = shipped_scene("elastic_bar");
  const ModalMachine machine = modal_machine(scene);
  std::vector<Index> order = by_frequency(machine);
  const std::vector<Index> without_rigid(order.begin() + 1, order.begin() + 4);
  if (machine.model.K(order[0], order[0]) == 0.0) {
    EXPECT_THROW(with_static_vectors(machine, without_rigid, std::array{0, 1}), ModelError);
  }
  EXPECT_NO_THROW(with_static_vectors(machine, first(4), std::array{0, 1}));
}

TEST(ImpulseShare, IsLimitedToNonexpansiveRestitution) {
  Random random(34);
  Model model = two_contacts(random).model;
  model.contacts[1].restitution = 0.9;
  set_impulse_share(0.0, model);
  EXPECT_EQ(*model.contacts[0].replica_restitution, -1.0);
  set_impulse_share(1.0, model);
  EXPECT_DOUBLE_EQ(*model.contacts[0].replica_restitution, 0.6);
  set_impulse_share(1.2, model);
  EXPECT_DOUBLE_EQ(*model.contacts[1].replica_restitution, 1.0);
  EXPECT_LT(*model.contacts[0].replica_restitution, 1.0);
}

// A general system with two contacts: the chosen reduction is at least as good as the modes alone,
// and a written and parsed scene leads to the same choice.
TEST(ReducedSystem, IsAtLeastAsAccurateAsModesAlone) {
  constexpr std::uint64_t seed = 35;
  SCOPED_TRACE(seed);
  Random random(seed);
  double better = 0.0;
  const int machines = repetitions(5);
  for (int i = 0; i < machines; ++i) {
    const Scene scene = two_contacts(random);
    const std::vector<ContactEvent> events = events_of(scene, periods(scene, 60));
    const ModalMachine machine = modal_machine(scene);
    const auto all = reductions(machine, first(2), second_half(events));
    EXPECT_TRUE(std::is_sorted(all.begin(), all.end(),
                               [](const auto& a, const auto& b) { return a.rms < b.rms; }));
    better += std::log(of_correction(all, "none").rms / all.front().rms);
    EXPECT_LE(growth_of_distance(all.front().machine, events, periods(scene, 10)), 1e-12);
    const Scene part = reduced_scene(scene, all.front().machine);
    const Scene again = parse_scene(to_toml(part, description(scene, all.front())), "x.toml");
    const ModalMachine read = modal_machine(again);
    if (again.model.C.isDiagonal(0.0)) {  // otherwise its damping couples its modes
      EXPECT_EQ(rms_gap(read, second_half(events)), all.front().rms);
    }
  }
  std::printf("[  modes   ] rms of g(t_k) %.3g times smaller\n", std::exp(better / machines));
  EXPECT_GT(std::exp(better / machines), 3.0);
}

// Deviations of the start are those of Phi^T M q; entries of K have another meaning.
TEST(ReducedSystem, KeepsDeviationsAndParametersWithTheSameMeaning) {
  Random random(37);
  Scene scene = two_contacts(random);
  const Eigen::Index f = scene.model.coordinates();
  scene.prior.sigma = State{Eigen::VectorXd::LinSpaced(f, 0.1, 0.2), Eigen::VectorXd::Ones(f)};
  scene.prior.parameters = {.keys = {"system.K.1.1", "system.K"},
                            .sigma = Eigen::Vector2d(0.1, 0.2),
                            .correlation = Eigen::Matrix2d::Identity(),
                            .consider = {false, false}};
  scene.prior.adaptation.free = {"system.K.1.1"};
  const Scene part = in_modes(scene, 2);
  const Eigen::MatrixXd to_modes = kept_modes(scene.model, 2).to_kept;
  const Eigen::MatrixXd S = scene.prior.sigma->q.cwiseAbs2().asDiagonal();
  const Eigen::VectorXd variances = (to_modes * S * to_modes.transpose()).diagonal();
  ASSERT_TRUE(part.prior.sigma);
  EXPECT_LT((part.prior.sigma->q.cwiseAbs2() - variances).norm(), 1e-12 * variances.norm());
  EXPECT_EQ(part.prior.parameters.keys, std::vector<std::string>{"system.K"});
  EXPECT_EQ(part.prior.parameters.sigma[0], 0.2);
  EXPECT_TRUE(part.prior.adaptation.free.empty());
  EXPECT_EQ(part.remarks.size(), 2U);
}

TEST(ReductionChoice, TooManyCoordinatesAreRefused) {
  const Scene scene = shipped_scene("paper_beam");
  const std::vector<ContactEvent> events = events_of(scene, 8.0);
  EXPECT_THROW(second_half(std::span(events).first(4)), std::runtime_error);
  EXPECT_THROW(second_half({}), std::runtime_error);
  Scene blind = shipped_scene("two_stops_beam");
  ModalMachine machine = modal_machine(blind);
  machine.model.contacts[1].w[0] = 0.0;
  EXPECT_THROW(reduced_scene(blind, reduced(machine, {0})), ModelError);
  EXPECT_NO_THROW(reduced_scene(blind, reduced(machine, {0, 1})));
}

// Impacts of a chatter carry little weight, however many there are.
TEST(ReductionChoice, ClosingHasWeightOfTimeSincePreviousOne) {
  const ModalMachine machine = modal_machine(shipped_scene("paper_beam"));
  const std::vector<ContactEvent> events = events_of(shipped_scene("paper_beam"), 8.0);
  const auto rms = [&](std::size_t count, double counts) {
    return rms_gap(machine, {.events = std::span(events).first(count), .counts = counts});
  };
  double squares = 0.0;
  double last = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    ASSERT_EQ(events[i].kind, ContactEventKind::pulse);
    squares += (events[i].t - last) * square(rms(i + 1, events[i].t));
    last = events[i].t;
    EXPECT_NEAR(rms(i + 1, 0.0), std::sqrt(squares / last), 1e-12);
  }
  EXPECT_GT(squares, 1e-3);
}

// A recording that starts with a contact closed.
TEST(ReductionChoice, AcceptsRecordingThatStartsClosed) {
  const Scene scene = shipped_scene("paper_beam_chatter");
  const std::vector<ContactEvent> events = events_of(scene, 60.0);
  const ModalMachine machine = modal_machine(scene);
  ContactSet chi = 0;
  std::size_t i = 0;
  while (chi == 0 || events[i].t < 20.0) chi = after(chi, events[i++]);
  Followed later = second_half(std::span(events).subspan(i), events[i - 1].t, chi);
  // By then the replica has converged to the machine.
  later.counts = 55.0;
  EXPECT_LT(rms_gap(machine, later), 1e-3);
  later.closed = 0;
  later.counts = later.begins;
  const double not_closed = rms_gap(machine, later);
  later.closed = chi;
  EXPECT_NE(rms_gap(machine, later), not_closed);
}

}  // namespace
}  // namespace sprag::test
