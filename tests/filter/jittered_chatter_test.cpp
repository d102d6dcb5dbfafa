// Machines with several contacts whose chatter ends within the jitter of the event times: the
// claimed sigma of the state holds. Drawn as in studies/machines.py.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/master.h"
#include "sprag/scene_file.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

// Each event has a normal error; each contact's events keep their order.
std::vector<ContactEvent> jittered(std::vector<ContactEvent> events, const Scene& scene,
                                   std::mt19937_64& engine) {
  std::normal_distribution<double> normal;
  for (int i = 0; i < static_cast<int>(scene.model.contacts.size()); ++i) {
    std::vector<double> times;
    for (const ContactEvent& event : events) {
      if (event.contact != i) continue;
      times.push_back(std::max(event.t + scene.prior.jitter * normal(engine), 0.0));
    }
    std::ranges::sort(times);
    std::size_t next = 0;
    for (ContactEvent& event : events) {
      if (event.contact == i) event.t = times[next++];
    }
  }
  std::ranges::stable_sort(events, {}, &ContactEvent::t);
  return events;
}

class JitteredChatter : public testing::TestWithParam<const char*> {};

TEST_P(JitteredChatter, IsNotOverconfident) {
  const Scene scene = read_scene(std::filesystem::path(SPRAG_SOURCE_DIR) / "tests/filter/machines" /
                                 (std::string(GetParam()) + ".toml"));
  const Eigen::Index f = scene.model.coordinates();
  constexpr double h = 0.05;
  constexpr std::int64_t ticks = 5000;
  std::vector<ContactEvent> exact;
  std::vector<Eigen::VectorXd> q_m(ticks + 1, Eigen::VectorXd(f)), u_m = q_m;
  Master master(scene.model, scene.truth.start);
  for (std::int64_t k = 1; k <= ticks; ++k) {
    master.advance(tick_instant(k, h), exact);
    master.state(tick_instant(k, h), q_m[static_cast<std::size_t>(k)],
                 u_m[static_cast<std::size_t>(k)]);
  }
  std::int64_t claims = 0, wrong = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::mt19937_64 engine(seed);
    const std::vector<ContactEvent> events = jittered(exact, scene, engine);
    BothEstimator both(scene, h);
    TrackingState state;
    both.start(scene.prior.start, 0, 0, state);
    Confidence confidence = both.no_confidence();
    Eigen::VectorXd q(f), u(f);
    std::size_t next = 0;
    for (std::int64_t k = 1; k <= ticks; ++k) {
      const std::size_t first = next;
      while (next < events.size() && events[next].t <= tick_instant(k, h).hi) ++next;
      both.tick(std::span(events).subspan(first, next - first), state);
      both.output(state, q, u);
      both.confidence(state, confidence);
      for (Eigen::Index i = 0; i < f; ++i) {
        if (!std::isfinite(confidence.sigma_q[i])) continue;
        const auto now = static_cast<std::size_t>(k);
        claims += 2;
        if (std::abs(q[i] - q_m[now][i]) > 5.0 * confidence.sigma_q[i]) ++wrong;
        if (std::abs(u[i] - u_m[now][i]) > 5.0 * confidence.sigma_u[i]) ++wrong;
      }
    }
  }
  std::cout << GetParam() << ", seeds 1 to 3: " << wrong << " of " << claims
            << " values beyond 5 sigma\n";
  EXPECT_GT(claims, 3 * ticks * f);  // claims at half of them at least
  EXPECT_LT(static_cast<double>(wrong), 0.01 * static_cast<double>(claims));
}

INSTANTIATE_TEST_SUITE_P(Drawn, JitteredChatter, testing::Values("r090", "r095"),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace
}  // namespace sprag
