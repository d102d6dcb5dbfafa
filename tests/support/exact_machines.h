// Random machines whose observer starts at their start, and the inconsistencies that their
// observers report with exact events. There are none if the estimators account for rounding errors.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/scene.h"
#include "tests/support/random_model.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {

enum class MachineKind { any, balls, chain, beam };
inline constexpr std::array machine_kinds{MachineKind::any, MachineKind::balls, MachineKind::chain,
                                          MachineKind::beam};

/// One to three balls, side by side or on top of each other, that bounce on a floor until they
/// rest.
inline void draw_balls(Random& random, Scene& scene) {
  const Eigen::Index n = random.integer(1, 3);
  const bool stacked = n > 1 && random.chance(0.3);
  Model& model = scene.model;
  model.M = Eigen::VectorXd::NullaryExpr(n, [&] { return random.uniform(0.5, 2.0); }).asDiagonal();
  model.C = (random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.3)) * model.M;
  model.K = Eigen::MatrixXd::Zero(n, n);
  const double restitution = random.uniform(0.05, 0.9);
  scene.truth.start = {Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    model.forces.push_back({-9.81 * model.M.col(i), 1.0, {}});
    Contact floor;
    floor.w = Eigen::VectorXd::Unit(n, i);
    if (stacked && i > 0) floor.w[i - 1] = -1.0;
    floor.restitution = restitution;
    floor.clearance = random.chance(0.5) ? 0.0 : random.uniform(-0.2, 0.2);
    model.contacts.push_back(floor);
    const double below = stacked && i > 0 ? scene.truth.start.q[i - 1] : 0.0;
    scene.truth.start.q[i] = below - floor.clearance + random.uniform(0.05, 1.5);
    scene.truth.start.u[i] = random.uniform(-2.0, 2.0);
  }
}

/// Two to five pendulums in a row, of equal or different frequencies. Some of equal frequency
/// touch. With different frequencies and contact at rest, rounding would determine the time and
/// order of their impacts.
inline void draw_chain(Random& random, Scene& scene) {
  const Eigen::Index n = random.integer(2, 5);
  const bool equal = random.chance(0.5);
  Model& model = scene.model;
  model.M = Eigen::MatrixXd::Identity(n, n);
  model.K = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!equal) model.M(i, i) = random.uniform(0.5, 2.0);
    model.K(i, i) = equal ? 9.81 : random.uniform(5.0, 20.0);
  }
  model.C = (random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.3)) * model.M;
  const double restitution = random.uniform(0.2, 0.95);
  const bool touch = equal && random.chance(0.5);
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    Contact contact;
    contact.w = Eigen::VectorXd::Unit(n, i + 1) - Eigen::VectorXd::Unit(n, i);
    contact.restitution = restitution;
    contact.clearance = touch ? 0.0 : random.uniform(0.0, 0.1);
    model.contacts.push_back(contact);
  }
  scene.truth.start = {Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  scene.truth.start.q[0] = -random.uniform(0.2, 1.0);
  if (!touch) scene.truth.start.u = random.vector(n);
}

/// A shaken beam of one to four modes over one to three supports.
inline void draw_beam(Random& random, Scene& scene) {
  const Harmonic shake{random.uniform(0.01, 0.05), random.uniform(4.0, 12.0), random.phase()};
  Beam beam;
  beam.modes = random.integer(1, 4);
  beam.damping = random.uniform(0.05, 0.4);
  scene.model = beam_model(beam, shake);
  scene.truth.start = {0.03 * random.vector(beam.modes), 0.3 * random.vector(beam.modes)};
  const double restitution = random.uniform(0.1, 0.9);
  const int contacts = random.integer(1, std::min(3, beam.modes));
  for (int i = 0; i < contacts; ++i) {
    const Side side = random.chance(0.5) ? Side::below : Side::above;
    Contact contact = beam_contact(beam, random.uniform(0.4, 1.0), side, 0.0, restitution,
                                   random.chance(0.5) ? shake : Harmonic{});
    contact.clearance =
        random.uniform(0.0, 0.03) - std::min(gap(contact, scene.truth.start.q, 0.0), 0.0);
    scene.model.contacts.push_back(contact);
  }
}

/// A machine of this kind; the observer's start is the machine's, with finite sigma.
inline Scene exact_scene(Random& random, MachineKind kind) {
  Scene scene;
  switch (kind) {
    case MachineKind::any: {
      const ImpactingMachine machine = random_impacting_machine(random);
      scene.model = machine.model;
      scene.truth.start = machine.start;
      break;
    }
    case MachineKind::balls:
      draw_balls(random, scene);
      break;
    case MachineKind::chain:
      draw_chain(random, scene);
      break;
    case MachineKind::beam:
      draw_beam(random, scene);
      break;
  }
  scene.prior.start = scene.truth.start;
  const Eigen::Index f = scene.model.coordinates();
  scene.prior.sigma = State{Eigen::VectorXd::Constant(f, random.log_uniform(1e-3, 0.3)),
                            Eigen::VectorXd::Constant(f, random.log_uniform(1e-3, 1.0))};
  return scene;
}

struct ExactRun {
  int events = 0;
  std::int64_t both = 0, timing = 0;  ///< inconsistencies reported by these estimators
  Inconsistency first;                ///< of either
};

/// Runs for 20 s, or up to 400 events. Empty if the master itself fails.
inline std::optional<ExactRun> run_exact(const Scene& scene) {
  constexpr double h = 0.02;
  constexpr int enough = 400;
  BothEstimator both(scene, h);
  TrackingState of_both;
  TimingEstimator timing(scene, h);
  TrackingState of_timing;
  both.start(scene.prior.start, 0, 0, of_both);
  timing.start(scene.prior.start, 0, 0, of_timing);
  ExactRun run;
  std::vector<ContactEvent> events;
  try {
    Master master(scene.model, scene.truth.start);
    const auto take = [&](std::int64_t k) {
      events.clear();
      master.advance(tick_instant(k, h), events);
      run.events += static_cast<int>(events.size());
    };
    take(0);
    for_each_instant(std::span<const ContactEvent>(events),
                     [&](std::span<const ContactEvent> of_one) {
                       both.apply(of_one, of_both);
                       timing.apply(of_one, of_timing);
                     });
    for (std::int64_t k = 1; k <= 1000 && run.events < enough; ++k) {
      take(k);
      both.tick(events, of_both);
      timing.tick(events, of_timing);
      if (run.first.suspicion != Suspicion::none) continue;
      run.first = of_both.inconsistencies > 0 ? of_both.last : of_timing.last;
    }
  } catch (const SimulationError&) {
    return std::nullopt;
  }
  run.both = of_both.inconsistencies;
  run.timing = of_timing.inconsistencies;
  return run;
}

}  // namespace sprag
