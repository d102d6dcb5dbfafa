// Accuracy of a position sensor that is worth a contact switch: a salted Kalman filter (Kong,
// Payne, Zhu and Johnson 2024) that measures the gap at a fixed rate, compared with the timing
// filter, which receives only closing times. Both know the machine exactly and start at the scene's
// replica.
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <limits>

#include "sprag/detail/analysis/quantile.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "studies/common/disturbance.h"
#include "studies/common/random.h"
#include "studies/convergence/belief_columns.h"
#include "studies/convergence/study.h"

namespace sprag::studies {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr int seeds = 5;
constexpr double truth_every = 1e-3;  // [s]; also the faster sensor's
constexpr double shown_every = 0.01;  // interval of V of the timing filter [s]

// One contact. Between measurements the estimate follows the machine's flight and impacts. At an
// impact of the mean the saltation matrix transforms the covariance:
//
//   D R + (F+ - D R F- - R') Dg / gamma-,
//
// R the impact law, R' its derivative with respect to time, F the flow on either side, g the gap.
class SaltedKalmanFilter {
 public:
  // `drift`: variance that each coordinate's velocity gains per unit of time. It covers the error
  // of a linearization about a wrong impact.
  SaltedKalmanFilter(const Scene& scene, double drift)
      : model_(scene.model),
        flows_(scene.model),
        free_(flows_[0]),
        drift_(drift),
        columns_(free_, f(), 8 * f()) {
    belief_.q = scene.prior.start.q;
    belief_.u = scene.prior.start.u;
    belief_.S_q.setZero(f(), 8 * f());
    belief_.S_u.setZero(f(), 8 * f());
    set_start(uncertainty_of(scene), belief_);
    phi_.setZero(8 * f());
    damping_ = model_.M.inverse() * model_.C;
    search_.reserve(1, free_.size());
  }

  void advance(double t) {
    // An endless chatter between two measurements is cut off until the next measurement.
    int impacts = 0;
    while (t_ < t) {
      const bool watched = impacts < most_impacts;
      free_.enter(belief_.q, belief_.u, at(t_), Eigen::VectorXd(0), motion_);
      const double gap = value(free_.gap(0), motion_);
      const double gamma = value(free_.gap_velocity(0), motion_);
      if (gap <= 0.0 && gamma < 0.0 && watched) {
        // A measurement has moved the mean into the support.
        impact(gamma);
        ++impacts;
        continue;
      }
      double tau = t - t_;
      bool hits = false;
      if (gap > 0.0 && watched) {
        const std::array watches{Watch{&free_.gap(0), 1.0, 0, 0}};
        search_.begin(motion_, watches);
        search_.advance(tau);
        hits = search_.found() && search_.tau() <= tau;
        if (hits) tau = search_.tau();
      } else if (watched) {
        tau = std::min(tau, inside_step);
      }
      columns_.move(free_, tau, belief_);
      free_.propagate(motion_, at(t_) + tau, motion_);
      free_.state(motion_, belief_.q, belief_.u);
      t_ = hits ? std::max(t_ + tau, std::nextafter(t_, t)) : t_ + tau;
      grow(tau);
      if (!hits) continue;
      impact(value(free_.gap_velocity(0), motion_));
      ++impacts;
    }
  }

  void measure(double gap, double sigma) {
    const Eigen::Index c = belief_.columns;
    const Contact& contact = model_.contacts[0];
    auto phi = phi_.head(c);
    phi = belief_.S_q.leftCols(c).transpose() * contact.w;
    const PotterUpdate update(phi, gap - sprag::gap(contact, belief_.q, t_), sigma * sigma);
    update.apply(belief_.q, belief_.S_q.leftCols(c));
    update.apply(belief_.u, belief_.S_u.leftCols(c));
  }

  const Belief& belief() const { return belief_; }

 private:
  static constexpr double inside_step = 1e-4;  // [s]
  static constexpr int most_impacts = 50;

  Eigen::Index f() const { return model_.coordinates(); }

  void grow(double tau) {
    if (drift_ == 0.0) return;
    belief_.S_q.middleCols(belief_.columns, f()).setZero();
    belief_.S_u.middleCols(belief_.columns, f()) =
        std::sqrt(drift_ * tau) * Eigen::MatrixXd::Identity(f(), f());
    belief_.columns += f();
    columns_.merge(belief_);
  }

  void impact(double gamma) {
    const Contact& contact = model_.contacts[0];
    const Dynamics& dynamics = flows_.dynamics();
    const Eigen::VectorXd kick =
        (1.0 + contact.restitution) / dynamics.G()(0, 0) * dynamics.MinvW().col(0);
    free_.enter(belief_.q, belief_.u, at(t_), Eigen::VectorXd(0), motion_);
    const double gamma_rate = rate(free_.gap_velocity(0), motion_);
    const Eigen::VectorXd jump = -gamma * kick;
    const Eigen::VectorXd on_u = -damping_ * jump + gamma_rate * kick;
    for (Eigen::Index j = 0; j < belief_.columns; ++j) {
      const double of_gap = contact.w.dot(belief_.S_q.col(j)) / gamma;
      belief_.S_u.col(j) += on_u * of_gap - kick * contact.w.dot(belief_.S_u.col(j));
      belief_.S_q.col(j) += jump * of_gap;
    }
    belief_.u += jump;
  }

  Model model_;
  Flows flows_;
  const Flow& free_;
  double drift_;
  double t_ = 0.0;
  Belief belief_;
  BeliefColumns columns_;
  EventSearch search_;
  Motion motion_;
  Eigen::VectorXd phi_;
  Eigen::MatrixXd damping_;
};

struct Truth {
  std::vector<ContactEvent> events;
  std::vector<State> states;  // every truth_every

  double end() const { return truth_every * static_cast<double>(states.size() - 1); }
  const State& at_tick(std::int64_t k, double h) const {
    return states[static_cast<std::size_t>(k * std::llround(h / truth_every))];
  }
};

Truth simulate(const Scene& scene, double T) {
  Truth truth;
  Master master(scene.model, scene.truth.start);
  State state = scene.truth.start;
  for (std::int64_t k = 0; k <= std::llround(T / truth_every); ++k) {
    master.advance(tick_instant(k, truth_every), truth.events);
    master.state(tick_instant(k, truth_every), state.q, state.u);
    truth.states.push_back(state);
  }
  return truth;
}

// Median of V over the second half of the run.
double V_of_sensor(const Scene& scene, const Truth& truth, double rate_hz, double sigma,
                   double drift, int seed) {
  const double T = truth.end();
  const ErrorEnergy energy(scene.model);
  const Contact& contact = scene.model.contacts[0];
  SaltedKalmanFilter filter(scene, drift);
  common::Random random(static_cast<std::uint64_t>(seed));
  std::vector<double> V;
  const double h = 1.0 / rate_hz;
  for (std::int64_t k = 1; static_cast<double>(k) * h <= T; ++k) {
    const Instant t = tick_instant(k, h);
    filter.advance(t.hi);
    const State& here = truth.at_tick(k, h);
    filter.measure(gap(contact, here.q, t.hi) + sigma * random.normal(), sigma);
    const Belief& belief = filter.belief();
    const double now = energy(here.q, here.u, belief.q, belief.u)[0];
    if (2.0 * t.hi >= T) V.push_back(std::isfinite(now) ? now : infinite);
  }
  return quantile(std::move(V), 0.5);
}

double V_of_switch(Scene scene, const Truth& truth, double jitter, int seed) {
  scene.prior.jitter = jitter;
  const double T = truth.end();
  const auto events =
      common::disturb(truth.events, {.jitter = jitter}, 1, T, static_cast<std::uint64_t>(seed));
  TrackingEstimator filter(scene, shown_every, EstimatorKind::timing);
  TrackingState state;
  filter.start(scene.prior.start, 0, 0, state);
  const ErrorEnergy energy(scene.model);
  State shown = scene.prior.start;
  std::vector<double> V;
  auto next = events.begin();
  for (std::int64_t k = 1; k <= std::llround(T / shown_every); ++k) {
    const auto first = next;
    const double t = tick_instant(k, shown_every).hi;
    while (next != events.end() && next->t <= t) ++next;
    filter.tick({first, next}, state);
    filter.output(state, shown.q, shown.u);
    const State& here = truth.at_tick(k, shown_every);
    if (2.0 * t >= T) V.push_back(energy(here.q, here.u, shown.q, shown.u)[0]);
  }
  return quantile(std::move(V), 0.5);
}

void measure(Table& table, const Scene& scene, const Truth& truth, const char* start) {
  const auto median = [](const auto& run) {
    std::vector<double> V;
    for (int seed = 1; seed <= seeds; ++seed) V.push_back(run(seed));
    return quantile(std::move(V), 0.5);
  };
  for (const double rate_hz : {100.0, 1000.0}) {
    for (const double sigma : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
      double best = infinite;
      for (const double drift : {0.0, 1e-8, 1e-6, 1e-4, 1e-2}) {
        const auto V_of = [&](int seed) {
          return V_of_sensor(scene, truth, rate_hz, sigma, drift, seed);
        };
        best = std::min(best, median(V_of));
      }
      table.add({scene.name.c_str(), start, "position sensor", rate_hz, sigma, best});
    }
  }
  for (const double jitter : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
    const auto V_of = [&](int seed) { return V_of_switch(scene, truth, jitter, seed); };
    table.add({scene.name.c_str(), start, "contact switch", 0.0, jitter, median(V_of)});
  }
}

}  // namespace

void position_sensor(Table& table) {
  // The ball's bounces end at t = 8.1.
  const std::array runs{std::pair("bouncing_ball", 7.0), std::pair("paper_beam", 60.0)};
  for (const auto& [name, T] : runs) {
    Scene scene = read_scene(std::string(SPRAG_SOURCE_DIR "/scenes/") + name + ".toml");
    const Truth truth = simulate(scene, T);
    measure(table, scene, truth, "of the scene");
    // A Kalman filter is local: it starts within the range of its linearization.
    scene.prior.start = scene.truth.start;
    scene.prior.start.q *= 1.001;
    scene.prior.uncertainty.setConstant(1e-6);
    measure(table, scene, truth, "near");
  }
}

}  // namespace sprag::studies
