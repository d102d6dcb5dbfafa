#include "observer/master_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"

namespace sprag {
namespace {

constexpr std::int64_t millisecond = 1'000'000;
constexpr std::int64_t second = 1000 * millisecond;
constexpr std::int64_t boot = 987'654'321 * second / 1000;  // local times do not start at zero
constexpr double rounding = 1e-8;

/// Wall clocks are constant, so that only arrival times contain information.
Arrival received_at(std::int64_t local) { return {local, 1'000'000'000'000'000}; }

ContactMessage report_at(double horizon, double speed) {
  ContactMessage report;
  report.horizon = horizon;
  report.speed = speed;
  return report;
}

/// A paced master with a message every 10 ms of local time, and delays of its messages.
struct Network {
  double speed;
  double offset = 0.0;  // simulated time at `boot`

  double truth(std::int64_t local) const {
    return offset + speed * 1e-9 * static_cast<double>(local - boot);
  }
};

struct Transmission {
  std::int64_t sent, at;
};

std::vector<Transmission> arrivals(Random& random, std::int64_t from, std::int64_t to,
                                   std::int64_t smallest, std::int64_t largest) {
  std::vector<Transmission> list;
  for (std::int64_t sent = from; sent < to; sent += 10 * millisecond) {
    const double u = random.uniform(0.0, 1.0);
    const auto extra = static_cast<std::int64_t>(u * u * static_cast<double>(largest - smallest));
    list.push_back({sent, sent + smallest + extra});
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const Transmission& a, const Transmission& b) { return a.at < b.at; });
  return list;
}

TEST(MasterClock, IsBehindByAtMostTheSmallestDelay) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Network network{random.log_uniform(0.01, 100.0), random.uniform(0.0, 1000.0)};
    MasterClock clock;
    EXPECT_FALSE(clock.running());
    std::vector<Transmission> received;
    for (const Transmission& arrival :
         arrivals(random, boot, boot + 12 * second, millisecond / 5, 400 * millisecond)) {
      clock.observe(report_at(network.truth(arrival.sent), network.speed), received_at(arrival.at));
      received.push_back(arrival);
      const std::int64_t now = arrival.at + random.integer(0, 5'000'000);
      const double lag = network.truth(now) - clock.simulated(now);
      const double limit = rounding * std::max(1.0, network.speed);
      EXPECT_GE(lag, -limit);
      // The error is at most the least delay of the last 2 s.
      std::int64_t least = std::numeric_limits<std::int64_t>::max();
      for (const Transmission& past : received) {
        if (past.at >= arrival.at - 2 * second) least = std::min(least, past.at - past.sent);
      }
      EXPECT_LE(lag, network.speed * 1e-9 * static_cast<double>(least) + limit);
    }
    EXPECT_TRUE(clock.running());
    EXPECT_EQ(clock.speed(), network.speed);
  }
}

TEST(MasterClock, SilenceDoesNotChangeTheClock) {
  Random random(2);
  const Network network{1.0};
  MasterClock clock;
  for (const std::int64_t from : {boot, boot + 30 * second}) {
    for (const Transmission& arrival :
         arrivals(random, from, from + 3 * second, millisecond, 50 * millisecond)) {
      clock.observe(report_at(network.truth(arrival.sent), 1.0), received_at(arrival.at));
      EXPECT_LE(clock.simulated(arrival.at), network.truth(arrival.at) + rounding);
    }
  }
  const std::int64_t now = boot + 34 * second;
  EXPECT_NEAR(clock.simulated(now), network.truth(now), 2e-3);
}

// The machine's clock is set back by 3 s, or by less than the tracker's limit of a jump; messages
// still arrive late and out of order.
TEST(MasterClock, FollowsBackwardClockStepAtOnce) {
  for (const double step : {-3.0, -0.3, -0.05}) {
    SCOPED_TRACE(step);
    Random random(7);
    Network network{2.0, 100.0};
    MasterClock clock;
    const std::int64_t stepped = boot + 5 * second;
    std::int64_t number = 0;
    std::vector<std::pair<Transmission, ContactMessage>> sent;
    for (std::int64_t at = boot; at < stepped + 4 * second; at += 10 * millisecond) {
      if (at == stepped) network.offset += step * network.speed;
      ContactMessage report = report_at(network.truth(at), network.speed);
      report.sequence = ++number;
      sent.push_back({{at, at + random.integer(1'000'000, 30'000'000)}, report});
    }
    std::stable_sort(sent.begin(), sent.end(),
                     [](const auto& a, const auto& b) { return a.first.at < b.first.at; });
    for (const auto& [way, report] : sent) {
      clock.observe(report, received_at(way.at));
      if (way.at < stepped + 200 * millisecond) continue;
      const double lag = network.truth(way.at) - clock.simulated(way.at);
      EXPECT_GE(lag, -rounding);
      EXPECT_LE(lag, network.speed * 35e-3);
    }
  }
}

TEST(MasterClock, RecoversAfterPauseOfMaster) {
  Random random(3);
  Network network{2.0};
  MasterClock clock;
  for (const Transmission& arrival :
       arrivals(random, boot, boot + 5 * second, millisecond, 20 * millisecond)) {
    clock.observe(report_at(network.truth(arrival.sent), 2.0), received_at(arrival.at));
  }
  // The master stops for 7 s of local time and does not catch up.
  network.offset -= 2.0 * 7.0;
  const std::int64_t resumed = boot + 12 * second;
  for (const Transmission& arrival :
       arrivals(random, resumed, resumed + 8 * second, millisecond, 20 * millisecond)) {
    clock.observe(report_at(network.truth(arrival.sent), 2.0), received_at(arrival.at));
    if (arrival.at < resumed + 5 * second) continue;
    const double lag = network.truth(arrival.at) - clock.simulated(arrival.at);
    EXPECT_GE(lag, -rounding);
    EXPECT_LE(lag, 2.0 * 3e-3);
  }
}

TEST(MasterClock, FollowsMasterSlowerThanItsSpeed) {
  MasterClock clock;
  // The master claims 1 simulated s per s and runs at 0.9.
  double worst = 0.0;
  for (std::int64_t local = 0; local < 20 * second; local += 10 * millisecond) {
    const double truth = 0.9e-9 * static_cast<double>(local);
    clock.observe(report_at(truth, 1.0), received_at(boot + local));
    worst = std::max(worst, clock.simulated(boot + local) - truth);
  }
  EXPECT_LE(worst, 0.1 * 4.1);  // remembered messages are 4 s old at most
}

TEST(MasterClock, TimeOfUnpacedMasterIsItsLastHorizon) {
  MasterClock clock;
  clock.observe(report_at(3.0, infinity), received_at(boot));
  EXPECT_EQ(clock.simulated(boot + second), 3.0);
  clock.observe(report_at(8.0, infinity), received_at(boot + millisecond));
  clock.observe(report_at(5.0, infinity), received_at(boot + 2 * millisecond));
  EXPECT_EQ(clock.simulated(boot), 8.0);
  EXPECT_TRUE(std::isinf(clock.speed()));
}

TEST(MasterClock, LocalTimeIsFirstInstantOfSimulatedTime) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double speed = random.log_uniform(0.01, 100.0);
    MasterClock clock;
    for (int i = 0; i < 5; ++i) {
      clock.observe(report_at(random.uniform(0.0, 10.0), speed),
                    received_at(boot + i * millisecond));
    }
    for (int i = 0; i < 20; ++i) {
      const double t = random.uniform(0.0, 20.0);
      const std::int64_t local = clock.local(t);
      const double nanosecond = speed * 1e-9;
      EXPECT_GE(clock.simulated(local), t - 1e-3 * nanosecond - 1e-13);
      EXPECT_LT(clock.simulated(local - 1), t + 1e-3 * nanosecond + 1e-13);
    }
    for (int i = 0; i < 20; ++i) {
      const std::int64_t local = boot + random.integer(0, 1'000'000'000);
      EXPECT_NEAR(static_cast<double>(clock.local(clock.simulated(local)) - local), 0.0, 2.0);
    }
  }
}

struct Clocks {
  const char* what;
  std::int64_t offset;  // of the master's wall clock [ns]
  double ahead;         // how far "now" may be ahead of the master [s]
  double lag;           // how far it may be behind [s]
};

// The master's wall clock has a constant error; delays are 20 to 200 ms.
TEST(MasterClock, ErrorIsClockOffsetOrAtMostSmallestDelay) {
  for (const Clocks& clocks :
       {Clocks{"agree", 0, 0.0, 0.0}, Clocks{"2 ms behind", -2 * millisecond, 0.002, -0.002},
        Clocks{"5 ms ahead", 5 * millisecond, 0.0, 0.005},
        Clocks{"100 ms ahead", 100 * millisecond, 0.0, 0.1},
        Clocks{"an hour ahead", 3600 * second, 0.0, 0.04},
        Clocks{"an hour behind", -3600 * second, 0.0, 0.04}}) {
    SCOPED_TRACE(clocks.what);
    Random random(11);
    const Network network{3.0};
    MasterClock clock;
    for (const Transmission& message :
         arrivals(random, boot, boot + 6 * second, 20 * millisecond, 200 * millisecond)) {
      ContactMessage report = report_at(network.truth(message.sent), 3.0);
      const std::int64_t wall = 1'700'000'000 * second;
      report.utime = (wall + message.sent + clocks.offset) / 1000;
      clock.observe(report, {message.at, (wall + message.at) / 1000});
      if (message.at < boot + second) continue;
      const double ahead = clock.simulated(message.at) - network.truth(message.at);
      constexpr double microseconds = 2e-6;
      EXPECT_LE(ahead, 3.0 * (clocks.ahead + microseconds));
      EXPECT_GE(ahead, -3.0 * (clocks.lag + microseconds));
    }
  }
}

TEST(MasterClock, TimesBeyondClockRangeAreSaturated) {
  MasterClock clock;
  clock.observe(report_at(0.0, 1e-300), received_at(boot));
  EXPECT_GT(clock.local(1e300), boot);
  EXPECT_LT(clock.local(-1e300), boot);
}

TEST(MasterClock, RestartDiscardsOldMaster) {
  MasterClock clock;
  clock.observe(report_at(1000.0, 1.0), received_at(boot));
  clock.restart();
  EXPECT_FALSE(clock.running());
  clock.observe(report_at(0.5, 1.0), received_at(boot + second));
  EXPECT_EQ(clock.simulated(boot + second), 0.5);
}

}  // namespace
}  // namespace sprag
