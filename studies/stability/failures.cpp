#include "studies/stability/failures.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/energy.h"

namespace sprag::stability {
namespace {

using Eigen::Vector2d;

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

// The two contacts of the example in which the impact laws differ.
ContactMatrix coupled_contacts() {
  ContactMatrix G(2, 2);
  G << 1.0, -0.8, -0.8, 1.0;
  return G;
}

Vector2d after_impact(ImpactLaw law, const ContactMatrix& G, const Vector2d& epsilon,
                      const Vector2d& gamma) {
  ContactVector Lambda;
  ContactVector gamma_plus;
  (void)impact(law, G, epsilon, gamma, Lambda, gamma_plus);
  return gamma_plus;
}

// The paper's beam, its start mirrored, and the replica of eq. (24)'s example.
struct PaperBeam {
  explicit PaperBeam(double damping) : beam{3, 1.0, 1.0, 1.0, damping} {
    model.M = mass(beam).asDiagonal();
    model.C = sprag::damping(beam).asDiagonal();
    model.K = stiffness(beam).asDiagonal();
    model.contacts.push_back({mode_shapes(beam, 0.868), 0.0, {}, 0.7});
    master = {Eigen::Vector3d(-0.05, 0.0, 0.0), Eigen::Vector3d::Zero()};
    replica = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    for (int i = 0; i < 3; ++i) replica.q[i] = 0.5 / (wavenumber(i + 1) * wavenumber(i + 1));
  }

  void shake() {
    const double e = 0.03;
    const double omega = 9.5;
    model.forces.push_back({inertia_direction(beam), 0.0, {-e * omega * omega, omega, 0.0}});
    model.contacts[0].motion = {e, omega, 0.0};
  }

  Beam beam;
  Model model;
  State master, replica;
};

// Runs master and replica in parallel; calls `sample(t, V, replica state)` at every tick.
template <typename Sample>
void synchronize(const Model& model, const State& master_start, const State& replica_start,
                 double h, double T, Sample&& sample) {
  Master master(model, master_start);
  Replica replica(model, h);
  Replica::State state;
  const ErrorEnergy energy(model);
  const Eigen::Index f = model.coordinates();
  Eigen::VectorXd q_m(f), u_m(f), q_s(f), u_s(f);
  std::vector<ContactEvent> events;
  replica.start(replica_start, 0, 0, state);
  master.advance(at(0.0), events);
  if (!events.empty()) replica.apply(events, state);
  for (std::int64_t k = 0; tick_instant(k, h).hi <= T; ++k) {
    if (k > 0) {
      events.clear();
      master.advance(tick_instant(k, h), events);
      replica.tick(events, state);
    }
    master.state(tick_instant(k, h), q_m, u_m);
    replica.output(state, q_s, u_s);
    sample(tick_instant(k, h).hi, energy(q_m, u_m, q_s, u_s)[0], q_s);
  }
}

// A free motion of three modes whose gap falls below zero for a short time within 0..T.
class Touch {
 public:
  static constexpr double T = 1.0;

  explicit Touch(std::mt19937_64& random)
      : model_(drawn_model(random)), dynamics_(model_), flow_(dynamics_, 0), gap_(flow_.gap(0)) {
    Eigen::Vector3d q, u;
    for (int i = 0; i < 3; ++i) {
      q[i] = uniform(random, -1.0, 1.0);
      u[i] = uniform(random, -6.0, 6.0);
    }
    flow_.enter(q, u, at(0.0), Eigen::VectorXd(0), start_);
    if (!find_lowest()) return;
    const double depth = std::pow(10.0, uniform(random, -9.0, -2.0));
    gap_.constant -= gap(lowest_) + depth;
    touches_ = value(gap_, start_) > 0.0;
  }
  Touch(const Touch&) = delete;

  bool touches() const { return touches_; }

  bool missed_by_search() const {
    EventSearch search;
    const Watch watch{&gap_, 1.0, 0, 0};
    search.begin(start_, {&watch, 1});
    search.advance(T);
    return !search.found() || search.tau() > lowest_;
  }

  bool missed_by_ticks(double h) {
    // The contact is shorter than 0.1, so that only ticks around its middle can detect it.
    const auto middle = static_cast<int>(lowest_ / h);
    const auto around = static_cast<int>(0.1 / h) + 1;
    for (int d = 0; d <= around; ++d) {
      for (const int k : {middle - d, middle + 1 + d}) {
        const double tick = k * h;
        if (k >= 0 && tick <= T && gap(tick) < 0.0) return false;
      }
    }
    return true;
  }

 private:
  static Model drawn_model(std::mt19937_64& random) {
    Model model;
    model.M = Eigen::MatrixXd::Identity(3, 3);
    model.C = 0.1 * Eigen::MatrixXd::Identity(3, 3);
    Eigen::Vector3d kappa;
    for (double& k : kappa) k = std::pow(2.0 * std::numbers::pi * uniform(random, 0.5, 3.0), 2);
    model.K = kappa.asDiagonal();
    Contact contact;
    contact.w = Eigen::Vector3d(1.0, uniform(random, -1.0, 1.0), uniform(random, -1.0, 1.0));
    model.contacts.push_back(contact);
    return model;
  }

  double gap(double t) {
    flow_.propagate(start_, at(t), here_);
    return value(gap_, here_);
  }

  // The deepest minimum inside (0, T), to rounding accuracy.
  bool find_lowest() {
    constexpr int samples = 400;
    double lowest = gap(0.0);
    double at_lowest = 0.0;
    for (int k = 1; k <= samples; ++k) {
      const double gap_k = gap(T * k / samples);
      if (gap_k < lowest) {
        lowest = gap_k;
        at_lowest = T * k / samples;
      }
    }
    if (at_lowest == 0.0 || at_lowest == T) return false;
    lowest_ = at_lowest - T / samples;
    double high = at_lowest + T / samples;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (lowest_ + high);
      (void)gap(middle);
      (rate(gap_, here_) < 0.0 ? lowest_ : high) = middle;
    }
    return true;
  }

  Model model_;
  Dynamics dynamics_;
  Flow flow_;
  Signal gap_;
  Motion start_, here_;
  double lowest_ = 0.0;
  bool touches_ = false;
};

}  // namespace

std::vector<Curve> newton_after_a_closed_clutch() {
  std::vector<Curve> curves;
  for (const ImpactLaw law : {ImpactLaw::newton, ImpactLaw::poisson}) {
    const Vector2d before(-1.0, 0.3);
    const Vector2d after = after_impact(law, coupled_contacts(), Vector2d::Constant(0.7), before);
    Curve curve{law == ImpactLaw::newton ? "Newton" : "Poisson", {}, {}};
    curve.add(0.0, before[1]);
    curve.add(0.5, before[1]);
    curve.add(0.5, after[1]);
    curve.add(1.0, after[1]);
    curves.push_back(curve);
  }
  return curves;
}

double newton_criterion(double difference) {
  const Vector2d epsilon(0.5 + 0.5 * difference, 0.5 - 0.5 * difference);
  const Vector2d D = (1.0 - epsilon.array()) / (1.0 + epsilon.array());
  const Eigen::Matrix2d G = coupled_contacts();
  const Eigen::Matrix2d A = D.asDiagonal() * G + G * D.asDiagonal();
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(A).eigenvalues()[0];
}

std::vector<Curve> unlike_restitution(int pairs) {
  const Eigen::Matrix2d G = coupled_contacts();
  const Eigen::Matrix2d metric = G.inverse();
  std::vector<Curve> curves;
  for (const ImpactLaw law : {ImpactLaw::newton, ImpactLaw::poisson}) {
    std::mt19937_64 random(2014);
    Curve curve{law == ImpactLaw::newton ? "Newton" : "Poisson", {}, {}};
    for (int step = 0; step <= 19; ++step) {
      const double difference = 0.05 * step;
      const Vector2d epsilon(0.5 + 0.5 * difference, 0.5 - 0.5 * difference);
      double largest = 0.0;
      for (int i = 0; i < pairs; ++i) {
        const auto draw = [&] {
          // In separate statements: the evaluation order of arguments is unspecified.
          const double first = uniform(random, -1.0, 1.0);
          const double second = uniform(random, -1.0, 1.0);
          return Vector2d(first, second);
        };
        const Vector2d a = draw();
        const double distance = std::exp(uniform(random, std::log(1e-3), 0.0));
        const Vector2d b = a + distance * draw();
        const Vector2d apart = b - a;
        const Vector2d after = after_impact(law, G, epsilon, b) - after_impact(law, G, epsilon, a);
        largest = std::max(largest, after.dot(metric * after) / apart.dot(metric * apart));
      }
      curve.add(difference, largest);
    }
    curves.push_back(curve);
  }
  return curves;
}

std::vector<Curve> no_damping(double T) {
  std::vector<Curve> curves;
  for (const double damping : {0.0, 0.17}) {
    PaperBeam beam(damping);
    beam.shake();
    Curve curve{damping > 0.0 ? "C of the paper" : "C = 0", {}, {}};
    synchronize(beam.model, beam.master, beam.replica, 0.05, T,
                [&](double t, double V, const Eigen::VectorXd&) { curve.add(t, V); });
    curves.push_back(curve);
  }
  return curves;
}

std::vector<Curve> persistent_contact(double T) {
  PaperBeam beam(0.17);
  const Eigen::VectorXd w = beam.model.contacts[0].w;
  // Presses until t = 30, then pulls.
  beam.model.forces.push_back({w, 0.0, {-0.5, 2.0 * std::numbers::pi / 120.0, 0.0}});
  const Eigen::Vector3d rest = Eigen::Vector3d::Zero();
  const double compliance = w.dot(beam.model.K.llt().solve(w));
  Curve released{"let go at t = 30", {}, {}};
  Curve remainder{"1/2 |c|_K^2 of (17)", {}, {}};
  synchronize(beam.model, {rest, rest}, beam.replica, 0.05, T,
              [&](double t, double V, const Eigen::VectorXd& q) {
                released.add(t, V);
                const double g = w.dot(q);
                if (t < 29.0) remainder.add(t, 0.5 * g * g / compliance);
              });
  return {released, remainder};
}

std::vector<Curve> event_storm(int limit) {
  constexpr double g = 9.81;
  constexpr double epsilon = 0.7;
  Curve plain{"plain event loop", {}, {}};
  double t = std::sqrt(2.0 / g);
  double gamma = epsilon * g * t;
  for (int count = 1; count <= limit; ++count) {
    plain.add(t, count);
    t += 2.0 * gamma / g;
    gamma *= epsilon;
  }

  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({Eigen::VectorXd::Ones(1), -g, {}});
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, epsilon});
  Master master(model, {Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)});
  std::vector<ContactEvent> events;
  master.advance(at(3.0), events);
  Curve completed{"completed", {}, {}};
  int count = 0;
  for (const ContactEvent& event : events) completed.add(event.t, ++count);
  completed.add(3.0, count);
  return {plain, completed};
}

std::vector<Curve> missed_touches(int scenes) {
  const std::vector<double> ticks{1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1};
  std::vector<int> missed(ticks.size(), 0);
  int missed_by_search = 0;
  int touches = 0;
  std::mt19937_64 random(868);
  for (int scene = 0; scene < scenes; ++scene) {
    Touch touch(random);
    if (!touch.touches()) continue;
    ++touches;
    if (touch.missed_by_search()) ++missed_by_search;
    for (std::size_t j = 0; j < ticks.size(); ++j) {
      if (touch.missed_by_ticks(ticks[j])) ++missed[j];
    }
  }
  Curve sampled{"sign check at the ticks", {}, {}};
  Curve searched{"event search", {}, {}};
  for (std::size_t j = 0; j < ticks.size(); ++j) {
    sampled.add(ticks[j], static_cast<double>(missed[j]) / touches);
    searched.add(ticks[j], static_cast<double>(missed_by_search) / touches);
  }
  return {sampled, searched};
}

std::vector<Curve> gap_activation() {
  constexpr double h = 0.25;
  constexpr double epsilon = 0.2;
  constexpr double preload = 1.0;
  std::vector<Curve> curves;
  for (const bool approach_counts : {false, true}) {
    Curve curve{approach_counts ? "active while it approaches" : "active by the gap alone", {}, {}};
    for (int i = -40; i <= 40; ++i) {
      const double gamma = h * preload * i / 40.0;
      const double free = gamma - h * preload;
      const bool active = !approach_counts || gamma <= 0.0;
      const double next = active ? std::max(free, -epsilon * gamma) : free;
      const double work = 0.5 * (next - free) * (next + gamma);  // of the contact's impulse
      curve.add(gamma, work);
    }
    curves.push_back(curve);
  }
  return curves;
}

std::vector<Curve> step_limits() {
  constexpr double omega_h = 2.1;
  constexpr int steps = 60;
  std::vector<Curve> curves;
  const auto follow = [&](const std::string& name, const Eigen::Matrix2d& step) {
    Curve curve{name, {}, {}};
    Vector2d x(1.0, 0.0);
    for (int k = 0; k <= steps; ++k) {
      curve.add(k, std::log10(x.squaredNorm()));
      x = step * x;
    }
    curves.push_back(curve);
  };
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 0.0, omega_h, -omega_h, 0.0).finished();
  follow("explicit Euler", I + A);
  for (const double theta : {0.4, 0.5}) {
    follow(theta < 0.5 ? "theta = 0.4" : "theta = 1/2",
           (I - theta * A).inverse() * (I + (1.0 - theta) * A));
  }
  const double c = std::cos(omega_h);
  const double s = std::sin(omega_h);
  follow("exact flow", (Eigen::Matrix2d() << c, s, -s, c).finished());
  return curves;
}

}  // namespace sprag::stability
