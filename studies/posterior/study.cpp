#include "studies/posterior/study.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "command_line/in_parallel.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/master.h"
#include "sprag/mechanics/scalars.h"
#include "studies/calibration/study.h"
#include "studies/common/disturbance.h"
#include "studies/posterior/posterior.h"

namespace sprag::posterior {
namespace {

constexpr double away = 6.0;  // of sigma: before and behind it a report may be late
// And of events that are closer to each other the later ones are: reports keep their order.
constexpr double apart = 4.0;

// Where a window may begin: what the filter believes there, with so many events before.
struct Begin {
  double t;
  Eigen::VectorXd mean;
  Eigen::MatrixXd root;
  Eigen::VectorXd x;
  std::size_t events;
};

// What happened, and when that was reported.
struct Recording {
  std::span<const ContactEvent> events, reports;
  double jitter;
};

bool is_near_an_event(const Recording& of, double t) {
  return std::any_of(of.events.begin(), of.events.end(), [&](const ContactEvent& event) {
    return std::abs(event.t - t) < away * of.jitter;
  });
}

// The last window to `end`, before which `last` events were, with at least so many of them in it.
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

// R of P = S S^T = R^T R.
Eigen::MatrixXd upper_root(const Eigen::MatrixXd& S) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(S.transpose());
  return qr.matrixQR().topRows(S.rows()).triangularView<Eigen::Upper>();
}

std::uint64_t other_seed(int seed, Eigen::Index sample) {
  return 100000 * static_cast<std::uint64_t>(seed) + static_cast<std::uint64_t>(sample);
}

struct Sums {
  Comparison of;
  double logs = 0.0, squares = 0.0;
};

void follow(const Scene& told, const calibration::Truth& truth,
            std::span<const ContactEvent> reports, const Options& options, int seed, Sums& sums) {
  const Eigen::Index f = told.model.coordinates();
  const Flows flows(told.model);
  TimingFilter filter(told, truth.tick);
  TimingFilter::State state;
  filter.start(told.replica, 0, 0, state);
  const Eigen::Index samples = truth.q.cols();
  const Eigen::Index every = std::max<Eigen::Index>(samples / 2 / options.instants, 1);
  const auto impacts = static_cast<std::size_t>(options.window);
  Eigen::VectorXd x(2 * f), mean(2 * f), sigma(2 * f), sigma_g(told.model.contacts.size());
  Belief belief;
  const Recording recording{truth.events, reports, told.jitter};
  std::vector<Begin> begins;
  auto next = reports.begin();
  std::size_t happened = 0;
  ContactSet chi = 0;
  for (Eigen::Index sample = 0; sample < samples; ++sample) {
    for (std::int64_t k = sample * truth.stride + 1; k <= (sample + 1) * truth.stride; ++k) {
      const auto first = next;
      while (next != reports.end() && next->t <= tick_instant(k, truth.tick).hi) ++next;
      filter.tick({first, next}, state);
    }
    const double t = tick_instant((sample + 1) * truth.stride, truth.tick).hi;
    for (; happened < truth.events.size() && truth.events[happened].t <= t; ++happened) {
      chi = after(chi, truth.events[happened]);
    }
    if (is_near_an_event(recording, t)) continue;
    x << truth.q.col(sample), truth.u.col(sample);
    filter.output(state, mean.head(f), mean.tail(f));
    if (2 * sample >= samples && sample % every == 0) {
      const auto window = window_to(t, happened, impacts, begins, recording);
      std::optional<Moments> exact;
      if (window) {
        exact = moments(flows, *window, told.jitter, options.steps, other_seed(seed, sample));
      }
      sums.of.skipped += exact ? 0 : 1;
      if (exact) {
        ++sums.of.instants;
        filter.deviations(state, sigma.head(f), sigma.tail(f), sigma_g);
        for (Eigen::Index i = 0; i < 2 * f; ++i) {
          sums.of.filter.add(mean[i] - x[i], sigma[i]);
          sums.of.exact.add(exact->mean[i] - x[i], exact->deviation[i]);
          sums.logs += std::log(sigma[i] / exact->deviation[i]);
          sums.squares += square((mean[i] - exact->mean[i]) / exact->deviation[i]);
        }
      }
    }
    if (chi != 0 || !filter.belief(state, 0.0, belief)) continue;
    Eigen::MatrixXd S(2 * f, belief.columns);
    S << belief.S_q.leftCols(belief.columns), belief.S_u.leftCols(belief.columns);
    begins.push_back({t, mean, upper_root(S), x, happened});
  }
}

}  // namespace

Comparison compare(const Scene& scene, double jitter, const Options& options) {
  const calibration::Truth truth = calibration::simulate(scene, {});
  const auto contacts = static_cast<int>(scene.model.contacts.size());
  Scene told = scene;
  told.jitter = jitter;
  common::Disturbance disturbance;
  disturbance.jitter = jitter;
  Sums all;
  std::mutex mutex;
  in_parallel(options.threads, options.seeds, [&](int i) {
    const auto reports = common::disturb(truth.events, disturbance, contacts, infinity,
                                         static_cast<std::uint64_t>(i) + 1);
    Sums of_seed;
    follow(told, truth, reports, options, i + 1, of_seed);
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
