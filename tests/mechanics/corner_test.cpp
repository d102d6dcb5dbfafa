// Machines driven into the corners between several contacts, and between opposite ones. Time must
// advance, and no gap may become negative. Stopping one contact forces the release of another, for
// ever shorter flights; each such sequence has to be completed, or to end with an error that gives
// time and reason.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"

namespace sprag::test {
namespace {

constexpr double horizon = 100.0;
constexpr std::size_t most_events = 200000;
constexpr double depth = 1e-10;

// Only a closed contact opens, and only an open one closes.
void expect_alternating(const std::vector<ContactEvent>& events) {
  ContactSet closed = 0;
  for (const ContactEvent& event : events) {
    const bool was_closed = contains(closed, event.contact);
    ASSERT_EQ(was_closed, event.kind == ContactEventKind::opens) << "t = " << event.t;
    closed = after(closed, event);
  }
}

void run(const Model& model) {
  const Eigen::Index f = model.M.rows();
  Master master(model, {Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)});
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(f);
  Eigen::VectorXd u(f);
  for (std::int64_t k = 0; k <= 10000; ++k) {
    const Instant t = tick_instant(k, horizon / 10000);
    ASSERT_TRUE(master.advance(t, events, most_events - events.size())) << "t = " << t.hi;
    master.state(t, q, u);
    for (const Contact& contact : model.contacts) {
      ASSERT_GE(gap(contact, q, t.hi), -depth) << "t = " << t.hi;
    }
  }
  expect_alternating(events);
}

Eigen::MatrixXd random_diagonal(Random& random, Eigen::Index f, double low, double high) {
  return Eigen::VectorXd::NullaryExpr(f, [&] { return random.uniform(low, high); }).asDiagonal();
}

TEST(Corner, IsLeftInFiniteTime) {
  const std::uint64_t seed = 301;
  Random random(seed);
  for (int repetition = 0; repetition < repetitions(300); ++repetition) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", case " + std::to_string(repetition));
    const Eigen::Index f = random.integer(2, 4);
    Model model;
    model.M = random_diagonal(random, f, 0.5, 2.0);
    model.C = random_diagonal(random, f, 0.05, 1.0);
    model.K = random_diagonal(random, f, 0.5, 9.0);
    model.law = random.integer(0, 1) == 0 ? ImpactLaw::poisson : ImpactLaw::newton;
    for (int i = random.integer(1, 2); i > 0; --i) {
      const Harmonic time{random.uniform(0.5, 3.0), random.uniform(0.4, 3.0), 0.0};
      model.forces.push_back({1.5 * random.vector(f), 0.0, time});
    }
    for (int i = random.integer(2, static_cast<int>(f)); i > 0; --i) {
      const double epsilon = 0.1 * random.integer(0, 9);
      model.contacts.push_back({1.5 * random.vector(f), 0.1, {}, epsilon});
    }
    run(model);
    if (HasFatalFailure()) return;
  }
}

// Every impact of contact 2 forces the release of contact 1, for less than the rest of a chatter,
// and contact 2 rests only if contact 1 does. Both have to stay closed.
TEST(Corner, MutualForcedReleaseEndsWithBothClosed) {
  for (const auto& [first, second] : {std::pair(0.9, 0.2), std::pair(0.5, 0.5)}) {
    SCOPED_TRACE(first);
    Model model;
    model.M = model.C = Eigen::Matrix2d::Identity();
    model.K = Eigen::Vector2d(1.0, 2.0).asDiagonal();
    model.forces.push_back({Eigen::Vector2d(1.0, 0.4), 0.0, {2.0, 1.3, 0.0}});
    model.forces.push_back({Eigen::Vector2d(0.0, 1.0), 0.0, {1.0, 0.7, 0.0}});
    model.contacts.push_back({Eigen::Vector2d(1.0, 0.0), 0.1, {}, first});
    model.contacts.push_back({Eigen::Vector2d(-0.8, 0.6), 0.1, {}, second});
    Master master(model, {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()});
    std::vector<ContactEvent> events;
    EXPECT_TRUE(master.advance(at(1000.0), events, most_events));
  }
}

// Pressed against a stop, a contact without loss would bounce infinitely often; only rounding ends
// this.
TEST(Corner, LosslessBouncesBelowTimeResolutionEnd) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({-Eigen::VectorXd::Ones(1), 1.0, {}});
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, 1.0});
  Master master(model, {Eigen::VectorXd::Zero(1), -1e-15 * Eigen::VectorXd::Ones(1)});
  std::vector<ContactEvent> events;
  EXPECT_TRUE(master.advance(at(1.0), events, most_events));
  EXPECT_EQ(master.closed(), bit(0));
}

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
  model.K = random.log_uniform(1.0, 150.0) * product(A, A.transpose());
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

// Contacts between which the machine bounces are completed together, with some of them closed
// already.
TEST(JointChatter, ClosedContactDoesNotCloseAgain) {
  for (const std::uint64_t seed : {17519, 19121, 20020, 23047, 23604, 23636, 28178, 29878}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const ImpactingMachine machine = random_impacting_machine(random);
    Master master(machine.model, machine.start);
    std::vector<ContactEvent> events;
    ASSERT_TRUE(master.advance(at(5.0), events, 20000));
    expect_alternating(events);
  }
}

}  // namespace
}  // namespace sprag::test
