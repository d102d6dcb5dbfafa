// Number of modes that an observer needs, on machines with a known answer.
#include "sprag/detail/analysis/accuracy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sprag/reduction.h"
#include "tests/support/random.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

const TrialLimits limits;

TEST(Accuracy, FindsSmallestNumberOfModesWithinTolerance) {
  const Scene scene = shipped_scene("stiff_beam");
  const Accuracy fine = find_accuracy(scene, 1e-9, 10.0, limits);
  EXPECT_EQ(fine.modes, 20);
  int before = 20;
  for (const double tolerance : {1e-3, 1e-2, 3e-2, 1e-1, 1.0}) {
    const Accuracy found = find_accuracy(scene, tolerance, 10.0, limits);
    EXPECT_LE(found.modes, before) << tolerance;
    before = found.modes;
    for (const Accuracy::Change& change : found.changes) {
      EXPECT_EQ(change.change < tolerance, change.modes >= found.modes) << tolerance;
    }
  }
  EXPECT_LT(before, 5);
}

// A mode with a node at the contact, at rest and without force, does not move: omitting it loses
// nothing.
TEST(Accuracy, OmitsUnexcitedMode) {
  Scene scene = shipped_scene("impact_oscillator");
  Model& model = scene.model;
  const auto extend = [](const Eigen::MatrixXd& A, double entry) {
    Eigen::MatrixXd larger = Eigen::MatrixXd::Zero(2, 2);
    larger(0, 0) = A(0, 0);
    larger(1, 1) = entry;
    return larger;
  };
  const auto pad = [](Eigen::VectorXd& x) { x = Eigen::Vector2d(x[0], 0.0); };
  model.K = extend(model.K, 100.0 * model.K(0, 0));
  model.M = extend(model.M, model.M(0, 0));
  model.C = extend(model.C, model.M(0, 0));
  for (Force& force : model.forces) pad(force.direction);
  for (Contact& contact : model.contacts) pad(contact.w);
  for (State* state : {&scene.truth.start, &scene.prior.start}) {
    pad(state->q);
    pad(state->u);
  }
  EXPECT_EQ(find_accuracy(scene, 1e-12, 20.0, limits).modes, 1);
}

TEST(Accuracy, RefusesCoupledDamping) {
  EXPECT_THROW(find_accuracy(shipped_scene("non_proportional"), 1e-3, 10.0, limits), ModelError);
}

// The machine in modal coordinates has the same contact events.
TEST(ModalMachine, HasEventsOfOriginalMachine) {
  const Scene scene = shipped_scene("lab_rig");
  const ModalMachine machine = modal_machine(scene);
  Scene modal = scene;
  modal.model = machine.model;
  modal.truth.start = machine.master;
  const std::vector<ContactEvent> expected = events_of(scene, 3.0);
  const std::vector<ContactEvent> events = events_of(modal, 3.0);
  ASSERT_EQ(events.size(), expected.size());
  ASSERT_GT(events.size(), 3U);
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_NEAR(events[i].t, expected[i].t, 1e-9);
    EXPECT_EQ(events[i].kind, expected[i].kind);
  }
}

TEST(ModalMachine, ModesAreOrderedByFrequency) {
  const ModalMachine machine = modal_machine(shipped_scene("paper_beam"));
  EXPECT_EQ(by_frequency(machine), (std::vector<Eigen::Index>{0, 1, 2}));
  const ModalMachine second = reduced(machine, {1});
  EXPECT_EQ(second.model.K(0, 0), machine.model.K(1, 1));
  EXPECT_EQ(second.model.contacts[0].w[0], machine.model.contacts[0].w[1]);
  EXPECT_EQ(second.observed(0, 0), machine.observed(0, 1));
}

}  // namespace
}  // namespace sprag::test
