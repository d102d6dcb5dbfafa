#include "sprag/detail/tolerance/deviations.h"

#include <cmath>

#include "sprag/detail/identification/machine_family.h"

namespace sprag::tolerance {
namespace {

using Kind = Deviation::Kind;

constexpr double decades = 1e6;           // ratio of the largest amount of a time to the least
constexpr double decades_of_share = 1e5;  // the same for a parameter
// A frequency error grows to a phase error with time.
constexpr double decades_of_frequency = 1e9;

Deviation of_parameter(const Unknown& unknown) {
  Deviation deviation{Kind::parameter, unknown.key, unknown.unit, false, 0.0, 0.0, unknown};
  deviation.share = unknown.logarithmic;
  if (deviation.share) deviation.unit.clear();
  deviation.most = deviation.share ? 0.5 : unknown.unit_step;
  const bool frequency = unknown.kind == Unknown::Kind::frequency;
  deviation.least = deviation.most / (frequency ? decades_of_frequency : decades_of_share);
  return deviation;
}

}  // namespace

std::vector<Deviation> deviations_of(const Scene& scene, double closings_per_time) {
  const double interval = 1.0 / closings_per_time;
  std::vector<Deviation> all = {{Kind::jitter, "jitter", "s", false, interval / decades, interval},
                                {Kind::offset, "offset", "s", false, interval / decades, interval},
                                {Kind::lost, "lost", "", true, 1e-4, 0.5},
                                {Kind::spurious, "spurious", "1/s", false, 1e-4 * closings_per_time,
                                 3.0 * closings_per_time}};
  for (const Unknown& unknown : unknowns_of(scene)) all.push_back(of_parameter(unknown));
  return all;
}

std::vector<double> amounts(const Deviation& of, bool coarse) {
  std::vector<double> values;
  const auto last = static_cast<int>(std::floor(std::log10(of.most)));
  for (auto n = static_cast<int>(std::floor(std::log10(of.least))); n <= last; ++n) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      // For n < 0 a quotient, which gives 1e-3 and not 1.0000000000000000208e-3.
      const double ten = std::pow(10.0, std::abs(n));
      const double value = n < 0 ? digit / ten : digit * ten;
      const bool within = value >= of.least && value <= of.most;
      if (within && (!coarse || digit == 1.0)) values.push_back(value);
    }
  }
  return values;
}

Scene with_wrong_parameter(const Scene& scene, const Deviation& of, double amount, bool other_way) {
  const Unknown& unknown = of.unknown;
  const auto off = [&](double signed_amount) {
    return of.share ? unknown.nominal * (1.0 + signed_amount) : unknown.nominal + signed_amount;
  };
  const bool never_negative =
      unknown.kind == Unknown::Kind::restitution || unknown.kind == Unknown::Kind::damping;
  const auto possible = [&](double value) {
    return !(unknown.upper_limit > 0.0 && value > unknown.upper_limit) &&
           !(never_negative && value < 0.0);
  };
  double value = off(other_way ? -amount : amount);
  if (!possible(value)) value = off(other_way ? amount : -amount);
  if (!possible(value)) throw ModelError(of.name + " cannot be off by so much");
  return MachineFamily(scene, {unknown}).with(Eigen::VectorXd::Constant(1, value));
}

}  // namespace sprag::tolerance
