// The estimate, its sigma and the reported inconsistencies do not depend on the tick.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "sprag/scene_file.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

constexpr double fine = 1e-3;
constexpr std::int64_t fine_in_coarse = 100;

struct Estimate {
  Eigen::VectorXd q, u;
  Confidence confidence;
};

enum class Trouble { none, spurious, spurious_before, missing };

// The rounding error of a tick is 1e-9 of the motion. A reset filter starts at the replica, which
// contains this error. For a weakly observable machine, by chatter or by few events, the filter
// amplifies it to a share of its sigma.
struct Case {
  const char* name;
  const char* scene;
  double end;
  Trouble trouble;
  double share_after_restart = 0.0;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

const Scene& scene_of(const Case& c) {
  static const Scene coupled =
      read_scene(std::filesystem::path(SPRAG_SOURCE_DIR) / "tests/live/coupled_two_contacts.toml");
  return std::string(c.scene) == "coupled" ? coupled : cached_scene(c.scene);
}

/// At every `every`-th tick of h.
template <Estimator E>
std::vector<Estimate> estimates(const Scene& scene, std::vector<ContactEvent> events, double h,
                                std::int64_t every, double end) {
  const Eigen::Index f = scene.model.coordinates();
  E estimator(scene, h);
  typename E::State state;
  estimator.start(scene.prior.start, 0, 0, state);
  std::vector<Estimate> all;
  std::span<const ContactEvent> left = events;
  for (std::int64_t k = 1; k <= last_tick(end, h); ++k) {
    const auto later = std::find_if(left.begin(), left.end(), [&](const ContactEvent& event) {
      return tick_instant(k, h) - at(event.t) < 0.0;
    });
    const auto due = left.first(static_cast<std::size_t>(later - left.begin()));
    left = left.subspan(due.size());
    estimator.tick(due, state);
    if (k % every != 0) continue;
    Estimate& one = all.emplace_back();
    one.q.resize(f);
    one.u.resize(f);
    estimator.output(state, one.q, one.u);
    one.confidence = estimator.no_confidence();
    estimator.confidence(state, one.confidence);
  }
  return all;
}

double largest(const std::vector<Estimate>& all, Eigen::VectorXd Estimate::*x) {
  double size = 0.0;
  for (const Estimate& one : all) size = std::max(size, (one.*x).cwiseAbs().maxCoeff());
  return size;
}

/// Equal to within `limit` and a share of sigma, where finite.
void expect_near(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double limit,
                 const Eigen::VectorXd& of_sigma, const char* what, std::size_t i) {
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    ASSERT_EQ(std::isfinite(a[j]), std::isfinite(b[j])) << what << " at common tick " << i;
    if (std::isfinite(a[j])) {
      ASSERT_NEAR(a[j], b[j], limit + of_sigma[j]) << what << " at common tick " << i;
    }
  }
}

template <Estimator E>
void expect_equal(const Scene& scene, const std::vector<ContactEvent>& events, double end,
                  bool inconsistent, double share_after_restart = 0.0) {
  const auto a = estimates<E>(scene, events, fine, fine_in_coarse, end);
  const auto b = estimates<E>(scene, events, fine * fine_in_coarse, 1, end);
  ASSERT_EQ(a.size(), b.size());
  const double q = 1e-9 * largest(a, &Estimate::q);
  const double u = 1e-9 * largest(a, &Estimate::u);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Confidence& x = a[i].confidence;
    const Confidence& y = b[i].confidence;
    ASSERT_EQ(x.from_filter, y.from_filter) << i;
    ASSERT_EQ(x.inconsistencies, y.inconsistencies) << i;
    ASSERT_EQ(x.last.t, y.last.t) << i;
    ASSERT_EQ(x.last.contact, y.last.contact) << i;
    ASSERT_EQ(x.last.suspicion, y.last.suspicion) << i;
    const bool never_restarted = std::is_same_v<E, TimingEstimator> || x.inconsistencies == 0;
    if (never_restarted) {
      ASSERT_EQ(x.filter.t, y.filter.t) << i;
      ASSERT_EQ(x.filter.gap, y.filter.gap) << i;
      ASSERT_EQ(x.filter.deviation, y.filter.deviation) << i;
    }
    const double share = x.from_filter && !never_restarted ? share_after_restart : 0.0;
    const auto part = [share](const Eigen::VectorXd& sigma) -> Eigen::VectorXd {
      if (share == 0.0) return Eigen::VectorXd::Zero(sigma.size());
      return share * sigma;
    };
    const Eigen::VectorXd of_q = part(x.sigma_q);
    const Eigen::VectorXd of_u = part(x.sigma_u);
    const Eigen::VectorXd of_g = part(x.sigma_g);
    ASSERT_NO_FATAL_FAILURE(expect_near(a[i].q, b[i].q, q, of_q, "q", i));
    ASSERT_NO_FATAL_FAILURE(expect_near(a[i].u, b[i].u, u, of_u, "u", i));
    ASSERT_NO_FATAL_FAILURE(expect_near(x.sigma_q, y.sigma_q, q, of_q, "sigma_q", i));
    ASSERT_NO_FATAL_FAILURE(expect_near(x.sigma_u, y.sigma_u, u, of_u, "sigma_u", i));
    ASSERT_NO_FATAL_FAILURE(expect_near(x.sigma_g, y.sigma_g, q, of_g, "sigma_g", i));
  }
  EXPECT_EQ(a.back().confidence.inconsistencies > 0, inconsistent);
}

class TickIndependence : public testing::TestWithParam<std::tuple<Case, double>> {};

INSTANTIATE_TEST_SUITE_P(
    Machines, TickIndependence,
    testing::Combine(
        testing::Values(Case{"beam", "paper_beam.toml", 20.0, Trouble::none},
                        Case{"beam_spurious", "paper_beam.toml", 20.0, Trouble::spurious},
                        Case{"beam_spurious_before", "paper_beam.toml", 20.0,
                             Trouble::spurious_before},
                        Case{"beam_missing", "paper_beam.toml", 20.0, Trouble::missing},
                        Case{"chatter", "paper_beam_chatter.toml", 10.0, Trouble::none, 0.1},
                        Case{"coupled", "coupled", 20.0, Trouble::none, 0.1},
                        Case{"coupled_missing", "coupled", 20.0, Trouble::missing, 0.1}),
        testing::Values(0.0, 1e-3)),
    [](const auto& one) {
      return std::string(std::get<0>(one.param).name) +
             (std::get<1>(one.param) > 0.0 ? "_jitter" : "");
    });

std::vector<ContactEvent> events_of(const Case& c, const Scene& scene, double jitter) {
  std::vector<ContactEvent> events = master_events(scene, c.end);
  std::mt19937_64 engine(7);
  std::normal_distribution<double> normal;
  double last = 0.0;
  for (ContactEvent& event : events) {
    last = event.t = std::max(last, event.t + jitter * normal(engine));
  }
  // Late enough for the filter to have converged; before the longest pause, so that the event
  // matters.
  std::size_t chosen = events.size() / 3;
  for (std::size_t i = chosen; i + 1 < events.size(); ++i) {
    const double pause = events[i + 1].t - events[i].t;
    const double longest = events[chosen + 1].t - events[chosen].t;
    if (events[i].kind == ContactEventKind::pulse && pause > longest) chosen = i;
  }
  const auto at_chosen = events.begin() + static_cast<std::ptrdiff_t>(chosen);
  const double between = 0.5 * (at_chosen->t + (at_chosen + 1)->t);
  if (c.trouble == Trouble::missing) events.erase(at_chosen);
  if (c.trouble == Trouble::spurious) {
    events.insert(at_chosen + 1, {between, 0, ContactEventKind::pulse});
  }
  // 20 ms before a true event, both within a coarse tick.
  if (c.trouble == Trouble::spurious_before) {
    constexpr double before = 0.02;
    const double tick = fine_in_coarse * fine;
    const auto good = std::find_if(at_chosen + 1, events.end(), [&](const auto& event) {
      return std::floor((event.t - before) / tick) == std::floor(event.t / tick);
    });
    EXPECT_NE(good, events.end());
    events.insert(good, {good->t - before, 0, ContactEventKind::pulse});
  }
  return events;
}

TEST_P(TickIndependence, OfBoth) {
  const auto& [c, jitter] = GetParam();
  Scene scene = scene_of(c);
  scene.prior.jitter = jitter;
  expect_equal<BothEstimator>(scene, events_of(c, scene, jitter), c.end, c.trouble != Trouble::none,
                              c.share_after_restart);
}

// The filter alone detects only missing events.
TEST_P(TickIndependence, OfTheTimingFilter) {
  const auto& [c, jitter] = GetParam();
  Scene scene = scene_of(c);
  scene.prior.jitter = jitter;
  if (c.trouble == Trouble::spurious || c.trouble == Trouble::spurious_before) return;
  expect_equal<TimingEstimator>(scene, events_of(c, scene, jitter), c.end,
                                c.trouble == Trouble::missing);
}

}  // namespace
}  // namespace sprag
