// The observer as a library: events in any order, late events, provisional estimates, and the same
// bits as a time line that receives every event in time.
#include "sprag/observer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <stdexcept>

#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

constexpr double tick_length = 0.01;
constexpr double duration = 20.0;

const char* const scenes[] = {"paper_beam", "paper_beam_chatter", "two_stops_beam", "lab_rig"};

Scene scene_of(const std::string& name) {
  return read_scene(SPRAG_SOURCE_DIR "/scenes/" + name + ".toml");
}

std::vector<ContactEvent> events_of(const Scene& scene) {
  return simulate(scene.model, scene.truth.start, duration, 0.0).events;
}

// Events of one instant keep their order.
std::vector<ContactEvent> shuffled(const std::vector<ContactEvent>& events, std::uint64_t seed) {
  std::vector<std::vector<ContactEvent>> instants;
  for_each_instant(std::span(events), [&](std::span<const ContactEvent> of_one) {
    instants.emplace_back(of_one.begin(), of_one.end());
  });
  std::mt19937_64 engine(seed);
  std::shuffle(instants.begin(), instants.end(), engine);
  std::vector<ContactEvent> all;
  for (const auto& of_one : instants) all.insert(all.end(), of_one.begin(), of_one.end());
  return all;
}

bool same(const Estimate& a, const Estimate& b) {
  return a.tick == b.tick && a.t == b.t && a.q == b.q && a.u == b.u && a.closed == b.closed &&
         a.of_filter == b.of_filter && a.sigma_q == b.sigma_q && a.sigma_u == b.sigma_u &&
         a.sigma_gap == b.sigma_gap;
}

class ObserverTest : public testing::TestWithParam<std::tuple<const char*, EstimatorKind>> {
 protected:
  Scene scene_ = scene_of(std::get<0>(GetParam()));
  ObserverSettings settings_{tick_length, std::get<1>(GetParam())};
  std::vector<ContactEvent> events_ = events_of(scene_);
};

TEST_P(ObserverTest, EqualsTimeLineWithPromptReports) {
  std::vector<Estimate> expected;
  {
    TrackingEstimator estimator(scene_, tick_length, settings_.estimator);
    const int contacts = static_cast<int>(scene_.model.contacts.size());
    TimeLine line(estimator, contacts, scene_.prior.start, 1);
    line.restart(0, 0, 0, no_horizon);
    for (const ContactEvent& event : events_) line.receive(event);
    line.set_horizon(duration);
    Confidence confidence = estimator.no_confidence();
    line.run(
        0, [](const auto&) {},
        [&](const TrackingEstimator::State& state) {
          Estimate estimate;
          estimate.tick = state.tick;
          estimate.t = tick_instant(state.tick, tick_length).hi;
          estimate.q.resize(scene_.model.coordinates());
          estimate.u.resize(scene_.model.coordinates());
          estimator.output(state, estimate.q, estimate.u);
          estimator.confidence(state, confidence);
          estimate.closed = state.chi;
          estimate.of_filter = confidence.from_filter;
          estimate.sigma_q = confidence.sigma_q;
          estimate.sigma_u = confidence.sigma_u;
          estimate.sigma_gap = confidence.sigma_g;
          expected.push_back(estimate);
          return true;
        });
  }
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE(seed);
    Observer observer(scene_, settings_);
    for (const ContactEvent& event : shuffled(events_, seed)) EXPECT_TRUE(observer.take(event));
    std::vector<Estimate> settled;
    for (double t = 0.0; t < duration + 1.0; t += 0.7) {
      observer.set_horizon(std::min(t, duration));
      for (const Estimate& estimate : observer.settle()) settled.push_back(estimate);
    }
    ASSERT_EQ(settled.size(), expected.size());
    for (std::size_t i = 0; i < settled.size(); ++i) {
      ASSERT_TRUE(same(settled[i], expected[i])) << "tick " << i;
      ASSERT_TRUE(settled[i].settled);
    }
  }
}

TEST_P(ObserverTest, ObservesARecordingAtOnce) {
  const Estimates all = observe(scene_, events_, duration, settings_);
  Observer observer(scene_, settings_);
  for (const ContactEvent& event : events_) observer.take(event);
  observer.set_horizon(duration);
  const std::vector<Estimate> settled = observer.settle();
  ASSERT_EQ(all.t.size(), static_cast<Eigen::Index>(settled.size()));
  for (const Estimate& of : settled) {
    const auto k = static_cast<Eigen::Index>(of.tick);
    ASSERT_EQ(all.t[k], of.t);
    ASSERT_EQ(all.q.row(k).transpose(), of.q);
    ASSERT_EQ(all.u.row(k).transpose(), of.u);
    ASSERT_EQ(all.bound[k], of.bound);
    ASSERT_EQ(all.of_filter[static_cast<std::size_t>(k)] != 0, of.of_filter);
    if (of.sigma_q.size() == 0) continue;
    ASSERT_EQ(all.sigma_q.row(k).transpose(), of.sigma_q);
    ASSERT_EQ(all.sigma_gap.row(k).transpose(), of.sigma_gap);
  }
  EXPECT_EQ(all.counts.events, static_cast<std::int64_t>(events_.size()));
}

TEST_P(ObserverTest, ProvisionalEqualsSettledWithCompleteEvents) {
  Observer observer(scene_, settings_);
  Observer late(scene_, settings_);
  const std::size_t half = events_.size() / 2;
  for (std::size_t i = 0; i < half; ++i) late.take(events_[i]);
  const double t = 0.5 * duration;
  late.at(t);  // ahead, without the later half of the events
  for (std::size_t i = half; i < events_.size(); ++i) late.take(events_[i]);
  for (const ContactEvent& event : events_) observer.take(event);
  const Estimate now = late.at(t);
  const Estimate further = late.at(duration);
  EXPECT_FALSE(now.settled);
  EXPECT_TRUE(std::isinf(now.bound));
  observer.set_horizon(duration);
  const std::vector<Estimate> settled = observer.settle();
  EXPECT_TRUE(same(now, settled[static_cast<std::size_t>(now.tick)]));
  EXPECT_TRUE(same(further, settled[static_cast<std::size_t>(further.tick)]));
  // From the middle, with half of the ticks settled.
  late.set_horizon(t);
  late.settle();
  EXPECT_TRUE(same(late.at(duration), further));
}

INSTANTIATE_TEST_SUITE_P(Scenes, ObserverTest,
                         testing::Values(std::tuple{scenes[0], EstimatorKind::both},
                                         std::tuple{scenes[1], EstimatorKind::replica},
                                         std::tuple{scenes[1], EstimatorKind::timing},
                                         std::tuple{scenes[2], EstimatorKind::both},
                                         std::tuple{scenes[3], EstimatorKind::replica}));

TEST(Observer, RefusesLateEventsWithMessage) {
  const Scene scene = scene_of("paper_beam");
  const std::vector<ContactEvent> events = events_of(scene);
  Observer observer(scene, {.tick = tick_length});
  observer.set_horizon(5.0);
  EXPECT_FALSE(observer.take(events.front()));
  EXPECT_FALSE(observer.take({6.0, 1, ContactEventKind::pulse})) << "there is one contact";
  EXPECT_FALSE(observer.take({std::nan(""), 0, ContactEventKind::pulse}));
  EXPECT_TRUE(observer.take({6.0, 0, ContactEventKind::opens})) << "it contradicts, seen later";
  observer.set_horizon(7.0);
  const std::vector<Estimate> settled = observer.settle();
  EXPECT_GT(settled.back().bound, scene.prior.uncertainty.sum()) << "events may be missing";
  EXPECT_EQ(observer.counts().of(Skip::contradicting), 1);
  EXPECT_EQ(observer.counts().of(Skip::unknown_contact), 1);
  EXPECT_EQ(observer.counts().events, 0);
  EXPECT_THROW(observer.at(6.0), std::invalid_argument);
  EXPECT_THROW(observer.at(std::nan("")), std::invalid_argument);
}

TEST(Observer, HasBoundWithCompleteEvents) {
  const Scene scene = scene_of("paper_beam");
  const Estimates all = observe(scene, events_of(scene), duration, {.tick = tick_length});
  EXPECT_NEAR(all.bound[0], scene.prior.uncertainty.sum(), 1e-12);
  EXPECT_LT(all.bound[all.bound.size() - 1], 0.2 * all.bound[0]);
}

TEST(Observer, CanBeMoved) {
  const Scene scene = scene_of("lab_rig");
  std::vector<Observer> observers;
  observers.emplace_back(scene, ObserverSettings{.tick = tick_length});
  observers.emplace_back(scene, ObserverSettings{.tick = tick_length});
  Observer moved = std::move(observers.front());
  for (const ContactEvent& event : events_of(scene)) moved.take(event);
  moved.set_horizon(1.0);
  EXPECT_EQ(moved.settle().size(), 101U);
}

TEST(Observer, RefusesInvalidSettings) {
  const Scene scene = scene_of("lab_rig");
  EXPECT_THROW(Observer(scene, {.tick = 0.0}), std::invalid_argument);
  EXPECT_THROW(observe(scene, {}, -1.0), std::invalid_argument);
}

TEST(Observer, RefusesAStartWithoutVelocities) {
  Scene scene = scene_of("lab_rig");
  scene.prior.start.u.resize(0);
  scene.truth.start.u.resize(0);
  EXPECT_THROW(Observer(scene, {}), std::invalid_argument);
  EXPECT_THROW(simulate(scene.model, scene.truth.start, 1.0, 0.0), std::invalid_argument);
}

// The model built in code equals that of the scene file, bit for bit.
TEST(BeamInCode, EqualsSceneFileBitForBit) {
  const Scene scene = scene_of("paper_beam");
  const Harmonic shake{.amplitude = 0.03, .frequency = 9.5};
  const Beam beam{.modes = 3, .damping = 0.17};
  Model model = beam_model(beam, shake);
  model.contacts = {beam_contact(beam, 0.868, Side::below, 0.0, 0.7, shake)};
  model.chatter_time = scene.model.chatter_time;
  const Simulation a = simulate(model, scene.truth.start, duration, tick_length);
  const Simulation b = simulate(scene.model, scene.truth.start, duration, tick_length);
  EXPECT_EQ(a.events, b.events);
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.u, b.u);
}

}  // namespace
}  // namespace sprag
