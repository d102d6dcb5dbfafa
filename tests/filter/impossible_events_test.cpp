// Event sequences that no machine could have: impossible, contradictory, of dependent contacts. For
// all of them an estimator continues and publishes finite numbers, live and offline the same.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "sprag/detail/live/time_line.h"
#include "tests/support/random_model.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

constexpr int random_machines = 500;
// Two of its contacts stick and force the release of each other, repeatedly.
constexpr int throws_off_for_ever = 2687;
constexpr double run_end = 2.0;

/// One to four coordinates and contacts, often with dependent directions.
Scene random_scene(Random& random) {
  Scene scene;
  const int f = random.integer(1, 4);
  const int m = random.integer(1, 4);
  const Structure structure =
      structures.at(static_cast<std::size_t>(random.integer(0, int{structures.size()} - 1)));
  scene.model = random_machine(random, structure, f);
  if (random.chance(0.2)) scene.model.C.setZero();
  add_forces(random, scene.model, random.integer(0, 2));
  add_contacts(random, scene.model, m);
  for (int i = 1; i < m; ++i) {
    auto& contacts = scene.model.contacts;
    const auto twin = static_cast<std::size_t>(random.integer(0, i - 1));
    auto& contact = contacts[static_cast<std::size_t>(i)];
    if (!random.chance(0.5)) continue;
    contact.w = (random.chance(0.5) ? -1.0 : 1.0) * contacts[twin].w;
    if (random.chance(0.5)) contact.motion = contacts[twin].motion;
    if (contact.w.dot(contacts[twin].w) < 0.0) contact.motion.amplitude *= -1.0;
  }
  for (Contact& contact : scene.model.contacts) {
    if (random.chance(0.2)) contact.restitution = random.integer(0, 1);
  }
  if (random.chance(0.3)) scene.model.law = ImpactLaw::newton;
  scene.prior.start = random_state(random, scene.model);
  scene.prior.uncertainty = Eigen::VectorXd::Constant(f, 1.0);
  if (random.chance(0.3)) scene.prior.jitter = random.log_uniform(1e-6, 1e-1);
  if (random.chance(0.3)) scene.prior.drift = random.log_uniform(1e-8, 1.0);
  return scene;
}

/// Mostly in order of time, otherwise arbitrary.
std::vector<ContactEvent> any_events(Random& random, int contacts) {
  std::vector<ContactEvent> events;
  const double spacing = random.log_uniform(1e-3, 0.3);
  double t = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.1);
  while (t < run_end && events.size() < 200) {
    const int kind = random.integer(1, 3);
    const int stranger = random.chance(0.01) ? 1 : 0;
    events.push_back(
        {t, random.integer(0, contacts - 1 + stranger), static_cast<ContactEventKind>(kind)});
    if (!random.chance(0.3)) t += random.uniform(0.0, 2.0) * spacing;
    if (random.chance(0.02)) t = std::max(0.0, t - 0.1);
  }
  return events;
}

/// Empty if no published number is NaN. Infinity is valid without a claim.
template <Estimator E>
std::string not_a_number(E& estimator, const typename E::State& state, Confidence& confidence,
                         Eigen::VectorXd& q, Eigen::VectorXd& u) {
  estimator.output(state, q, u);
  if constexpr (requires { estimator.confidence(state, confidence); }) {
    estimator.confidence(state, confidence);
  } else {
    estimator.note(state, confidence);
  }
  const auto bad = [](const Eigen::VectorXd& x) { return x.array().isNaN().any(); };
  if (!q.allFinite()) return "q";
  if (!u.allFinite()) return "u";
  if (bad(confidence.sigma_q) || bad(confidence.sigma_u) || bad(confidence.sigma_g)) return "sigma";
  if (std::isnan(confidence.replica.gap) || std::isnan(confidence.filter.gap) ||
      std::isnan(confidence.filter.deviation)) {
    return "the last closing";
  }
  return "";
}

template <Estimator E>
void expect_numbers(const Scene& scene, std::span<const ContactEvent> events, bool late,
                    E& estimator, Recording& recording) {
  Confidence confidence = estimator.no_confidence();
  Eigen::VectorXd q(scene.model.coordinates()), u(scene.model.coordinates());
  run_time_line(estimator, scene, events, run_end, late, [&](const typename E::State& state) {
    recording.add(estimator, state, scene.model.coordinates());
    const std::string what = not_a_number(estimator, state, confidence, q, u);
    ASSERT_EQ(what, "") << "is not a number at tick " << state.tick;
  });
}

template <Estimator E>
void check_random_machines() {
  constexpr double h = 0.02;
  const int files_of_a_machine = thorough() ? 20 : 5;
  std::vector<int> drawn(static_cast<std::size_t>(long_repetitions(random_machines)));
  std::iota(drawn.begin(), drawn.end(), 0);
  drawn.push_back(throws_off_for_ever);
  for (const int machine : drawn) {
    Random random(7000 + static_cast<std::uint64_t>(machine));
    const Scene scene = random_scene(random);
    const std::unique_ptr<E> estimator(new E(scene, h));
    for (int file = 0; file < files_of_a_machine; ++file) {
      SCOPED_TRACE("machine " + std::to_string(machine) + ", file " + std::to_string(file));
      const auto events = any_events(random, static_cast<int>(scene.model.contacts.size()));
      Recording live, offline;
      expect_numbers(scene, events, false, *estimator, offline);
      if (file == 0) expect_numbers(scene, events, true, *estimator, live);
      if (testing::Test::HasFatalFailure()) return;
      if (file == 0) {
        ASSERT_EQ(difference(offline, live), "");
      }
      ASSERT_EQ(offline.ticks.size(), 101U);
    }
  }
}

// BothEstimator has a filter of its own.
TEST(ImpossibleEvents, GiveEqualNumbersLiveAndOffline) {
  check_random_machines<ReplicaEstimator>();
  check_random_machines<BothEstimator>();
  if (thorough()) check_random_machines<TimingEstimator>();
}

}  // namespace
}  // namespace sprag
