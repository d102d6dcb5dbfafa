// The fields of an observer's messages.
#include "observer/messages.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace sprag {
namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();

EstimateSample two_coordinates() {
  EstimateSample sample;
  sample.session = -3;
  sample.utime = 5;
  sample.tick = 7;
  sample.t = 0.25;
  sample.q = Eigen::Vector2d(1.0, 2.0);
  sample.u = Eigen::Vector2d(-4.0, 8.0);
  return sample;
}

const std::vector<Output>& two_outputs() {
  static const std::vector<Output> outputs{{"tip", Eigen::Vector2d(3.0, -1.0)},
                                           {"v", Eigen::Vector2d(0.0, 0.25), true}};
  return outputs;
}

template <class Message>
void expect_head(const Message& message) {
  EXPECT_EQ(message.session, -3);
  EXPECT_EQ(message.utime, 5);
  EXPECT_EQ(message.tick, 7);
  EXPECT_EQ(message.t, 0.25);
}

TEST(ObserverMessages, Estimate) {
  EstimateSample sample = two_coordinates();
  sample.closed = bit(59) | bit(0);
  sample.settled_tick = 6;
  Confidence& confidence = sample.confidence;
  confidence.has_replica = confidence.has_filter = confidence.from_filter = true;
  confidence.bound = 0.5;
  confidence.sigma_q = Eigen::Vector2d(0.1, unbounded);
  confidence.sigma_u = Eigen::Vector2d(0.3, 0.4);
  confidence.sigma_g = Eigen::VectorXd::Constant(1, 0.6);
  confidence.replica = {0.2, 2, -0.01, 0.0};
  confidence.filter = {0.2, 2, 0.02, 0.03};
  confidence.inconsistencies = 4;
  confidence.last = {0.1, 1, Suspicion::spurious_event, 50.0};
  estimate_t message{};
  fill(message, sample);
  expect_head(message);
  EXPECT_EQ(message.f, 2);
  EXPECT_EQ(message.q, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(message.u, (std::vector<double>{-4.0, 8.0}));
  EXPECT_EQ(static_cast<ContactSet>(message.closed), sample.closed);
  EXPECT_EQ(message.settled_tick, 6);
  EXPECT_EQ(message.estimators, 3);
  EXPECT_EQ(message.from_filter, 1);
  EXPECT_EQ(message.bound, 0.5);
  EXPECT_EQ(message.deviations, 2);
  EXPECT_EQ(message.sigma_q, (std::vector<double>{0.1, unbounded}));
  EXPECT_EQ(message.sigma_u, (std::vector<double>{0.3, 0.4}));
  EXPECT_EQ(message.gaps, 1);
  EXPECT_EQ(message.sigma_g, (std::vector<double>{0.6}));
  EXPECT_EQ(message.closing, 0.2);
  EXPECT_EQ(message.closing_contact, 3);
  EXPECT_EQ(message.replica_gap, -0.01);
  EXPECT_EQ(message.filter_gap, 0.02);
  EXPECT_EQ(message.sigma_filter_gap, 0.03);
  EXPECT_EQ(message.inconsistencies, 4);
  EXPECT_EQ(message.suspect_t, 0.1);
  EXPECT_EQ(message.suspect_contact, 2);
  EXPECT_EQ(message.suspicion, 2);
  EXPECT_EQ(validate(message), Refusal::none);

  // A reused message keeps nothing of a filter.
  sample.confidence = {};
  sample.confidence.has_replica = true;
  fill(message, sample);
  EXPECT_EQ(message.estimators, 1);
  EXPECT_EQ(message.bound, unbounded);
  EXPECT_EQ(message.deviations + message.gaps, 0);
  EXPECT_TRUE(message.sigma_q.empty() && message.sigma_u.empty() && message.sigma_g.empty());
  EXPECT_EQ(message.closing, -1.0);
  EXPECT_EQ(message.closing_contact, 0);
  EXPECT_EQ(message.suspect_contact, 0);
  EXPECT_EQ(validate(message), Refusal::none);
}

TEST(ObserverMessages, Outputs) {
  EstimateSample sample = two_coordinates();
  sample.confidence.from_filter = true;
  sample.confidence.sigma_outputs = Eigen::Vector2d(0.5, unbounded);
  outputs_t message{};
  fill(message, sample, true, two_outputs());
  expect_head(message);
  EXPECT_EQ(message.settled, 1);
  EXPECT_EQ(message.from_filter, 1);
  EXPECT_EQ(message.n, 2);
  EXPECT_EQ(message.name, (std::vector<std::string>{"tip", "v"}));
  EXPECT_EQ(message.value, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(message.sigma, (std::vector<double>{0.5, unbounded}));
  sample.confidence = {};
  fill(message, sample, false, two_outputs());
  EXPECT_EQ(message.settled, 0);
  EXPECT_EQ(message.from_filter, 0);
  EXPECT_EQ(message.sigma, (std::vector<double>{unbounded, unbounded})) << "without a filter";
}

TEST(ObserverMessages, Bounds) {
  EstimateSample sample = two_coordinates();
  sample.confidence.bound = 1e-4;
  sample.confidence.refutations = 2;
  sample.confidence.bound_q = Eigen::Vector2d(1e-3, unbounded);
  sample.confidence.bound_g = Eigen::VectorXd::Constant(1, 2e-3);
  sample.confidence.bound_outputs = Eigen::VectorXd::Constant(1, 3e-3);
  bounds_t message{};
  for (int i = 0; i < 2; ++i) fill(message, sample, two_outputs());
  expect_head(message);
  EXPECT_EQ(message.bound, 1e-4);
  EXPECT_EQ(message.refutations, 2);
  EXPECT_EQ(message.n, 5);
  EXPECT_EQ(message.name, (std::vector<std::string>{"q1", "q2", "g1", "tip", "v"}));
  EXPECT_EQ(message.half_width, (std::vector<double>{1e-3, unbounded, 2e-3, 3e-3, unbounded}));
}

TEST(ObserverMessages, Parameters) {
  EstimateSample sample = two_coordinates();
  ParameterEstimates& parameters = sample.confidence.parameters;
  parameters.keys = std::make_shared<const std::vector<std::string>>(
      std::vector<std::string>{"impact.restitution", "K"});
  parameters.values = Eigen::Vector2d(0.7, -1.5);
  parameters.sigmas = Eigen::Vector2d(0.01, unbounded);
  parameters.accepted = 15.25;
  parameters.known = 16.5;
  parameters.identifications = 4;
  sample.confidence.from_filter = true;
  parameters_t message{};
  fill(message, sample);
  expect_head(message);
  EXPECT_EQ(message.n, 2);
  EXPECT_EQ(message.key, *parameters.keys);
  EXPECT_EQ(message.value, (std::vector<double>{0.7, -1.5}));
  EXPECT_EQ(message.sigma, (std::vector<double>{0.01, unbounded}));
  EXPECT_EQ(message.accepted, 15.25);
  EXPECT_EQ(message.known, 16.5);
  EXPECT_EQ(message.identifications, 4);
  EXPECT_EQ(message.from_filter, 1);
}

TEST(ObserverMessages, Impact) {
  ImpactRecord record;
  record.t = 0.25;
  record.contact = 2;
  record.kind = ContactEventKind::opens;
  record.from_filter = record.sustained = true;
  record.time = {0.26, 1e-3};
  record.before = {-1.0, 0.5};
  record.after = {1.5, 0.25};
  record.impulse = {2.0, unbounded};
  record.force_begin = {3.0, 0.1};
  record.force_end = {4.0, 0.2};
  record.force_largest = {5.0, 0.3};
  record.force_impulse = {6.0, 0.4};
  impact_t message{};
  fill(message, record, -3, 5);
  EXPECT_EQ(message.session, -3);
  EXPECT_EQ(message.utime, 5);
  EXPECT_EQ(message.t, 0.25);
  EXPECT_EQ(message.contact, 3);
  EXPECT_EQ(message.kind, 2);
  EXPECT_EQ(message.from_filter, 1);
  EXPECT_EQ(message.sustained, 1);
  const auto expect_pair = [](const double(&pair)[2], const Uncertain& x) {
    EXPECT_EQ(pair[0], x.value);
    EXPECT_EQ(pair[1], x.sigma);
  };
  expect_pair(message.time, record.time);
  expect_pair(message.velocity_before, record.before);
  expect_pair(message.velocity_after, record.after);
  expect_pair(message.impulse, record.impulse);
  expect_pair(message.force_begin, record.force_begin);
  expect_pair(message.force_end, record.force_end);
  expect_pair(message.force_largest, record.force_largest);
  expect_pair(message.force_impulse, record.force_impulse);
}

TEST(ObserverMessages, Prediction) {
  Prediction prediction{0.5, 0.875, {}};
  prediction.events.push_back({0.75, 2, ContactEventKind::pulse, 0.125});
  prediction.events.push_back({0.875, 0, ContactEventKind::closes, 0.25});
  prediction_t message{};
  for (int i = 0; i < 2; ++i) fill(message, prediction, -3, 5);
  EXPECT_EQ(message.session, -3);
  EXPECT_EQ(message.utime, 5);
  EXPECT_EQ(message.made_at, 0.5);
  EXPECT_EQ(message.certain_until, 0.875);
  EXPECT_EQ(message.count, 2);
  EXPECT_EQ(message.t, (std::vector<double>{0.75, 0.875}));
  EXPECT_EQ(message.contact, (std::vector<std::int32_t>{3, 1}));
  EXPECT_EQ(message.kind, (std::vector<std::int8_t>{3, 1}));
  EXPECT_EQ(message.sigma, (std::vector<double>{0.125, 0.25}));
}

}  // namespace
}  // namespace sprag
