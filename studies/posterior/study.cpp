#include "studies/posterior/study.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "studies/calibration/study.h"
#include "studies/common/disturbance.h"
#include "studies/posterior/posterior.h"

namespace sprag::posterior {
namespace {

constexpr double away = 6.0;  // of sigma: reports may deviate this far from their events
// Of events closer than this many sigma the later reports are biased, because reports keep order.
constexpr double apart = 4.0;

// A possible begin of a window: the filter's belief there, and the number of events before.
struct Begin {
  double t;
  Eigen::VectorXd mean;
  Eigen::MatrixXd root;
  Eigen::VectorXd x;
  std::size_t events;
};

// True events and their reports.
struct Recording {
  std::span<const ContactEvent> events, reports;
  double jitter;
};

bool is_near_an_event(const Recording& of, double t) {
  return std::any_of(of.events.begin(), of.events.end(), [&](const ContactEvent& event) {
    return std::abs(event.t - t) < away * of.jitter;
  });
}

// The latest window that ends at `end`, after `last` events, and contains at least `impacts` of
// them.
std::optional<Window> window_to(double end, std::size_t last, std::size_t impacts,
                                const std::vector<Begin>& begins, const Recording& of) {
  const auto begin = std::find_if(begins.rbegin(), begins.rend(),
                                  [&](const Begin& one) { return one.events + impacts <= last; });
  if (begin == begins.rend()) return {};
  Window window{begin->t, end, begin->x, begin->mean, begin->root, {}, {}};
  for (std::size_t k = begin->events; k < last; ++k) {
    if (k > begin->events && of.events[k].t - of.events[k - 1].t < apart * of.jitter) return {};
    window.events.push_back(of.events[k]);
    window.reported.push_back(of.reports[k].t);
  }
  return window;
}

std::uint64_t seed_of_walk(int seed, Eigen::Index sample) {
  return 100000 * static_cast<std::uint64_t>(seed) + static_cast<std::uint64_t>(sample);
}

struct Sums {
  Comparison of;
  double logs = 0.0, squares = 0.0;
};

void follow(const Scene& given, const calibration::Truth& truth,
            std::span<const ContactEvent> reports, const Options& options, int seed, Sums& sums) {
  const Eigen::Index f = given.model.coordinates();
  const Flows flows(given.model);
  TrackingEstimator filter(given, truth.tick, EstimatorKind::timing);
  TrackingState state;
  filter.start(given.prior.start, 0, 0, state);
  const Eigen::Index samples = truth.q.cols();
  const Eigen::Index every = std::max<Eigen::Index>(samples / 2 / options.instants, 1);
  const auto impacts = static_cast<std::size_t>(options.window);
  Eigen::VectorXd x(2 * f), mean(2 * f), sigma(2 * f);
  Confidence confidence = filter.no_confidence();
  Belief belief;
  const Recording recording{truth.events, reports, given.prior.jitter};
  std::vector<Begin> begins;
  std::size_t happened = 0;
  ContactSet chi = 0;
  const auto compare_at = [&](Eigen::Index sample, double t) {
    const auto window = window_to(t, happened, impacts, begins, recording);
    std::optional<Moments> exact;
    if (window) {
      exact =
          moments(flows, *window, given.prior.jitter, options.steps, seed_of_walk(seed, sample));
    }
    if (!exact) {
      ++sums.of.skipped;
      return;
    }
    ++sums.of.instants;
    filter.confidence(state, confidence);
    sigma << confidence.sigma_q, confidence.sigma_u;
    for (Eigen::Index i = 0; i < 2 * f; ++i) {
      sums.of.filter.add(mean[i] - x[i], sigma[i]);
      sums.of.exact.add(exact->mean[i] - x[i], exact->deviation[i]);
      sums.logs += std::log(sigma[i] / exact->deviation[i]);
      sums.squares += square((mean[i] - exact->mean[i]) / exact->deviation[i]);
    }
  };
  const auto on_sample = [&](Eigen::Index sample) {
    const double t = tick_instant((sample + 1) * truth.stride, truth.tick).hi;
    for (; happened < truth.events.size() && truth.events[happened].t <= t; ++happened) {
      chi = after(chi, truth.events[happened]);
    }
    if (is_near_an_event(recording, t)) return;
    x << truth.q.col(sample), truth.u.col(sample);
    filter.output(state, mean.head(f), mean.tail(f));
    if (2 * sample >= samples && sample % every == 0) compare_at(sample, t);
    if (chi != 0 || state.track.status != TrackStatus::confirmed) return;
    filter.belief(state, belief);
    Eigen::MatrixXd S_transposed(belief.columns, 2 * f);
    S_transposed << belief.S_q.leftCols(belief.columns).transpose(),
        belief.S_u.leftCols(belief.columns).transpose();
    begins.push_back({t, mean, QR(S_transposed).R(), x, happened});
  };
  calibration::run(
      filter, state, reports, truth, [](std::int64_t) {}, on_sample);
}

}  // namespace

Comparison compare(const Scene& scene, double jitter, const Options& options) {
  const calibration::Truth truth = calibration::simulate(scene, {});
  const auto contacts = static_cast<int>(scene.model.contacts.size());
  Scene given = scene;
  given.prior.jitter = jitter;
  Disturbance disturbance;
  disturbance.jitter = jitter;
  Sums all;
  std::mutex mutex;
  in_parallel(options.threads, options.seeds, [&](int i) {
    const auto reports = common::disturb(truth.events, disturbance, contacts, infinity,
                                         static_cast<std::uint64_t>(i) + 1);
    Sums of_seed;
    follow(given, truth, reports, options, i + 1, of_seed);
    const std::lock_guard lock(mutex);
    all.of.instants += of_seed.of.instants;
    all.of.skipped += of_seed.of.skipped;
    all.of.filter.add(of_seed.of.filter);
    all.of.exact.add(of_seed.of.exact);
    all.logs += of_seed.logs;
    all.squares += of_seed.squares;
  });
  const double count = static_cast<double>(2 * scene.model.coordinates()) * all.of.instants;
  all.of.sigma_ratio = std::exp(all.logs / count);
  all.of.mean_off = std::sqrt(all.squares / count);
  return all.of;
}

}  // namespace sprag::posterior
