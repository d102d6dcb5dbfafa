// Common parts of the studies: disturbed events.
#include <gtest/gtest.h>

#include <cmath>

#include "sprag/detail/mechanics/scalars.h"
#include "studies/common/disturbance.h"
#include "tests/support/random.h"

namespace sprag::common {
namespace {

using Events = std::vector<ContactEvent>;

// Two contacts that pulse, close and open, about three events per unit of time.
Events random_events(std::uint64_t seed, double end) {
  sprag::Random random(seed);
  Events events;
  ContactSet chi = 0;
  for (double t = random.uniform(0.0, 0.7); t < end; t += random.uniform(0.0, 0.7)) {
    const int contact = random.integer(0, 1);
    ContactEventKind kind = random.chance(0.7) ? ContactEventKind::pulse : ContactEventKind::closes;
    if (contains(chi, contact)) kind = ContactEventKind::opens;
    events.push_back({t, contact, kind});
    chi = after(chi, events.back());
  }
  return events;
}

bool consistent(const Events& events) {
  Events kept = events;
  drop_contradicting(kept);
  return kept == events;
}

TEST(DisturbedEvents, AreUnchangedWithoutDisturbance) {
  const Events events = random_events(1, 50.0);
  EXPECT_EQ(disturb(events, {}, 2, 50.0, 1), events);
}

TEST(DisturbedEvents, AreOrderedAndConsistent) {
  constexpr double end = 50.0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Events events = random_events(seed, end);
    const double sign = seed % 2 == 0 ? 1.0 : -1.0;
    const Events arrived = disturb(events, {0.5, 0.2 * sign, 0.1, 0.5}, 2, end, seed);
    EXPECT_NE(arrived, events);
    EXPECT_TRUE(consistent(arrived)) << "seed " << seed;
    double last = 0.0;
    for (const ContactEvent& event : arrived) {
      EXPECT_GE(event.t, last) << "seed " << seed;
      EXPECT_LE(event.t, end) << "seed " << seed;
      last = event.t;
    }
  }
}

TEST(DisturbedEvents, AreDroppedIfContradictory) {
  using enum ContactEventKind;
  Events events{{0.1, 0, opens},  {0.2, 0, closes}, {0.3, 0, pulse}, {0.3, 1, pulse},
                {0.4, 0, closes}, {0.5, 0, opens},  {0.6, 0, opens}};
  drop_contradicting(events);
  EXPECT_EQ(events, (Events{{0.2, 0, closes}, {0.3, 1, pulse}, {0.5, 0, opens}}));
}

TEST(DisturbedEvents, HaveGivenSharesAndRates) {
  constexpr double end = 20000.0;
  Events events;
  for (double t = 0.5; t < end; t += 1.0) events.push_back({t, 0, ContactEventKind::pulse});
  const auto n = static_cast<double>(events.size());
  const Events less = disturb(events, {0.0, 0.0, 0.3, 0.0}, 1, end, 1);
  EXPECT_NEAR(static_cast<double>(less.size()) / n, 0.7, 5.0 * std::sqrt(0.21 / n));
  const Events more = disturb(events, {0.0, 0.0, 0.0, 0.3}, 1, end, 1);
  EXPECT_NEAR(static_cast<double>(more.size()) / n, 1.3, 5.0 * std::sqrt(0.3 / n));
  const Events moved = disturb(events, {1e-3, 1e-2, 0.0, 0.0}, 1, end, 1);
  double mean = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double off = moved[i].t - events[i].t - 1e-2;
    mean += off / n;
    square += off * off / n;
  }
  EXPECT_NEAR(mean, 0.0, 5e-3 / std::sqrt(n));
  EXPECT_NEAR(square, 1e-6, 5e-6 * std::sqrt(2.0 / n));
}

}  // namespace
}  // namespace sprag::common
