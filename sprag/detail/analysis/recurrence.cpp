#include "sprag/detail/analysis/recurrence.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "sprag/contact_event.h"
#include "sprag/detail/analysis/lyapunov.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// A motion smaller than this fraction of its start counts as rest.
constexpr double at_rest = 1e-6;
// Entries of points of a cycle are equal within this multiple of the distance of repeating points.
constexpr double equal_in_cycle = 4.0;

void check_settings(const RecurrenceSettings& settings) {
  const auto check = [](bool right, const std::string& name, const std::string& allowed) {
    if (!right) throw std::invalid_argument(name + " must be " + allowed);
  };
  check(settings.period >= 0.0 && std::isfinite(settings.period), "period", ">= 0");
  check(settings.transient >= 0, "transient", ">= 0");
  check(settings.periods >= 1, "periods", ">= 1");
  check(settings.longest >= 1, "longest", ">= 1");
  check(settings.tolerance > 0.0, "tolerance", "> 0");
}

// The lexicographically first point of one cycle; entries closer than the tolerance are equal.
Eigen::VectorXd first_of_cycle(const Eigen::Ref<const Simulation::Rows>& cycle,
                               const Eigen::VectorXd& tolerance) {
  Eigen::Index first = 0;
  for (Eigen::Index k = 1; k < cycle.rows(); ++k) {
    for (Eigen::Index j = 0; j < cycle.cols(); ++j) {
      const double difference = cycle(k, j) - cycle(first, j);
      if (std::abs(difference) <= tolerance[j]) continue;
      if (difference < 0.0) first = k;
      break;
    }
  }
  return cycle.row(first).transpose();
}

double largest_norm(const Eigen::Ref<const Simulation::Rows>& points,
                    const Eigen::Ref<const Eigen::VectorXd>& weights) {
  double largest = 0.0;
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    largest = std::max(largest, std::sqrt(points.row(k).cwiseAbs2().dot(weights)));
  }
  return largest;
}

}  // namespace

double excitation_period(const Dynamics& dynamics) {
  const Eigen::VectorXd& Omega = dynamics.frequencies();
  if (!dynamics.inputs().empty()) {
    throw std::invalid_argument(
        "a recorded input drives the machine: the period of the stroboscope must be given");
  }
  if (Omega.size() == 1) return 2.0 * std::numbers::pi / Omega[0];
  throw std::invalid_argument(
      Omega.size() == 0
          ? "nothing drives the machine periodically: the period of the stroboscope must be given"
          : "the machine is driven with " + std::to_string(Omega.size()) +
                " frequencies: the period of the stroboscope must be given");
}

Recurrence recurrence(const Model& model, const State& start, const RecurrenceSettings& settings) {
  check_settings(settings);
  const Flows flows(model);
  const Dynamics& dynamics = flows.dynamics();
  const double T = settings.period > 0.0 ? settings.period : excitation_period(dynamics);
  const double Omega = 2.0 * std::numbers::pi / T;
  const Eigen::Index f = dynamics.coordinates();
  const long n = settings.periods;

  Recurrence found;
  found.period = T;
  found.points.resize(n, 2 * f);
  Master master(flows, start, 0.0, 0);
  std::vector<ContactEvent> events;
  const auto advance = [&](long k) {
    events.clear();
    master.advance(stroboscope_instant(k, T), events);
  };
  for (long k = 0; k <= settings.transient; ++k) advance(k);
  Eigen::VectorXd q(f), u(f);
  long closings = 0;
  for (long k = 0; k < n; ++k) {
    const Instant t = tick_instant(settings.transient + k, T);
    const Instant last = master.motion().t;
    master.state(last - t > 0.0 ? last : t, q, u);
    found.points.row(k) << q.transpose(), u.transpose();
    advance(settings.transient + k + 1);
    closings += std::count_if(events.begin(), events.end(), [](const ContactEvent& event) {
      return event.kind != ContactEventKind::opens;
    });
  }
  found.impacts_per_period = static_cast<double>(closings) / static_cast<double>(n);

  Eigen::VectorXd weights(2 * f);
  weights.tail(f) = dynamics.model().M.diagonal();
  weights.head(f) = square(Omega) * weights.tail(f);
  // The start provides a scale for a motion that comes to rest at zero.
  const double largest = std::max(largest_norm(found.points.bottomRows(n - n / 2), weights),
                                  at_rest * std::sqrt(start.q.cwiseAbs2().dot(weights.head(f)) +
                                                      start.u.cwiseAbs2().dot(weights.tail(f))));
  const double close = settings.tolerance * largest;
  const int p = period_of_points(found.points, weights, settings.longest, close);
  found.attractor_period = p;
  found.attractor.setConstant(2 * f, std::numeric_limits<double>::quiet_NaN());
  if (p > 0) {
    found.attractor = first_of_cycle(found.points.bottomRows(p),
                                     equal_in_cycle * close * weights.cwiseSqrt().cwiseInverse());
  }
  if (settings.lyapunov) {
    const long now = settings.transient + n;
    found.lyapunov =
        p > 0 ? std::log(spectral_radius(monodromy(master, T, now, now + p, events))) / (p * T)
              : largest_exponent(master, T, now, now + n, events);
  }
  return found;
}

int period_of_points(const Eigen::Ref<const Simulation::Rows>& points,
                     const Eigen::Ref<const Eigen::VectorXd>& weights, int longest, double close) {
  const Eigen::Index n = points.rows();
  const Eigen::Index from = n / 2;
  for (Eigen::Index p = 1; p <= std::min<Eigen::Index>(longest, n / 4); ++p) {
    bool repeats = true;
    for (Eigen::Index k = from; repeats && k + p < n; ++k) {
      const auto difference = points.row(k + p) - points.row(k);
      repeats = std::sqrt(difference.cwiseAbs2().dot(weights)) <= close;
    }
    if (repeats) return static_cast<int>(p);
  }
  return 0;
}

}  // namespace sprag
