// Would catch a filter that claims too small or too large a sigma or none, and one whose estimate
// is no better than the replica's: figures of `both` on drawn machines, asserted together.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/events/disturbance.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "tests/support/by_speed.h"
#include "tests/support/random.h"
#include "tests/support/rattle.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

constexpr int periods = 60;  // of the slowest mode or harmonic
constexpr int ticks_a_period = 100, ticks_a_sample = 7;
constexpr std::size_t fewest_events = 60, most_events = 1500;

// Of the prior sigma. A damped machine's own motion contracts errors below it, down to rounding,
// where a sigma is an upper limit.
constexpr double above_rounding = 1e-3;

// Jitters over the slowest period; machine after machine takes the next.
constexpr std::array all_jitters{0.0, 1e-6, 1e-5, 1e-4, 1e-3};

/// Of at least one value, which may be infinite.
double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * values[(n - 1) / 2] + 0.5 * values[n / 2];
}

/// The starts of machine and estimate, of these sizes.
void draw_starts(Random& random, const Eigen::VectorXd& sizes, Scene& scene) {
  const Eigen::Index f = sizes.size();
  scene.truth.start = scene.prior.start = {Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)};
  for (Eigen::Index i = 0; i < f; ++i) {
    scene.truth.start.q[i] = 0.5 * sizes[i] * random.normal();
    scene.prior.start.q[i] = 2.0 * sizes[i] * random.normal();
  }
}

/// A shaken beam of two to eight modes with one to three supports.
Scene shaken_beam(Random& random) {
  Beam beam;
  beam.modes = random.integer(2, 8);
  beam.damping = random.log_uniform(0.2, 2.0);
  const Harmonic shake{random.log_uniform(0.01, 0.1), random.uniform(3.0, 25.0), random.phase()};
  Scene scene;
  scene.model = beam_model(beam, shake);
  const double restitution = random.uniform(0.3, 0.8);
  for (int i = random.integer(1, 3); i > 0; --i) {
    const double position = random.uniform(0.4, 1.0), clearance = random.uniform(0.0, 0.03);
    const Side side = random.chance(0.6) ? Side::below : Side::above;
    const bool on_ground = random.chance(0.5);
    scene.model.contacts.push_back(
        beam_contact(beam, position, side, clearance, restitution, on_ground ? shake : Harmonic{}));
  }
  const Eigen::ArrayXd K = scene.model.K.diagonal().array();
  draw_starts(random, 0.03 * (K[0] / K).sqrt(), scene);
  return scene;
}

/// Two to five masses between springs, of which one to three may close a contact. They are shaken;
/// if `pressed`, the supports carry a weight, and contacts are sustained.
Scene shaken_chain(Random& random, bool pressed) {
  const Eigen::Index f = random.integer(2, 5);
  Scene scene;
  Model& model = scene.model;
  model.M = model.C = model.K = Eigen::MatrixXd::Zero(f, f);
  for (Eigen::Index i = 0; i < f; ++i) {
    model.M(i, i) = random.log_uniform(0.5, 2.0);
    Eigen::VectorXd stretch = Eigen::VectorXd::Unit(f, i);
    if (i > 0) stretch[i - 1] = -1.0;
    model.K += random.log_uniform(20.0, 400.0) * stretch * stretch.transpose();
    model.C += random.log_uniform(0.2, 2.0) * stretch * stretch.transpose();
  }
  const auto contacts = std::min<Eigen::Index>(random.integer(1, 3), f);
  Eigen::VectorXd direction = Eigen::VectorXd::Unit(f, random.integer(0, static_cast<int>(f) - 1));
  if (pressed) direction << Eigen::VectorXd::Zero(f - contacts), -Eigen::VectorXd::Ones(contacts);
  const double amplitude = random.log_uniform(2.0, 10.0), weight = random.uniform(0.3, 1.5);
  model.forces.push_back({direction,
                          pressed ? amplitude * weight : 0.0,
                          {amplitude, random.uniform(3.0, 25.0), random.phase()}});
  const double restitution = random.uniform(0.3, 0.8);
  for (Eigen::Index i = f - contacts; i < f; ++i) {
    const double sign = pressed || random.chance(0.5) ? 1.0 : -1.0;
    const double clearance = pressed ? 0.0 : random.uniform(0.0, 0.03);
    model.contacts.push_back({sign * Eigen::VectorXd::Unit(f, i), clearance, {}, restitution});
  }
  draw_starts(random, Eigen::VectorXd::Constant(f, 0.03), scene);
  return scene;
}

void shake(Random& random, Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd direction = random.vector(f);
  direction[0] = 1.0;
  scene.model.forces.push_back(
      {direction, 0.0, {random.log_uniform(1.0, 4.0), random.uniform(3.0, 12.0), random.phase()}});
}

// Two or three contacts at a machine with full matrices: each impact moves the other contacts.
Scene coupled_contacts(Random& random) {
  const Eigen::Index f = random.integer(2, 5);
  Scene scene = test::rattle(random, f, true);
  Model& model = scene.model;
  model.contacts.clear();
  shake(random, scene);
  const double restitution = random.uniform(0.3, 0.8);
  const Eigen::Index contacts = std::min<Eigen::Index>(random.integer(2, 3), f);
  for (Eigen::Index i = 0; i < contacts; ++i) {
    Contact contact;
    contact.w = (Eigen::VectorXd::Unit(f, i) + 0.3 * random.vector(f)).normalized();
    contact.clearance = random.uniform(0.0, 0.03);
    contact.restitution = restitution;
    model.contacts.push_back(contact);
    model.forces.push_back({-contact.w, random.uniform(0.0, 1.0), {}});
  }
  scene.truth.start = {Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)};
  scene.prior.start = {0.05 * random.vector(f), Eigen::VectorXd::Zero(f)};
  return scene;
}

Scene rattle(Random& random, Eigen::Index f) {
  Scene scene = test::rattle(random, f, random.chance(0.5));
  shake(random, scene);
  for (Contact& contact : scene.model.contacts) contact.restitution = random.uniform(0.4, 0.9);
  return scene;
}

double slowest_period(const Model& model) {
  const NaturalModes modes = natural_modes(model);
  double slowest = std::numeric_limits<double>::infinity();
  const auto take = [&](double omega) {
    if (omega > 0.0) slowest = std::min(slowest, omega);
  };
  for (const double squared : modes.stiffness.cwiseQuotient(modes.mass)) take(std::sqrt(squared));
  for (const Force& force : model.forces) take(force.harmonic.frequency);
  return 2.0 * std::numbers::pi / slowest;
}

// One stop a little nearer than the motion without it would go.
Scene near_grazing(Random& random) {
  Scene scene = rattle(random, random.integer(1, 4));
  Contact& stop = scene.model.contacts.front();
  scene.model.contacts.pop_back();
  Model without = scene.model;
  without.contacts.clear();
  Master master(without, scene.truth.start);
  std::vector<ContactEvent> none;
  const double T = 120.0 * slowest_period(scene.model);
  Eigen::VectorXd q(without.coordinates()), u(q.size());
  double farthest = 0.0;
  for (int k = 1; k <= 4000; ++k) {
    const Instant t = at(0.5 * T + 0.05 * T * k / 4000.0);
    master.advance(t, none);
    master.state(t, q, u);
    farthest = std::min(farthest, stop.w.dot(q));
  }
  stop.clearance = -farthest * random.uniform(0.9, 0.995);
  return scene;
}

struct Kind {
  const char* name;
  Scene (*draw)(Random&);
};
constexpr std::array kinds{
    Kind{"beam", shaken_beam},
    Kind{"chain", [](Random& random) { return shaken_chain(random, false); }},
    Kind{"chatter", [](Random& random) { return shaken_chain(random, true); }},
    Kind{"coupled contacts", coupled_contacts},
    Kind{"rattle", [](Random& random) { return rattle(random, random.integer(1, 4)); }},
    Kind{"near grazing", near_grazing}};

/// A sixth of the machines has no restitution, another one restitutions by speed.
Scene drawn_scene(const Kind& kind, std::uint64_t seed) {
  Random random(seed);
  Scene scene = kind.draw(random);
  if (seed % 6 == 0) {
    for (Contact& contact : scene.model.contacts) contact.restitution = 0.0;
  }
  if (seed % 6 == 1) test::let_restitutions_fall(random, 0.5, scene.model);
  const Eigen::Index f = scene.model.coordinates();
  const double V = ErrorEnergy(scene.model)(scene.truth.start.q, scene.truth.start.u,
                                            scene.prior.start.q, scene.prior.start.u)[0];
  scene.prior.uncertainty.setConstant(f, 3.0 * V / static_cast<double>(f));
  return scene;
}

/// Figures of runs, from a tenth of each run on.
struct Figures {
  double squares = 0.0;  ///< sum of (error / sigma)^2, of the values with a sigma above rounding
  std::int64_t values = 0, claimed = 0, squared = 0, beyond = 0;
  int runs = 0, doubted = 0;    ///< doubted: with an inconsistency
  std::vector<double> V;        ///< medians with exact times, over V(0)
  std::vector<double> V_ratio;  ///< medians with jitter, over the replica's

  double mean_square() const { return squares / static_cast<double>(squared); }
  double share_beyond() const { return static_cast<double>(beyond) / static_cast<double>(values); }
  double share_claimed() const {
    return static_cast<double>(claimed) / static_cast<double>(values);
  }

  void add(double error, double sigma, double prior) {
    ++values;
    if (!std::isfinite(sigma)) return;
    ++claimed;
    const double z = error == 0.0 ? 0.0 : error / sigma;
    if (!(std::abs(z) <= 5.0)) ++beyond;
    if (sigma < above_rounding * prior) return;
    squares += z * z;
    ++squared;
  }

  void add(const Figures& others) {
    squares += others.squares;
    values += others.values;
    claimed += others.claimed;
    squared += others.squared;
    beyond += others.beyond;
    runs += others.runs;
    doubted += others.doubted;
    V.insert(V.end(), others.V.begin(), others.V.end());
    V_ratio.insert(V_ratio.end(), others.V_ratio.begin(), others.V_ratio.end());
  }
};

std::ostream& operator<<(std::ostream& out, const Figures& of) {
  return out << "mean z^2 " << of.mean_square() << ", beyond 5 sigma " << of.share_beyond()
             << ", claimed " << of.share_claimed() << ", V with exact times " << median(of.V)
             << ", V over the replica's " << median(of.V_ratio) << ", " << of.doubted << " of "
             << of.runs << " doubted\n";
}

/// The start of the estimate is off by an error of the prior's covariance.
void draw_start(Scene& scene, const Uncertainty& uncertainty, Random& random) {
  const auto draw = [&](const Eigen::MatrixXd& S) {
    Eigen::VectorXd normal(S.cols());
    for (double& one : normal) one = random.normal();
    return Eigen::VectorXd(S * normal);
  };
  scene.prior.start.q = scene.truth.start.q + draw(uncertainty.q);
  scene.prior.start.u = scene.truth.start.u + draw(uncertainty.u);
}

/// Adds a run; false if the machine starts inside a support or is hit too rarely.
bool add_run(Scene scene, double jitter, std::uint64_t seed, Figures& figures) {
  for (const Contact& contact : scene.model.contacts) {
    if (gap(contact, scene.truth.start.q, 0.0) < 0.0) return false;
  }
  const double period = slowest_period(scene.model);
  const double h = period / ticks_a_period;
  std::int64_t ticks = periods * ticks_a_period;
  std::vector<ContactEvent> events;
  const double end = static_cast<double>(ticks) * h;
  if (!Master(scene.model, scene.truth.start).advance(at(end), events, most_events)) {
    ticks = static_cast<std::int64_t>(events.back().t / h);
  } else if (events.size() < fewest_events || events.back().t < 0.9 * end) {
    return false;
  }
  Disturbance disturbance;
  disturbance.jitter = scene.prior.jitter = jitter * period;
  events = disturb(events, disturbance, static_cast<int>(scene.model.contacts.size()),
                   static_cast<double>(ticks) * h, Random(4 * seed), Random(4 * seed + 1),
                   Random(4 * seed + 2));

  Random random(4 * seed + 3);
  const Uncertainty uncertainty = uncertainty_of(scene);
  draw_start(scene, uncertainty, random);
  const ErrorEnergy energy(scene.model);
  const double V_start =
      energy(scene.truth.start.q, scene.truth.start.u, scene.prior.start.q, scene.prior.start.u)[0];
  const Eigen::Index f = scene.model.coordinates();
  State now{Eigen::VectorXd(f), Eigen::VectorXd(f)}, estimate = now;
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> passed;
  BothEstimator both(scene, h);
  TrackingState state;
  both.start(scene.prior.start, 0, 0, state);
  Confidence confidence = both.no_confidence();
  std::vector<double> V, V_replica;
  auto next = events.begin();
  for (std::int64_t k = 1; k <= ticks; ++k) {
    const auto first = next;
    while (next != events.end() && next->t <= tick_instant(k, h).hi) ++next;
    both.tick({first, next}, state);
    if (10 * k <= ticks || k % ticks_a_sample != 0) continue;
    master.advance(tick_instant(k, h), passed);
    master.state(tick_instant(k, h), now.q, now.u);
    both.replica(state, estimate.q, estimate.u);
    V_replica.push_back(energy(now.q, now.u, estimate.q, estimate.u)[0]);
    both.output(state, estimate.q, estimate.u);
    V.push_back(energy(now.q, now.u, estimate.q, estimate.u)[0]);
    both.confidence(state, confidence);
    for (Eigen::Index i = 0; i < f; ++i) {
      figures.add(estimate.q[i] - now.q[i], confidence.sigma_q[i], uncertainty.q.norm());
      figures.add(estimate.u[i] - now.u[i], confidence.sigma_u[i], uncertainty.u.norm());
    }
  }
  ++figures.runs;
  if (confidence.inconsistencies > 0) ++figures.doubted;
  if (jitter > 0.0) {
    figures.V_ratio.push_back(median(V) / median(V_replica));
  } else {
    figures.V.push_back(median(V) / V_start);
  }
  return true;
}

TEST(DrawnMachines, EstimatesAreAccurateAndTheirSigmaHolds) {
  const int of_a_kind = std::max(long_repetitions(50), 2);  // exact times and a jitter
  Figures all;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    Figures of_kind;
    const std::uint64_t first = 1000 * (k + 1);
    std::uint64_t seed = first;
    while (of_kind.runs < of_a_kind) {
      const double jitter = all_jitters.at(static_cast<std::size_t>(of_kind.runs) % 5);
      add_run(drawn_scene(kinds.at(k), seed), jitter, seed, of_kind);
      ++seed;
    }
    std::cout << kinds.at(k).name << ", seeds " << first << " to " << seed - 1 << ": " << of_kind;
    all.add(of_kind);
  }
  std::cout << "all: " << all;
  if (sanitized) GTEST_SKIP() << "too few machines for a distribution";
  EXPECT_GT(all.mean_square(), 0.8);
  EXPECT_LT(all.mean_square(), 1.25);
  EXPECT_LT(all.share_beyond(), 0.002);
  EXPECT_GT(all.share_claimed(), 0.95);
  EXPECT_LE(all.doubted, all.runs / 10);
  EXPECT_LT(median(all.V), 1e-26);
  EXPECT_LT(median(all.V_ratio), 1e-6);
}

}  // namespace
}  // namespace sprag
