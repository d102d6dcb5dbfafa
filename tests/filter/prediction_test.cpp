// Would catch predictions that differ from the master's next events, or continue where the future
// is ambiguous.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <optional>
#include <random>

#include "sprag/detail/estimates/predictor.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

Belief certain(const Eigen::VectorXd& q, const Eigen::VectorXd& u) {
  const Eigen::Index f = q.size();
  return {q, u, Eigen::MatrixXd::Zero(f, 1), Eigen::MatrixXd::Zero(f, 1), 1};
}

bool is_closing(const PredictedEvent& event) { return event.kind != ContactEventKind::opens; }

// on_event(i, estimator, state) at the tick after event i, if it is the last event of its tick.
template <typename OnEvent>
void follow(TrackingEstimator& estimator, const Scene& scene, std::span<const ContactEvent> events,
            double end, const OnEvent& on_event) {
  TrackingEstimator::State state;
  estimator.start(scene.prior.start, 0, 0, state);
  std::size_t used = 0;
  for (std::int64_t k = 1; tick_instant(k, estimator.h()).hi <= end; ++k) {
    const std::size_t first = used;
    while (used < events.size() && first_tick_after(events[used].t, estimator.h()) <= k) ++used;
    estimator.tick(events.subspan(first, used - first), state);
    if (used > first) on_event(used - 1, state);
  }
}

struct Ahead {
  const char* scene;
  double ahead;  // about ten events: rounding errors grow with each
};

class ExactPredictions : public testing::TestWithParam<Ahead> {};

// From the master's own state, between events and with contacts closed.
TEST_P(ExactPredictions, EqualMasterEvents) {
  const Scene& scene = cached_scene(GetParam().scene);
  const double end = 12.0, ahead = GetParam().ahead;
  const std::vector<ContactEvent> events = master_events(scene, end + ahead);
  const Predictor predictor(scene.model);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> ignored;
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  int compared = 0, closed = 0;
  for (double t = 0.37; t < end; t += 0.731) {
    master.advance(at(t), ignored);
    master.state(at(t), q, u);
    const Prediction prediction = predictor.predict(t, master.closed(), certain(q, u), ahead);
    EXPECT_EQ(prediction.certain_until, t + ahead);
    if (master.closed() != 0) ++closed;
    std::size_t i = 0;
    while (i < events.size() && events[i].t <= t) ++i;
    for (const PredictedEvent& of : prediction.events) {
      ASSERT_LT(i, events.size());
      EXPECT_EQ(of.contact, events[i].contact);
      EXPECT_EQ(of.kind, events[i].kind);
      EXPECT_NEAR(of.t, events[i].t, 1e-9) << "from t = " << t;
      ++i;
      ++compared;
    }
    EXPECT_TRUE(i == events.size() || events[i].t > t + ahead);
  }
  std::cout << GetParam().scene << ": " << compared << " events, " << closed << " times closed\n";
  EXPECT_GT(compared, 5);
}
INSTANTIATE_TEST_SUITE_P(Machines, ExactPredictions,
                         testing::Values(Ahead{"impact_oscillator.toml", 3.0},
                                         Ahead{"non_proportional.toml", 3.0},
                                         Ahead{"two_stops_beam.toml", 0.5},
                                         Ahead{"steel_ruler.toml", 0.2}));

struct PredictionTrial {
  const char* scene;
  double sigma, end, ahead;
};

class PredictionsFromJitteringEvents : public testing::TestWithParam<PredictionTrial> {};

TEST_P(PredictionsFromJitteringEvents, AreCalibrated) {
  const PredictionTrial& of = GetParam();
  Scene scene = cached_scene(of.scene);
  scene.prior.jitter = of.sigma;
  const double end = of.end, ahead = of.ahead;
  const std::vector<ContactEvent> truth = master_events(scene, end + ahead);
  const Predictor predictor(scene.model);
  double sum = 0.0;
  int made = 0, empty = 0, others = 0, listed = 0;
  for (unsigned seed = 7001; seed <= 7012; ++seed) {
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    std::vector<ContactEvent> events;
    double last = 0.0;
    for (ContactEvent event : truth) {
      event.t = last = std::max(event.t + of.sigma * normal(engine), std::nextafter(last, end));
      events.push_back(event);
    }
    TrackingEstimator estimator(scene, end / 1500.0, EstimatorKind::timing);
    follow(estimator, scene, events, end, [&](std::size_t i, const auto& state) {
      const Prediction prediction = estimator.predict(state, predictor, ahead);
      const auto& next = prediction.events;
      const auto closing = std::find_if(next.begin(), next.end(), is_closing);
      if (closing == next.end()) {
        ++empty;
        return;
      }
      std::size_t k = i + 1;
      while (k < truth.size() && truth[k].kind == ContactEventKind::opens) ++k;
      if (k == truth.size()) return;
      if (truth[k].contact != closing->contact || truth[k].kind != closing->kind) {
        ++others;
        return;
      }
      ++made;
      listed += static_cast<int>(next.size());
      sum += square((truth[k].t - closing->t) / closing->sigma);
    });
  }
  std::cout << of.scene << ' ' << of.sigma << ": " << made << " made, " << empty << " empty, "
            << others << " others, " << double(listed) / made << " listed, z^2 " << sum / made
            << '\n';
  EXPECT_GT(made, 60);
  EXPECT_EQ(others, 0);
  EXPECT_GT(sum / made, 0.6);
  EXPECT_LT(sum / made, 1.4);
}
INSTANTIATE_TEST_SUITE_P(Machines, PredictionsFromJitteringEvents,
                         testing::Values(PredictionTrial{"impact_oscillator.toml", 1e-3, 15.0, 2.0},
                                         PredictionTrial{"two_stops_beam.toml", 1e-3, 6.0, 1.0},
                                         PredictionTrial{"steel_ruler.toml", 1e-4, 2.0, 0.1},
                                         PredictionTrial{"bouncing_ball.toml", 1e-3, 15.0, 1.0},
                                         PredictionTrial{"non_proportional.toml", 1e-3, 15.0,
                                                         4.0}));

// A mass of 1 under a constant force, with a support at each of `directions` with its clearance.
Model mass(double force, std::vector<std::pair<double, double>> supports, double restitution) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  if (force != 0.0) model.forces.push_back({Eigen::VectorXd::Ones(1), force, {}});
  for (const auto& [w, clearance] : supports) {
    Contact contact;
    contact.w = Eigen::VectorXd::Constant(1, w);
    contact.clearance = clearance;
    contact.restitution = restitution;
    model.contacts.push_back(contact);
  }
  return model;
}

Belief about(double q, double u, double sigma_q, double sigma_u) {
  Belief belief{Eigen::VectorXd::Constant(1, q), Eigen::VectorXd::Constant(1, u),
                Eigen::MatrixXd::Zero(1, 2), Eigen::MatrixXd::Zero(1, 2), 2};
  belief.S_q(0, 0) = sigma_q;
  belief.S_u(0, 1) = sigma_u;
  return belief;
}

// A mass on a shaken table, with alternating sustained contacts and releases.
TEST(Prediction, PredictsReleaseOfClosedContact) {
  Scene scene;
  scene.model = mass(-1.0, {{1.0, 0.0}}, 0.5);
  scene.model.contacts[0].motion = {0.7, 1.3, 0.4};
  scene.truth.start = {Eigen::VectorXd::Constant(1, 1.5), Eigen::VectorXd::Zero(1)};
  const std::vector<ContactEvent> events = master_events(scene, 60.0);
  const Predictor predictor(scene.model);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> ignored;
  Eigen::VectorXd q(1), u(1);
  int closed = 0, opens = 0;
  for (double t = 0.37; t < 55.0; t += 0.231) {
    master.advance(at(t), ignored);
    master.state(at(t), q, u);
    if (master.closed() != 0) {
      ++closed;
      // For a contact known to be closed the exact position is not needed.
      q[0] += 1e-9;
      u[0] += 1e-9;
    }
    const Prediction prediction = predictor.predict(t, master.closed(), certain(q, u), 5.0);
    auto next = std::find_if(events.begin(), events.end(), [&](const auto& e) { return e.t > t; });
    for (const PredictedEvent& of : prediction.events) {
      ASSERT_NE(next, events.end());
      ASSERT_EQ(of.kind, next->kind) << "at " << t;
      ASSERT_NEAR(of.t, next->t, 1e-9) << "at " << t;
      if (of.kind == ContactEventKind::opens) ++opens;
      ++next;
    }
    EXPECT_TRUE(next == events.end() || next->t > t + 5.0);
  }
  EXPECT_GT(closed, 10);
  EXPECT_GT(opens, 10);
}

// From rest at height h: t_rest = sqrt(2 h / g) (1 + epsilon) / (1 - epsilon). sigma_h of h leads
// to t_rest sigma_h / (2 h), through all impacts.
TEST(Prediction, PredictsEndOfChatter) {
  const double g = 9.81, epsilon = 0.6, height = 0.8, sigma = 0.004, start = 0.5;
  const Predictor predictor(mass(-g, {{1.0, 0.0}}, epsilon));
  const double falls = std::sqrt(2.0 * height / g);
  const double rests = start + falls * (1.0 + epsilon) / (1.0 - epsilon);
  const Prediction prediction = predictor.predict(start, 0, about(height, 0.0, sigma, 0.0), 5.0);
  ASSERT_GT(prediction.events.size(), 10U);
  EXPECT_NEAR(prediction.events.front().t, start + falls, 1e-12);
  const PredictedEvent& last = prediction.events.back();
  EXPECT_EQ(last.kind, ContactEventKind::closes);
  EXPECT_NEAR(last.t, rests, 1e-9);
  EXPECT_NEAR(last.sigma, (rests - start) * sigma / (2.0 * height), 1e-3 * last.sigma);
  EXPECT_EQ(prediction.certain_until, start + 5.0);
}

TEST(Prediction, EndsAtAmbiguousContact) {
  const Predictor predictor(mass(0.0, {{1.0, 1.0}, {-1.0, 1.0}}, 1.0));
  EXPECT_EQ(predictor.predict(0.0, 0, about(0.0, 1.0, 0.01, 0.0), 4.5).events.size(), 2U);
  // Its velocity is small compared with its sigma: either support may be next.
  const Prediction either = predictor.predict(0.0, 0, about(0.0, 0.3, 0.0, 0.2), 10.0);
  EXPECT_TRUE(either.events.empty());
  EXPECT_EQ(either.certain_until, 0.0);
  // sigma grows with each impact.
  const Prediction some = predictor.predict(0.0, 0, about(0.0, 1.0, 0.0, 0.05), 200.0);
  EXPECT_GT(some.events.size(), 1U);
  EXPECT_LT(some.certain_until, 200.0);
  for (const PredictedEvent& event : some.events) EXPECT_GE(event.sigma, 0.049 * event.t);
}

// Two supports form a blunt wedge: the time of the impact is known, but not its side.
TEST(Prediction, EndsAtAmbiguousContactWithKnownTime) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(2, 2);
  model.C = model.K = Eigen::MatrixXd::Zero(2, 2);
  for (const double slope : {1e-3, -1e-3}) {
    Contact side;
    side.w = Eigen::Vector2d(-1.0, slope);
    side.clearance = 1.0;
    side.restitution = 0.5;
    model.contacts.push_back(side);
  }
  const Predictor predictor(model);
  for (const bool known : {true, false}) {
    Belief belief{Eigen::Vector2d(0.5, 0.05), Eigen::Vector2d(1.0, 0.0),
                  Eigen::MatrixXd::Zero(2, 2), Eigen::MatrixXd::Zero(2, 2), 2};
    belief.S_q(0, 0) = 0.01;
    belief.S_q(1, 1) = known ? 0.01 : 0.1;
    const Prediction prediction = predictor.predict(0.0, 0, belief, 1.0);
    ASSERT_EQ(prediction.events.size(), known ? 1U : 0U);
    if (!known) continue;
    EXPECT_EQ(prediction.events[0].contact, 1);
    EXPECT_NEAR(prediction.events[0].t, 0.5 - 5e-5, 1e-12);
    EXPECT_NEAR(prediction.events[0].sigma, 0.01, 1e-6);
  }
}

// The time of an impact is uncertain relative to the interval, or the mass is thrown up against a
// ceiling that it may miss.
TEST(Prediction, EndsAtUncertainImpact) {
  struct Case {
    double force, clearance;
    Belief belief;
    double ahead;
    std::size_t events;
    std::optional<double> certain_until = {};
  };
  for (const Case& of : {Case{0.0, 1.0, about(0.5, 1.0, 0.12, 0.0), 3.0, 1},
                         Case{0.0, 1.0, about(0.5, 1.0, 0.13, 0.0), 3.0, 0},
                         Case{-1.0, 0.49, about(0.0, 1.0, 0.0, 0.02), 1.2, 0, 0.0},
                         Case{-1.0, 0.49, about(0.0, 0.97, 0.0, 0.02), 1.2, 0, 0.0},
                         Case{-1.0, 0.49, about(0.0, 0.9, 0.0, 0.02), 1.2, 0, 1.2},
                         Case{-1.0, 0.49, about(0.0, 1.2, 0.0, 0.02), 0.99, 1}}) {
    const Predictor predictor(mass(of.force, {{-1.0, of.clearance}}, 0.5));
    const Prediction prediction = predictor.predict(0.0, 0, of.belief, of.ahead);
    EXPECT_EQ(prediction.events.size(), of.events) << of.belief.u << of.belief.S_q;
    if (!of.certain_until) continue;
    EXPECT_EQ(prediction.certain_until, *of.certain_until) << of.belief.u << of.belief.S_q;
  }
}

TEST(Prediction, PenetratingStateHasNoPrediction) {
  const Predictor predictor(mass(-1.0, {{1.0, 0.0}}, 0.5));
  const Prediction inside = predictor.predict(1.0, 0, about(-0.1, -1.0, 0.01, 0.0), 3.0);
  EXPECT_TRUE(inside.events.empty());
  EXPECT_EQ(inside.certain_until, 1.0);
  // Its impact has just been processed, at a slightly too early time.
  const Prediction leaving = predictor.predict(1.0, 0, about(-1e-4, 1.0, 1e-4, 0.0), 2.5);
  ASSERT_FALSE(leaving.events.empty());
  EXPECT_NEAR(leaving.events[0].t, 1.0 + 1.0 + std::sqrt(1.0 - 2e-4), 1e-12);
}

TEST(Prediction, ReplicaHasNoSigma) {
  const Scene& scene = cached_scene("two_stops_beam.toml");
  const Predictor predictor(scene.model);
  TrackingEstimator estimator(scene, 1e-3, EstimatorKind::replica);
  int asked = 0;
  follow(estimator, scene, master_events(scene, 6.0), 6.0, [&](std::size_t, const auto& state) {
    ++asked;
    const Prediction prediction = estimator.predict(state, predictor, 1.0);
    EXPECT_TRUE(prediction.events.empty());
    EXPECT_EQ(prediction.certain_until, prediction.made_at);
  });
  EXPECT_GT(asked, 1);
}

}  // namespace
}  // namespace sprag
