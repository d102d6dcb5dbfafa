#include "sprag/detail/identification/determination.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// Rise of S / sigma^2 at the ends of a 95 % interval: two-sided, one-sided.
constexpr double two_sided = 3.84, one_sided = 2.71;
constexpr double deviations = 1.96;  // half of that interval, for a normal distribution
// In coordinates: up to this deviation the curvature at the optimum describes the whole interval.
constexpr double nearly_linear = 0.01;
constexpr double largest_share = 0.5;  // of the range: largest deviation of a determined unknown
// A set of values is as good as the optimum up to this rise of S / sigma^2, plus a rise for each
// held value.
constexpr double as_good = 9.0, as_good_each = 4.0;

// The range of the search for an unknown, to either side.
double range_of(const Unknown& unknown) {
  switch (unknown.kind) {
    case Kind::phase:
    case Kind::clock_offset:
      return std::numbers::pi;
    case Kind::clearance:
      return 1.0;
    default:
      return std::max(-unknown.lowest(), unknown.highest());
  }
}

class Profile {
 public:
  Profile(const MachineFamily& family, const Stretches& stretches, const Likelihood& optimum,
          double sigma)
      : family_(family), stretches_(stretches), optimum_(optimum), sigma_(sigma) {}

  /// Distance from the optimum of unknown k to the end of its interval, up or down.
  double reach(std::size_t k, bool up, double rise);

  /// An optimum with a lower S that was found during the profile.
  const std::optional<Likelihood>& better() const { return better_; }

 private:
  struct Point {
    double distance = 0.0, rise = 0.0;
    Likelihood fit;
  };

  Point at(std::size_t k, double distance, const Likelihood& from);

  const MachineFamily& family_;
  const Stretches& stretches_;
  const Likelihood& optimum_;
  double sigma_;
  std::optional<Likelihood> better_;
};

// The best fit with unknown k held at a distance from the optimum. The other unknowns start at
// their conditional means by the optimum's covariance.
Profile::Point Profile::at(std::size_t k, double distance, const Likelihood& from) {
  check_interrupt();
  const std::vector<Unknown>& unknowns = family_.unknowns();
  const auto i = static_cast<Eigen::Index>(k);
  const double wanted = unknowns[k].coordinate(optimum_.values[i]) + distance;
  Likelihood start = from;
  const double move = wanted - unknowns[k].coordinate(from.values[i]);
  const double variance = optimum_.covariance(i, i);
  for (std::size_t j = 0; j < unknowns.size(); ++j) {
    const auto of = static_cast<Eigen::Index>(j);
    double by = j == k ? move : 0.0;
    if (j != k && variance > 0.0) by = move * optimum_.covariance(of, i) / variance;
    double coordinate = unknowns[j].coordinate(from.values[of]) + by;
    if (!unknowns[j].linear()) {
      coordinate = std::clamp(coordinate, unknowns[j].lowest(), unknowns[j].highest());
    }
    start.values[of] = unknowns[j].value(coordinate);
  }
  Point point{.distance = distance, .rise = infinity, .fit = {}};
  Likelihood fit = maximize_likelihood(family_, stretches_, std::move(start), std::span(&k, 1));
  if (!fit.values.allFinite() || !std::isfinite(fit.squares)) return point;
  // A path that has not converged violates its constraints, so its S is not comparable.
  if (!fit.converged && !(fit.violation < 0.1 * sigma_)) return point;
  point.rise = (fit.squares - optimum_.squares) / square(sigma_);
  constexpr double significant = 0.5;
  if (point.rise < -significant && fit.converged && (!better_ || fit.squares < better_->squares)) {
    better_ = fit;
  }
  point.fit = std::move(fit);
  return point;
}

double Profile::reach(std::size_t k, bool up, double rise) {
  const Unknown& unknown = family_.unknowns()[k];
  const auto i = static_cast<Eigen::Index>(k);
  const double at_optimum = unknown.coordinate(optimum_.values[i]);
  const double range = range_of(unknown);
  double farthest = range;
  if (!unknown.linear()) {
    farthest = up ? unknown.highest() - at_optimum : at_optimum - unknown.lowest();
  }
  if (!(farthest > 0.0)) return 0.0;
  const double side = up ? 1.0 : -1.0;
  const double linear = sigma_ * std::sqrt(rise * optimum_.covariance(i, i));
  Point inside{0.0, 0.0, optimum_};
  double step = std::min(linear > 0.0 ? linear : 0.1 * range, farthest);
  constexpr int most_points = 12;
  std::optional<Point> outside;
  for (int n = 0; n < most_points; ++n) {
    const double distance = inside.distance + step;
    Point point = at(k, side * distance, inside.fit);
    point.distance = distance;
    if (point.rise <= rise) {
      inside = std::move(point);
      if (inside.distance >= farthest) return farthest;
      step = outside ? 0.5 * (outside->distance - inside.distance)
                     : std::min(2.0 * step, farthest - inside.distance);
    } else {
      const bool is_rise = std::isfinite(point.rise);
      outside = std::move(point);
      if (is_rise && inside.distance > 0.0) break;
      if (is_rise && outside->rise < 3.0 * rise) break;
      step = 0.5 * (outside->distance - inside.distance);
    }
    if (step < 1e-2 * linear) break;
  }
  if (!outside || !std::isfinite(outside->rise))
    return outside ? outside->distance : inside.distance;
  // The root of the rise is nearly linear in the distance.
  const double a = std::sqrt(std::max(inside.rise, 0.0)), b = std::sqrt(outside->rise);
  const double share = (std::sqrt(rise) - a) / (b - a);
  return inside.distance + share * (outside->distance - inside.distance);
}

bool any(const std::vector<bool>& flags) {
  return std::find(flags.begin(), flags.end(), true) != flags.end();
}

std::vector<Determined> intervals_of(const MachineFamily& family, const Likelihood& optimum,
                                     double sigma, Profile& profile) {
  std::vector<Determined> all;
  const bool bounded = any(optimum.at_bound);
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const Unknown& unknown = family.unknowns()[k];
    const auto i = static_cast<Eigen::Index>(k);
    const double linear = sigma * std::sqrt(optimum.covariance(i, i));
    Determined of;
    of.sigma = linear;
    of.down = of.up = deviations * linear;
    of.at_physical_bound = optimum.at_bound[k] && unknown.is_physical_bound(optimum.values[i]);
    if (bounded || linear > nearly_linear) {
      const double rise = of.at_physical_bound ? one_sided : two_sided;
      of.up = profile.reach(k, true, rise);
      of.down = profile.reach(k, false, rise);
      of.sigma = std::max({linear, of.up / deviations, of.down / deviations});
    }
    of.determined = of.sigma < largest_share * range_of(unknown);
    all.push_back(of);
    if (profile.better()) break;
  }
  return all;
}

// Whether unknown k has a different value at another optimum.
bool differs(const Unknown& unknown, std::size_t k, const Likelihood& optimum,
             const std::vector<Eigen::VectorXd>& others, double sigma) {
  constexpr double in_deviations = 4.0, least = 1e-6;
  const auto i = static_cast<Eigen::Index>(k);
  return std::any_of(others.begin(), others.end(), [&](const Eigen::VectorXd& other) {
    double off = unknown.coordinate(other[i]) - unknown.coordinate(optimum.values[i]);
    if (unknown.kind == Kind::phase) off = std::remainder(off, 2.0 * std::numbers::pi);
    return std::abs(off) > in_deviations * sigma + least;
  });
}

}  // namespace

std::vector<std::size_t> undetermined_at(const MachineFamily& family, const Stretches& stretches,
                                         const Likelihood& at, double sigma) {
  constexpr double share = 0.1;  // share of the range
  const Likelihood linear = linearized_at(family, stretches, at);
  std::vector<std::size_t> undetermined;
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double deviation = sigma * std::sqrt(linear.covariance(i, i));
    if (!(deviation < share * range_of(family.unknowns()[k]))) undetermined.push_back(k);
  }
  return undetermined;
}

void include_held(const MachineFamily& family, const Stretches& stretches,
                  std::span<const std::size_t> held, double sigma, Determination& determination) {
  const Likelihood linear = linearized_at(family, stretches, determination.solution);
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    Determined& of = determination.unknowns[k];
    of.sigma = std::max(of.sigma, sigma * std::sqrt(linear.covariance(i, i)));
    of.up = std::max(of.up, deviations * of.sigma);
    of.down = std::max(of.down, deviations * of.sigma);
    const bool is_held = std::find(held.begin(), held.end(), k) != held.end();
    if (is_held || !(of.sigma < largest_share * range_of(family.unknowns()[k]))) {
      of.determined = false;
    }
  }
}

Determination determine(const MachineFamily& family, const Stretches& stretches,
                        const Likelihood& optimum, const std::vector<Eigen::VectorXd>& others,
                        double sigma) {
  constexpr int most_optima = 3;
  Determination result;
  result.solution = optimum;
  for (int n = 0; n < most_optima; ++n) {
    Profile profile(family, stretches, result.solution, sigma);
    result.unknowns = intervals_of(family, result.solution, sigma, profile);
    if (!profile.better()) break;
    Likelihood better = maximize_likelihood(family, stretches, Likelihood(*profile.better()));
    if (!better.converged || better.squares > profile.better()->squares) break;
    result.solution = std::move(better);
  }
  result.unknowns.resize(family.unknowns().size(), {.determined = false});
  std::vector<std::size_t> held;
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    Determined& of = result.unknowns[k];
    const bool at_end = result.solution.at_bound[k] && !of.at_physical_bound;
    if (at_end || differs(family.unknowns()[k], k, result.solution, others, of.sigma)) {
      of.determined = false;
    }
    if (!of.determined) held.push_back(k);
  }
  if (held.empty()) return result;
  Likelihood start = result.solution;
  for (const std::size_t k : held) {
    start.values[static_cast<Eigen::Index>(k)] = family.unknowns()[k].nominal;
  }
  const Likelihood nominal = maximize_likelihood(family, stretches, std::move(start), held);
  const double allowed = as_good + as_good_each * static_cast<double>(held.size());
  result.nominal_fits = nominal.converged && nominal.values.allFinite() &&
                        nominal.squares - result.solution.squares < allowed * square(sigma);
  if (!result.nominal_fits) {
    for (const std::size_t k : held) {
      const bool at_end = result.solution.at_bound[k] && !result.unknowns[k].at_physical_bound;
      if (at_end && result.at_end_of_range < 0) result.at_end_of_range = static_cast<int>(k);
    }
    return result;
  }
  // Holding some values moves the others; the move counts as uncertainty.
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const Unknown& unknown = family.unknowns()[k];
    const auto i = static_cast<Eigen::Index>(k);
    if (!result.unknowns[k].determined) continue;
    double move =
        unknown.coordinate(nominal.values[i]) - unknown.coordinate(result.solution.values[i]);
    if (unknown.kind == Kind::phase) move = std::remainder(move, 2.0 * std::numbers::pi);
    result.unknowns[k].sigma = std::hypot(result.unknowns[k].sigma, move);
    result.unknowns[k].down = std::max(result.unknowns[k].down + move, 0.0);
    result.unknowns[k].up = std::max(result.unknowns[k].up - move, 0.0);
  }
  result.solution = nominal;
  return result;
}

}  // namespace sprag
