// Contacts with joint chatter: completing the chatter of one forces the release of the other. Such
// a run reaches its end, or an error that gives time and reason.
#include <gtest/gtest.h>

#include <string>

#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag::test {
namespace {

struct Machine {
  Model model;
  State start;
};

/// A few masses on springs between two to four supports, some opposite to the first one and some
/// shaken, with almost elastic impacts.
Machine machine_between_supports(std::uint64_t seed) {
  Random random(seed);
  const int f = random.integer(2, 4);
  Machine machine;
  Model& model = machine.model;
  const Eigen::MatrixXd A = random.matrix(f, f);
  model.M = Eigen::MatrixXd::Identity(f, f);
  model.K = random.log_uniform(1.0, 150.0) * A * A.transpose();
  model.C = random.uniform(0.0, 0.3) * model.M;
  model.forces.push_back({random.vector(f),
                          random.uniform(-5.0, 5.0),
                          {random.uniform(0.0, 3.0), random.uniform(1.0, 20.0), 0.0}});
  const double restitution = random.uniform(0.7, 0.97);
  const int contacts = random.integer(2, 4);
  for (int i = 0; i < contacts; ++i) {
    Eigen::VectorXd w = random.vector(f);
    if (i > 0 && random.chance(0.6)) {
      w = -model.contacts[0].w + random.uniform(0.0, 0.3) * w;
    }
    const Harmonic motion{random.chance(0.3) ? random.uniform(0.0, 0.04) : 0.0,
                          random.uniform(1.0, 20.0), random.phase()};
    Contact contact{.w = w,
                    .clearance = random.uniform(0.0, 0.05),
                    .motion = motion,
                    .restitution = restitution};
    const double g = gap(contact, Eigen::VectorXd::Zero(f), 0.0);
    if (g < 0.0) contact.clearance += 0.002 - g;
    model.contacts.push_back(contact);
  }
  machine.start = {Eigen::VectorXd::Zero(f), 0.5 * random.vector(f)};
  set_chatter_time(model, machine.start);
  return machine;
}

/// Whether the run reached its end. An error must contain the time, a contact and a remedy.
bool ends(const Machine& machine, double T, std::size_t most) {
  Master master(machine.model, machine.start);
  std::vector<ContactEvent> events;
  try {
    return master.advance(at(T), events, most);
  } catch (const SimulationError& error) {
    const std::string what = error.what();
    EXPECT_TRUE(what.starts_with("t = ")) << what;
    EXPECT_NE(what.find("contact"), std::string::npos) << what;
    EXPECT_NE(what.find("check"), std::string::npos) << what;
    return true;
  }
}

TEST(JointChatter, EveryMachineBetweenSupportsFinishes) {
  std::vector<std::uint64_t> seeds = {287, 351, 360};
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(repetitions(100)); ++seed) {
    seeds.push_back(seed);
  }
  for (const std::uint64_t seed : seeds) {
    EXPECT_TRUE(ends(machine_between_supports(seed), 20.0, 200000)) << "seed " << seed;
  }
}

// A stop that moves towards the opposite one squeezes the mass: the rate of impacts grows without
// limit.
TEST(JointChatter, SqueezedMassEndsWithError) {
  const std::string squeezed = R"([system]
M = [[1.0]]
C = [[0.1]]
K = [[1.0]]
[impact]
restitution = 0.95
[[contact]]
direction = [1.0]
clearance = 0.01
[[contact]]
direction = [-1.0]
clearance = 0.03
motion = { amplitude = 0.05, frequency = 3.0 }
[master]
q = [0.0]
u = [0.3]
)";
  const Scene scene = parse_scene(squeezed, "squeezed_mass.toml");
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  try {
    master.advance(at(5.0), events, 200000);
    FAIL() << events.size() << " events";
  } catch (const SimulationError& error) {
    const std::string what = error.what();
    EXPECT_TRUE(what.starts_with("t = 0.83")) << what;
    EXPECT_NE(what.find("contacts 1 and 2"), std::string::npos) << what;
    EXPECT_NE(what.find("check their clearances and motions"), std::string::npos) << what;
  }
}

}  // namespace
}  // namespace sprag::test
