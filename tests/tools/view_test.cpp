// The page of `view`: it shows the content of the messages, histories keep their peaks within their
// memory, and only the page itself is answered. Other machines than the paper's beam.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/observer.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tools/sync_logger/logger.h"
#include "tools/view/client.h"
#include "tools/view/gateway/rules.h"
#include "tools/view/history.h"
#include "tools/view/raster.h"
#include "tools/view/reception.h"
#include "tools/view/watch.h"

namespace sprag::view {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t memory = 1U << 20U;
constexpr std::int64_t second = 1'000'000'000;

TEST(History, EveryPixelKeepsMinimumAndMaximumOfAnyAge) {
  constexpr int rows = 300000;
  constexpr int pixels = 200;
  std::mt19937_64 generator(11);
  std::normal_distribution<double> noise;
  History history(2, memory);
  std::vector<double> t, y;
  for (int i = 0; i < rows; ++i) {
    t.push_back(0.001 * i);
    y.push_back(static_cast<float>(noise(generator)));
    const std::array<double, 2> row{0.0, y.back()};
    ASSERT_TRUE(history.add(t.back(), row));
  }
  const std::vector<History::Wanted> wanted{{1, Keep::both}};
  for (const auto& [from, to] :
       {std::pair(0.0, 300.0), {17.0, 203.0}, {299.5, 299.9}, {290.0, 400.0}}) {
    const Rows kept = history.thinned({from, to, pixels}, wanted);
    EXPECT_TRUE(std::is_sorted(kept.t.begin(), kept.t.end()));
    EXPECT_LE(kept.t.size(), 2u * (pixels + 2));
    double least = infinity, greatest = -infinity;
    for (int i = 0; i < rows; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (t[k] < from || t[k] > to) continue;
      least = std::min(least, y[k]);
      greatest = std::max(greatest, y[k]);
    }
    // The rows next to the window on both sides may be outside.
    EXPECT_LE(*std::min_element(kept.values[0].begin(), kept.values[0].end()), least) << from;
    EXPECT_GE(*std::max_element(kept.values[0].begin(), kept.values[0].end()), greatest) << from;
    EXPECT_LE(kept.t.front(), from + 0.2);
    EXPECT_GE(kept.t.back(), std::min(to, t.back()) - 0.002) << "up to the newest row";
  }
}

TEST(History, FewRowsAreUnchanged) {
  History history(1, memory);
  const std::vector<double> y{3.0, -1.0, 7.0, 2.0};
  for (std::size_t i = 0; i < y.size(); ++i) history.add(static_cast<double>(i), {&y[i], 1});
  const Rows rows =
      history.thinned({0.0, 3.0, 1000}, std::vector<History::Wanted>{{0, Keep::both}});
  EXPECT_EQ(rows.t, (std::vector<double>{0.0, 1.0, 2.0, 3.0}));
  EXPECT_EQ(rows.values[0], y);
  const double once_more = 9.0;
  EXPECT_FALSE(history.add(3.0, {&once_more, 1})) << "time does not rise";
}

TEST(History, BandKeepsOutlineAndGapsAreNotANumber) {
  History history(2, memory);
  for (int i = 0; i < 1000; ++i) {
    const bool known = i >= 500;
    const std::array<double, 2> row{known ? -1.0 - i % 7 : infinity,
                                    known ? 1.0 + i % 5 : infinity};
    history.add(i, row);
  }
  const Rows rows = history.thinned(
      {0.0, 999.0, 10}, std::vector<History::Wanted>{{0, Keep::least}, {1, Keep::greatest}});
  EXPECT_TRUE(std::isnan(rows.values[0].front()));
  EXPECT_EQ(rows.values[0].rbegin()[1], -7.0);
  EXPECT_EQ(rows.values[1].rbegin()[1], 5.0);
}

TEST(History, MemoryIsConstantAndCoversTheWholeRun) {
  History history(1, memory);
  // A week of ticks at 10 Hz.
  const int rows = 6'000'000;
  for (int i = 0; i < rows; ++i) {
    const double y = i == 1234 ? 5.0 : 0.0;
    history.add(0.1 * i, {&y, 1});
  }
  EXPECT_EQ(history.first_t(), 0.0);
  const Rows all =
      history.thinned({0.0, 0.1 * rows, 800}, std::vector<History::Wanted>{{0, Keep::both}});
  EXPECT_LE(all.t.size(), 1700u);
  EXPECT_EQ(*std::max_element(all.values[0].begin(), all.values[0].end()), 5.0) << "a single peak";
}

TEST(Raster, ClosuresWithinOnePixelAreMerged) {
  using Kind = ContactEventKind;
  Raster raster(2);
  raster.add({1.0, 0, Kind::pulse});
  raster.add({1.01, 0, Kind::pulse});
  raster.add({2.0, 1, Kind::closes});
  raster.add({5.0, 0, Kind::pulse});
  raster.add({6.0, 1, Kind::opens});
  raster.add({7.0, 1, Kind::closes});
  const auto coarse = raster.thinned({0.0, 10.0, 100});
  ASSERT_EQ(coarse[0].size(), 2u);
  EXPECT_EQ(coarse[0][0].to, 1.01);
  ASSERT_EQ(coarse[1].size(), 2u);
  EXPECT_EQ(coarse[1][0].from, 2.0);
  EXPECT_EQ(coarse[1][1].to, infinity) << "still closed";
  EXPECT_EQ(raster.thinned({0.9, 1.1, 100})[0].size(), 2u);
  EXPECT_EQ(raster.thinned({3.0, 4.0, 100})[1].size(), 1u) << "closed all the while";
  EXPECT_TRUE(raster.closed(1));
  EXPECT_EQ(raster.events(0), 3u);
  Raster small(1, 10);
  for (int i = 0; i < 1000; ++i) small.add({double(i), 0, Kind::pulse});
  EXPECT_EQ(small.thinned({0.0, 2000.0, 100000})[0].size(), 10u);
  EXPECT_EQ(small.events(0), 1000u);
}

// Two carriages, the second between springs and a stop; another machine than those of the scenes.
Scene two_carriages() {
  return parse_scene(R"(
name = "two_carriages"
[system]
M = [[2.0, 0.0], [0.0, 1.0]]
C = [[0.4, -0.1], [-0.1, 0.2]]
K = [[9.0, -3.0], [-3.0, 5.0]]
[[force]]
direction = [1.0, 0.0]
amplitude = 2.0
frequency = 2.7
[impact]
restitution = 0.5
[[contact]]
direction = [0.0, 1.0]
clearance = 0.1
[master]
q = [0.3, 0.4]
[replica]
q = [0.1, 0.2]
uncertainty = [0.1, 0.1]
)",
                     "two_carriages.toml");
}

estimate_t estimate_at(std::int64_t tick, double q, double sigma) {
  estimate_t estimate{};
  estimate.session = 5;
  estimate.tick = tick;
  estimate.t = 0.01 * static_cast<double>(tick);
  estimate.f = 2;
  estimate.q = {-q, q};
  estimate.u = {0.0, 0.0};
  estimate.estimators = 3;
  estimate.from_filter = 1;
  estimate.bound = infinity;
  estimate.deviations = 2;
  estimate.sigma_q = estimate.sigma_u = {sigma, sigma};
  estimate.gaps = 1;
  estimate.sigma_g = {sigma};
  estimate.closing = estimate.suspect_t = -1.0;
  return estimate;
}

ContactMessage contacts_at(double horizon, std::int64_t sequence) {
  ContactMessage message;
  message.session = 5;
  message.sequence = sequence;
  message.horizon = horizon;
  message.contacts = 1;
  return message;
}

TEST(Watch, LastEstimateOfTickIsShown) {
  Watch watch(two_carriages());
  watch.take(contacts_at(0.0, 1), {0, 0});
  watch.take_settled(estimate_at(1, 0.1, 0.01), {1, 0});
  watch.take_estimate(estimate_at(2, 0.2, 0.01), {2, 0});
  watch.take_estimate(estimate_at(3, 0.3, 0.01), {3, 0});
  watch.take_estimate(estimate_at(3, 0.5, 0.01), {4, 0});
  Frame frame = watch.frame(5);
  ASSERT_TRUE(frame.now);
  EXPECT_EQ(frame.now->q[1], 0.5);
  EXPECT_EQ(frame.settled->q[1], 0.1);
  const Window window{0.0, 1.0, 100};
  EXPECT_EQ(watch.curves(0, window).estimate.t, (std::vector<double>{0.01, 0.02, 0.03}));
  // c = 0.1: the gap, and two sigma on both sides.
  const Rows rows = watch.curves(0, window).estimate;
  EXPECT_NEAR(rows.values[1][2], 0.6, 1e-6);
  EXPECT_NEAR(rows.values[0][2], 0.58, 1e-6);
  EXPECT_NEAR(rows.values[2][2], 0.62, 1e-6);

  // A settled estimate replaces the provisional one, and stays.
  watch.take_settled(estimate_at(2, 0.7, 0.01), {6, 0});
  watch.take_estimate(estimate_at(2, 9.0, 0.01), {7, 0});
  watch.take_settled(estimate_at(2, 9.0, 0.01), {8, 0});
  EXPECT_NEAR(watch.curves(0, window).estimate.values[1][1], 0.8, 1e-6);
  EXPECT_EQ(watch.frame(9).settled->q[1], 0.7);
}

// The bounds of another process' observer at one tick: q1, q2, g1.
bounds_t bounds_at(std::int64_t tick, std::vector<double> half_widths) {
  bounds_t sample{};
  sample.session = 5;
  sample.tick = tick;
  sample.t = 0.01 * static_cast<double>(tick);
  sample.n = 3;
  sample.name = {"q1", "q2", "g1"};
  sample.half_width = std::move(half_widths);
  return sample;
}

TEST(Watch, GuaranteedBandIsAroundSettledEstimateOfItsTick) {
  Watch watch(two_carriages());
  watch.take(contacts_at(0.0, 1), {0, 0});
  const Window window{0.0, 1.0, 100};
  const auto band = [&](std::size_t quantity) { return watch.curves(quantity, window).guaranteed; };
  watch.take(bounds_at(1, {0.1, 0.2, 0.3}), {1, 0});
  EXPECT_TRUE(band(0).t.empty()) << "no estimate of this tick has settled";
  watch.take_settled(estimate_at(1, 0.4, 0.01), {2, 0});
  watch.take(bounds_at(2, {0.1, 0.2, 0.3}), {3, 0});
  EXPECT_TRUE(band(0).t.empty()) << "of another tick";
  watch.take(bounds_at(1, {0.1, 0.2, 0.3}), {4, 0});
  watch.take_settled(estimate_at(2, 0.6, 0.01), {5, 0});
  watch.take(bounds_at(2, {0.1, infinity, 0.3}), {6, 0});
  // The gap is 0.1 + q2; quantities are g1, q1, q2.
  EXPECT_EQ(band(0).t, (std::vector<double>{0.01, 0.02}));
  EXPECT_NEAR(band(0).values[0][0], 0.2, 1e-6);
  EXPECT_NEAR(band(0).values[1][0], 0.8, 1e-6);
  EXPECT_NEAR(band(1).values[0][0], -0.5, 1e-6);
  EXPECT_NEAR(band(1).values[1][0], -0.3, 1e-6);
  EXPECT_NEAR(band(2).values[1][0], 0.6, 1e-6);
  EXPECT_TRUE(std::isnan(band(2).values[0][1])) << "nothing is guaranteed";
  EXPECT_TRUE(std::isnan(band(2).values[1][1]));

  bounds_t other = bounds_at(2, {0.1, 0.2, 0.3});
  other.session = 6;
  watch.take(other, {7, 0});
  EXPECT_EQ(watch.of_others(), 1);
  for (const std::size_t count : {0U, 4U}) {
    other = bounds_at(2, std::vector<double>(count, 0.1));
    other.n = static_cast<std::int32_t>(count);
    other.name.resize(count);
    watch.take(other, {8, 0});
  }
  EXPECT_EQ(watch.misfits(), 2) << "other machines";
  EXPECT_EQ(band(0).t.size(), 2U);
}

TEST(Watch, ReplicaHasNoDeviations) {
  Watch watch(two_carriages());
  estimate_t sample = estimate_at(1, 0.1, 0.01);
  sample.from_filter = 0;
  watch.take_settled(sample, {1, 0});
  const Frame frame = watch.frame(2);
  EXPECT_EQ(frame.badge, Badge::replica);
  EXPECT_TRUE(frame.sigma.empty());
  EXPECT_FALSE(frame.contacts[0].sigma);
  EXPECT_TRUE(std::isnan(watch.curves(0, {0.0, 1.0, 10}).estimate.values[0][0]));
}

TEST(Watch, InnovationsAreKeptOncePerClosing) {
  Watch watch(two_carriages());
  EXPECT_FALSE(watch.frame(0).innovation);
  const auto settle = [&](std::int64_t tick, const Innovation& closing) {
    estimate_t sample = estimate_at(tick, 0.1, 0.01);
    sample.closing = closing.t;
    sample.closing_contact = closing.t < 0.0 ? 0 : closing.contact + 1;
    sample.filter_gap = closing.gap;
    sample.sigma_filter_gap = closing.deviation;
    watch.take_settled(sample, {tick, 0});
  };
  settle(1, {});                          // before the first closing
  settle(2, {0.015, 0, 1e-3, 0.0});       // without a prediction
  settle(3, {0.025, 0, 1e-3, infinity});  // of unknown deviation
  settle(4, {0.035, 0, -3e-3, 2e-3});
  settle(5, {0.035, 0, -3e-3, 2e-3});
  settle(6, {0.055, 0, 1e-3, 4e-3});
  const Rows shown = watch.curves(0, {0.0, 1.0, 1000}).innovation;
  EXPECT_EQ(shown.t, (std::vector<double>{0.035, 0.055}));
  EXPECT_EQ(shown.values[0], (std::vector<double>{-1.5, 0.25}));
  const std::optional<ClosingInnovation> last = watch.frame(7).innovation;
  ASSERT_TRUE(last);
  EXPECT_EQ(last->t, 0.055);
  EXPECT_EQ(last->contact, 0);
  EXPECT_EQ(last->ratio, 0.25);
}

// c = 0.1: the gap is 0.1 + q2.
TEST(Watch, AnEstimateInsideASupportIsMarked) {
  Watch watch(two_carriages());
  watch.take(contacts_at(0.0, 1), {0, 0});
  const std::vector<double> q{0.1, -0.05, -0.3, -0.2, 0.1, 0.2, -0.4};
  for (std::size_t k = 0; k < q.size(); ++k) {
    estimate_t sample = estimate_at(static_cast<std::int64_t>(k) + 1, q[k], infinity);
    sample.from_filter = 0;
    watch.take_settled(sample, {static_cast<std::int64_t>(k), 0});
    EXPECT_NEAR(watch.frame(8).penetration, std::max(-0.1 - q[k], 0.0), 1e-15);
  }
  const std::vector<Closure> inside = watch.curves(0, {0.0, 1.0, 1000}).penetrating;
  ASSERT_EQ(inside.size(), 2U);
  EXPECT_EQ(inside[0].from, 0.03);
  EXPECT_EQ(inside[0].to, 0.05);
  EXPECT_EQ(inside[1].from, 0.07);
  EXPECT_EQ(inside[1].to, infinity) << "still";
  // A new session starts without intervals inside a support.
  ContactMessage other = contacts_at(0.0, 1);
  for (other.session = 9; other.sequence < 5; ++other.sequence) {
    watch.take(other, {2 * second + other.sequence, 0});
  }
  EXPECT_TRUE(watch.curves(0, {0.0, 1.0, 1000}).penetrating.empty());
}

Scene two_driven_carriages(double stream_duration) {
  Scene scene = two_carriages();
  std::vector<double> t, a;
  for (int k = 0; k <= 5000; ++k) {
    t.push_back(0.001 * k);
    a.push_back(k == 1234 ? 5.0 : std::sin(0.01 * k));
  }
  scene.model.forces.push_back(
      {Eigen::Vector2d(1.0, 0.0),
       0.0,
       {},
       std::make_shared<const SampledInput>(t, a, SampledInput::Settings{.gain = 2.0})});
  scene.stream_duration = stream_duration;
  return scene;
}

TEST(Watch, ARecordedInputHasACurveThatKeepsItsPeaks) {
  const Scene scene = two_driven_carriages(0.0);
  Watch watch(scene);
  const std::string key = "force." + std::to_string(scene.model.forces.size());
  EXPECT_EQ(watch.input_label(), key + " [unit of the force]");
  const Rows all = watch.curves(0, {0.0, 10.0, 100}).input;
  EXPECT_LE(all.t.size(), 204U);
  EXPECT_TRUE(std::is_sorted(all.t.begin(), all.t.end()));
  EXPECT_EQ(*std::max_element(all.values[0].begin(), all.values[0].end()), 10.0);
  const Rows few = watch.curves(0, {1.2, 1.25, 100}).input;
  ASSERT_GE(few.t.size(), 50U);
  EXPECT_LE(few.t.front(), 1.2);
  EXPECT_NEAR(few.values[0][10], scene.model.forces.back().input->value(few.t[10]), 1e-12);
  EXPECT_TRUE(watch.curves(0, {-3.0, -1.0, 100}).input.t.empty());
  EXPECT_TRUE(Watch(two_carriages()).input_label().empty());
}

TEST(Watch, AStreamedInputIsDrawnAsItsSamplesArrive) {
  Watch watch(two_driven_carriages(60.0));
  watch.take(contacts_at(0.0, 1), {0, 0});
  InputMessage message;
  message.session = 5;
  message.t0 = 0.5;
  message.dt = 0.001;
  message.n = 3;
  message.value = {1.0, 2.0, 3.0};
  for (const std::int64_t total : {3, 5, 4}) {  // the last one is late
    message.total = total;
    watch.take(message, {total, 0});
  }
  const Rows rows = watch.curves(0, {0.49, 0.51, 100}).input;
  ASSERT_EQ(rows.t.size(), 5U);
  EXPECT_NEAR(rows.t.back(), 0.504, 1e-12);
  EXPECT_EQ(rows.values[0], (std::vector<double>{2.0, 4.0, 6.0, 4.0, 6.0}));
  message.session = 7;
  watch.take(message, {9, 0});
  EXPECT_EQ(watch.of_others(), 1);
}

TEST(Watch, BadgeNamesSourceOfEstimate) {
  Watch watch(two_carriages());
  EXPECT_EQ(watch.frame(0).badge, Badge::waiting);
  watch.take(contacts_at(0.0, 1), {0, 0});
  watch.take_estimate(estimate_at(1, 0.1, 0.01), {0, 0});
  EXPECT_EQ(watch.frame(second / 10).badge, Badge::filter);
  EXPECT_EQ(watch.frame(second * 7 / 10).badge, Badge::free) << "no contact messages arrive";
  EXPECT_EQ(watch.frame(3 * second).badge, Badge::waiting) << "no estimates either";

  watch.take(contacts_at(4.0, 2), {4 * second, 0});
  watch.take_estimate(estimate_at(400, 0.1, 0.01), {4 * second, 0});
  health_t health{};
  health.session = 6;
  health.master = static_cast<std::int8_t>(MasterState::silent);
  watch.take(health, {4 * second, 0});
  EXPECT_EQ(watch.frame(4 * second).badge, Badge::filter) << "of another run";
  health.session = 5;
  watch.take(health, {4 * second, 0});
  EXPECT_EQ(watch.frame(4 * second).badge, Badge::free) << "the observer does not receive them";
}

TEST(Watch, OtherMasterResetsAndStrangersAreIgnored) {
  Watch watch(two_carriages());
  watch.take(contacts_at(0.0, 1), {0, 0});
  watch.take_settled(estimate_at(1, 0.1, 0.01), {0, 0});
  estimate_t stranger = estimate_at(2, 0.9, 0.01);
  stranger.session = 6;
  watch.take_settled(stranger, {1, 0});
  EXPECT_EQ(watch.of_others(), 1);
  EXPECT_EQ(watch.frame(1).settled->tick, 1);
  for (int i = 0; i < 5; ++i) {
    ContactMessage message = contacts_at(0.0, i);
    message.session = 6;
    watch.take(message, {second + i, 0});
  }
  EXPECT_FALSE(watch.frame(second + 9).settled);
  watch.take_settled(stranger, {second + 9, 0});
  EXPECT_EQ(watch.frame(second + 9).session, 6);
  EXPECT_EQ(watch.frame(second + 9).settled->tick, 2);
  state_t other{};
  other.session = 6;
  other.f = 3;
  other.q = other.u = {0.0, 0.0, 0.0};
  watch.take(other, {second + 10, 0});
  EXPECT_EQ(watch.misfits(), 1) << "a machine of three coordinates";
}

TEST(Watch, UnsettledEstimatesAreBoundedAndShown) {
  Watch watch(two_carriages());
  for (int i = 1; i < 50000; ++i) watch.take_estimate(estimate_at(i, 0.1, 0.01), {i, 0});
  const Curves curves = watch.curves(0, {0.0, 600.0, 100000});
  EXPECT_LE(curves.estimate.t.size(), 4097u);
  EXPECT_LT(curves.estimate.t.front(), 1.0);
  EXPECT_EQ(curves.estimate.t.back(), 499.99);
  double widest = 0.0;
  for (std::size_t i = 1; i < curves.estimate.t.size(); ++i) {
    widest = std::max(widest, curves.estimate.t[i] - curves.estimate.t[i - 1]);
  }
  EXPECT_LT(widest, 1.0) << "all of the time is there, only coarser";
}

TEST(Watch, EnergiesEqualThoseOfTheLogger) {
  const Scene scene = two_carriages();
  constexpr double tick = 0.01;
  const Simulation machine = simulate(scene.model, scene.truth.start, 20.0, tick);
  ASSERT_GT(machine.events.size(), 3u);
  Observer observer(scene, {.tick = tick});
  for (const ContactEvent& event : machine.events) observer.take(event);
  observer.set_horizon(20.0);
  Watch watch(scene);
  Pairing logger(scene.model);
  const SyncRow* row = nullptr;
  int rows = 0;
  for (const Estimate& estimate : observer.settle()) {
    const Eigen::VectorXd q = machine.q.row(estimate.tick), u = machine.u.row(estimate.tick);
    state_t truth{};
    truth.session = 5;
    truth.tick = estimate.tick;
    truth.t = estimate.t;
    truth.f = 2;
    truth.q.assign(q.begin(), q.end());
    truth.u.assign(u.begin(), u.end());
    estimate_t sample = estimate_at(estimate.tick, 0.0, 0.0);
    sample.t = estimate.t;
    sample.q.assign(estimate.q.begin(), estimate.q.end());
    sample.u.assign(estimate.u.begin(), estimate.u.end());
    sample.bound = estimate.bound;
    watch.take(truth, {rows, 0});
    watch.take_settled(sample, {rows, 0});
    logger.add_truth(truth);
    row = logger.add_estimate(sample);
    ASSERT_NE(row, nullptr);
    ++rows;
    const Frame frame = watch.frame(rows);
    ASSERT_TRUE(frame.energy);
    EXPECT_EQ(frame.energy->V, row->energy[0]);
    EXPECT_EQ(frame.energy->k, row->k);
    EXPECT_EQ(frame.bound, estimate.bound);
  }
  EXPECT_EQ(rows, 2001);
  EXPECT_EQ(static_cast<float>(watch.curves(0, {0.0, 20.0, 5000}).energy.values[0].back()),
            static_cast<float>(row->energy[0]));
}

TEST(Watch, EventsOfMessagesAreTakenOnceAndSuspectsAreKept) {
  Watch watch(two_carriages());
  MessageBuilder builder(5, 1.0, 1);
  std::vector<ContactEvent> events;
  for (int i = 1; i <= 5; ++i) events.push_back({0.1 * i, 0, ContactEventKind::pulse});
  for (std::size_t i = 0; i < events.size(); ++i) {
    builder.add({&events[i], 1});
    const ContactMessage& message = builder.next(events[i].t, 0);
    watch.take(message, {static_cast<std::int64_t>(i), 0});
    watch.take(message, {static_cast<std::int64_t>(i), 0});  // duplicated
  }
  const Frame frame = watch.frame(9);
  EXPECT_EQ(frame.contacts[0].events, 5u);
  EXPECT_EQ(frame.contacts[0].last, 0.5);
  EXPECT_FALSE(frame.suspect);
  estimate_t sample = estimate_at(60, 0.1, 0.01);
  sample.inconsistencies = 1;
  sample.suspect_t = 0.4;
  sample.suspect_contact = 1;
  sample.suspicion = static_cast<std::int8_t>(Suspicion::spurious_event);
  watch.take_settled(sample, {10, 0});
  ASSERT_TRUE(watch.frame(11).suspect);
  EXPECT_EQ(watch.frame(11).suspect->t, 0.4);
  const Curves curves = watch.curves(0, {0.0, 1.0, 100});
  EXPECT_EQ(curves.closures[0].size(), 5u);
  ASSERT_EQ(curves.suspects.size(), 1u);
  EXPECT_EQ(curves.suspects[0].suspicion, Suspicion::spurious_event);
}

TEST(Watch, EventsOfMessagesHaveTheMachinesTime) {
  Stage stage(two_carriages(), Freshness::any);
  Reception reception(stage, {.offset = 3.0, .rate = 2.0});
  MessageBuilder builder(5, 2.0, 1);
  const ContactEvent event{4.0, 0, ContactEventKind::pulse};
  builder.add({&event, 1});
  std::vector<std::uint8_t> bytes;
  encode(builder.next(event.t, 0), bytes);
  reception.take(contacts_channel, bytes, {1, 0});
  const Frame frame = stage.watch.frame(2);
  EXPECT_EQ(frame.contacts[0].events, 1u);
  EXPECT_EQ(frame.contacts[0].last, 0.5);
}

TEST(DrawnMachine, BeamTouchesStopAtZeroGap) {
  for (const char* name : {"two_stops_beam", "steel_ruler"}) {
    const Scene scene = read_scene(std::string(SPRAG_SOURCE_DIR) + "/scenes/" + name + ".toml");
    const DrawnMachine machine(scene);
    ASSERT_TRUE(machine.is_beam());
    std::mt19937_64 generator(3);
    std::normal_distribution<double> value;
    const double t = 0.37;
    Eigen::VectorXd q(scene.model.coordinates());
    for (double& q_i : q) q_i = 0.1 * value(generator);
    const std::vector<double> shape = machine.shape(q, t);
    EXPECT_EQ(shape.size(), machine.places().size());
    EXPECT_NEAR(shape.front(), machine.base(t), 1e-12) << "clamped";
    for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
      const double x = scene.positions[i];
      const double height = mode_shapes(*scene.beam, x).dot(q) + machine.base(t);
      const double distance = (height - machine.stop(i, t)) * -machine.stops()[i].side;
      EXPECT_NEAR(distance, gap(scene.model.contacts[i], q, t), 1e-12) << name << ' ' << i;
    }
  }
}

// Two beam elements with deflections and rotations: nodes are the outputs and the other contact.
TEST(DrawnMachine, FiniteElementModelIsDrawnByItsNodes) {
  const std::string text = R"(
[system]
M = [[1, 0, 0, 0], [0, 0.1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0.1]]
C = [[0.1, 0, 0, 0], [0, 0.1, 0, 0], [0, 0, 0.1, 0], [0, 0, 0, 0.1]]
K = [[4, 0, -1, 0], [0, 2, 0, 0.5], [-1, 0, 3, 0], [0, 0.5, 0, 1]]
[impact]
restitution = 0.5
[[contact]]
direction = [0, 0, -2, 0]
clearance = 0.3
[[contact]]
direction = [0.5, 0.1, 0.5, -0.1]
clearance = 0.2
[[output]]
name = "middle"
direction = [1, 0, 0, 0]
[[output]]
name = "rate"
direction = [0, 0, 1, 0]
quantity = "velocity"
)";
  const std::string tip = "[[output]]\nname = \"tip\"\ndirection = [0, 0, 1, 0]\n";
  EXPECT_EQ(DrawnMachine(parse_scene(text, "a.toml")).kind(), DrawnMachine::Kind::chain)
      << "one displacement among its outputs";
  const Scene scene = parse_scene(text + tip, "a.toml");
  const DrawnMachine machine(scene);
  ASSERT_EQ(machine.kind(), DrawnMachine::Kind::nodes);
  EXPECT_EQ(machine.names(), (std::vector<std::string>{"middle", "tip", "contact 2"}));
  EXPECT_EQ(machine.places().size(), 3u);
  EXPECT_EQ(machine.stops()[0].side, 1) << "above the tip";
  const Eigen::Vector4d q(0.1, 7.0, 0.02, -5.0);
  const std::vector<double> shape = machine.shape(q, 0.0);
  EXPECT_NEAR(shape[0], 0.1, 1e-15);
  EXPECT_NEAR(shape[1], 0.02, 1e-15);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t at = static_cast<std::size_t>(machine.stops()[i].across) - 1;
    const double weight = i == 0 ? 2.0 : 1.0;
    EXPECT_NEAR(weight * (shape[at] - machine.stop(i, 0.0)) * -machine.stops()[i].side,
                gap(scene.model.contacts[i], q, 0.0), 1e-12)
        << i;
  }
}

// A model of `n` coordinates with stiffness `coupling` between neighbours, and one contact.
Scene coupled(Eigen::Index n, double coupling) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(n, n);
  model.C = Eigen::MatrixXd::Zero(n, n);
  model.K = 4.0 * Eigen::MatrixXd::Identity(n, n);
  model.K.diagonal(1).setConstant(coupling);
  model.K.diagonal(-1).setConstant(coupling);
  Contact contact;
  contact.w = Eigen::VectorXd::Unit(n, n - 2);
  contact.clearance = 0.1;
  model.contacts.push_back(contact);
  Scene scene;
  scene.model = model;
  return scene;
}

TEST(DrawnMachine, MetresAndRadiansShareNoAxis) {
  EXPECT_EQ(DrawnMachine(coupled(14, -1.0)).names().size(), 14u) << "masses and springs";
  const DrawnMachine elements(coupled(14, 1.0));
  EXPECT_EQ(elements.kind(), DrawnMachine::Kind::nodes);
  EXPECT_EQ(elements.names(), std::vector<std::string>{"contact 1"});
  Scene shaken = coupled(6, 1.0);
  EXPECT_EQ(DrawnMachine(shaken).names().size(), 6u);
  shaken.frame.emplace();
  shaken.frame->influence = Eigen::VectorXd::Zero(6);
  shaken.frame->influence[0] = shaken.frame->influence[2] = 1.0;  // the contact is at the fifth
  const DrawnMachine deflections(shaken);
  EXPECT_EQ(deflections.kind(), DrawnMachine::Kind::chain);
  EXPECT_EQ(deflections.names(), (std::vector<std::string>{"q1", "q3", "q5"}));
  EXPECT_EQ(deflections.stops()[0].across, deflections.places()[2]);
  const Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(6, 1.0, 6.0);
  EXPECT_EQ(deflections.shape(q, 0.0), (std::vector<double>{1.0, 3.0, 5.0}));
}

TEST(DrawnMachine, PeriodIsThatOfTheExcitationElseOfTheVibration) {
  Scene scene = two_carriages();
  EXPECT_NEAR(longest_period(scene.model).value(), 2.0 * std::numbers::pi / 2.7, 1e-12);
  scene.model.forces.clear();
  // omega^2 of K - omega^2 M: 2 x^2 - 19 x + 36 = 0.
  const double square = (19.0 - std::sqrt(19.0 * 19.0 - 4.0 * 2.0 * 36.0)) / 4.0;
  EXPECT_NEAR(longest_period(scene.model).value(), 2.0 * std::numbers::pi / std::sqrt(square),
              1e-9);
  scene.model.K.setZero();
  EXPECT_FALSE(longest_period(scene.model)) << "nothing vibrates";
}

TEST(Client, GetsNewestDataLimitedByAcknowledgement) {
  Watch watch(two_carriages());
  watch.take_settled(estimate_at(1, 0.1, 0.01), {1, 0});
  Client client;
  const auto next = [&](std::int64_t at) {
    return nlohmann::json::parse(client.next(watch, std::nullopt, at, at, false));
  };
  const nlohmann::json first = next(1);
  EXPECT_EQ(first["n"], 1);
  EXPECT_EQ(first["scene"]["name"], "two_carriages");
  EXPECT_EQ(first["frame"]["settled"]["q"][1], 0.1);
  EXPECT_EQ(first["frame"]["session"], "5");
  EXPECT_TRUE(first["frame"]["bound"].is_null()) << "infinite";
  EXPECT_TRUE(first.contains("curves"));
  EXPECT_TRUE(client.wants());
  EXPECT_FALSE(next(2).contains("scene"));
  next(3);
  EXPECT_FALSE(client.wants()) << "it has seen none of three";
  for (const char* nonsense :
       {"", "{", "[1]", "7", R"({"seen": "x"})", R"({"seen": -1})", R"({"seen": 1e99})",
        R"({"view": 3})", R"({"view": {"from": 2, "to": 1}})"}) {
    client.receive(nonsense);
  }
  EXPECT_FALSE(client.wants());
  client.receive(
      R"({"seen": 3, "view": {"from": 0.005, "to": 0.02, "pixels": 1e9, "quantity": "q2"}})");
  EXPECT_TRUE(client.wants());
  const nlohmann::json zoomed = next(4);
  EXPECT_EQ(zoomed["curves"]["from"], 0.005);
  EXPECT_EQ(zoomed["curves"]["quantity"], "q2");
  EXPECT_NEAR(zoomed["curves"]["estimate"]["mean"][0].get<double>(), 0.1, 1e-6);
  client.receive(R"({"view": {"window": 2}})");
  EXPECT_EQ(next(5)["curves"]["to"], 0.01 + 2.0) << "it fills from the left";
}

constexpr std::array<unsigned char, 3> page_bytes{'a', 'b', 'c'};
constexpr std::array<PageFile, 1> page_files_here{{{"/index.html", "text/html", page_bytes}}};

int status(const Request& request) {
  return judge(request, {"127.0.0.1", 8080}, page_files_here).status;
}

TEST(Rules, OnlyThePageIsServed) {
  EXPECT_EQ(status({"GET", "/", "127.0.0.1:8080", {}}), 200);
  EXPECT_EQ(status({"HEAD", "/index.html", "localhost:8080", {}}), 200);
  // A foreign name that resolves to this host, or a name with only the right beginning.
  for (const char* host :
       {"evil.example:8080", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8080.evil.example",
        "localhost", "localhost:80800", "127.0.0.1:8080 ", ""}) {
    EXPECT_EQ(status({"GET", "/", host, {}}), 403) << host;
  }
  EXPECT_EQ(status({"GET", "/", {}, {}}), 403) << "none, or more than one";
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "get"}) {
    EXPECT_EQ(status({method, "/", "127.0.0.1:8080", {}}), 405) << method;
  }
  for (const char* target :
       {"/x", "//", "/../etc/passwd", "/index.html?x", "http://127.0.0.1:8080/", ""}) {
    EXPECT_EQ(status({"GET", target, "127.0.0.1:8080", {}}), 404) << target;
  }
}

TEST(Rules, StreamRequiresPageOfSameHost) {
  EXPECT_EQ(status({"GET", "/stream", "127.0.0.1:8080", "http://127.0.0.1:8080", true}), 101);
  EXPECT_EQ(status({"GET", "/stream", "localhost:8080", "http://localhost:8080", true}), 101);
  EXPECT_EQ(status({"GET", "/stream", "127.0.0.1:8080", "http://127.0.0.1:8080"}), 426);
  for (const char* origin :
       {"http://evil.example", "http://127.0.0.1:8081", "https://127.0.0.1:8080", "null",
        "http://localhost:8080", "http://127.0.0.1:8080/"}) {
    EXPECT_EQ(status({"GET", "/stream", "127.0.0.1:8080", origin, true}), 403) << origin;
  }
  EXPECT_EQ(status({"GET", "/stream", "127.0.0.1:8080", {}, true}), 403) << "no browser is without";
  EXPECT_EQ(status({"POST", "/stream", "127.0.0.1:8080", "http://127.0.0.1:8080", true}), 405);
}

TEST(Rules, AddressesAreReadInCommonForms) {
  const auto read = [](const char* text) {
    const auto endpoint = endpoint_of(text);
    return endpoint ? text_of(*endpoint) : "none";
  };
  EXPECT_EQ(read("127.0.0.1:8080"), "127.0.0.1:8080");
  EXPECT_EQ(read("localhost:0"), "127.0.0.1:0");
  EXPECT_EQ(read("9000"), "127.0.0.1:9000");
  EXPECT_EQ(read(":9000"), "127.0.0.1:9000");
  EXPECT_EQ(read("[::1]:80"), "[::1]:80");
  for (const char* text :
       {"", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "::1:80", "x"}) {
    EXPECT_EQ(read(text), "none") << text;
  }
  EXPECT_TRUE(is_loopback({"127.0.0.1", 1}));
  EXPECT_FALSE(is_loopback({"0.0.0.0", 1}));
}

}  // namespace
}  // namespace sprag::view
