#include "sprag/detail/bound/signal_range.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Bounds over all times on the derivatives 0 to 3 of one drive's force.
std::array<double, 4> drive_amplitudes(const Drive& drive, const Motion& motion) {
  const Oscillators& o = motion.flow->oscillators();
  const double Omega = o.root_kappa()[drive.source];
  const double z = motion.x.z[drive.source];
  const double v = motion.x.v[drive.source];
  const double amplitude = Omega > 0.0 ? std::hypot(z, v / Omega) : std::abs(z);
  double force = (std::abs(drive.cos) + std::abs(drive.sin) * Omega) * amplitude;
  std::array<double, 4> all{};
  for (double& one : all) {
    one = force;
    force *= Omega;
  }
  return all;
}

// Contribution of one oscillator to the bounds of |phi''| and |phi'''| over the window.
struct Added {
  double second = 0.0, third = 0.0;
};

struct OscillatorForces {
  double value = 0.0, rate = 0.0, second = 0.0;  // at the motion's time
  std::array<double, 4> largest{};
};

Added added_by(Eigen::Index i, const Signal& signal, const Motion& motion,
               const OscillatorForces& F, double window) {
  const Oscillators& o = motion.flow->oscillators();
  const double damping = 2.0 * o.delta()[i];
  const double kappa = o.kappa()[i];
  const double root = o.root_kappa()[i];
  const double d1 = motion.x.v[i];
  const double d2 = motion.alpha[i] + F.value - damping * d1 - kappa * motion.x.z[i];
  const double d3 = F.rate - damping * d2 - kappa * d1;
  const double d4 = F.second - damping * d3 - kappa * d2;
  const double growth = std::exp(damping * window);
  const double E2 = growth * (std::hypot(d2, root * d1) + window * F.largest[1]);
  const double E3 = growth * (std::hypot(d3, root * d2) + window * F.largest[2]);
  const double E4 = growth * (std::hypot(d4, root * d3) + window * F.largest[3]);
  const double p = std::abs(signal.p[i]);
  const double r = std::abs(signal.r[i]);
  return {p * E2 + r * E3, p * E3 + r * E4};
}

// Bound of |phi''| over the window by the sampled inputs and the responses to them, which jumps at
// knots.
double sampled_second(const Signal& signal, const Motion& motion, double window) {
  const SampledResponse& sampled = *motion.flow->sampled();
  const SampledInputs& inputs = sampled.inputs();
  const std::size_t from = inputs.interval(motion.t.hi - window);
  const std::size_t to = inputs.interval(motion.t.hi + window);
  double largest = 0.0;
  for (std::size_t b = from / SampledResponse::block;
       b < sampled.blocks() && b <= to / SampledResponse::block; ++b) {
    double second = 0.0;
    for (Eigen::Index i = 0; i < sampled.modes(); ++i) {
      const Eigen::Index k = sampled.first_mode() + i;
      second += std::abs(signal.p[k]) * sampled.largest_second(b)[i] +
                std::abs(signal.r[k]) * sampled.largest_third(b)[i];
    }
    for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
      const double* of = sampled.largest_inputs(b) + chain_terms * c;
      for (Eigen::Index j = 0; j < chain_entries; ++j) {
        const Eigen::Index k = sampled.first() + chain_entries * c + j;
        if (2 * j + 2 < chain_terms) second += std::abs(signal.p[k]) * of[2 * j + 2];
        if (2 * j + 3 < chain_terms) second += std::abs(signal.r[k]) * of[2 * j + 3];
      }
    }
    largest = std::max(largest, second);
  }
  if (to + 1 < inputs.knots()) return largest;
  // After the last knot nothing is tabulated: at most the growth of free motions under the last
  // values, as for the oscillators above.
  return infinity;
}

}  // namespace

SignalRange range(const Signal& signal, const Motion& motion, double window) {
  const Flow& flow = *motion.flow;
  const Oscillators& o = flow.oscillators();
  double second = 0.0;
  double third = 0.0;
  const auto drives = flow.drives().all();
  auto drive = drives.begin();
  for (Eigen::Index i = 0; i < flow.frequencies() + flow.modes(); ++i) {
    OscillatorForces F;
    for (; drive != drives.end() && drive->mode == i; ++drive) {
      F.value += drive->force(motion.x);
      F.rate += drive->force_rate(o, motion.x);
      F.second -= o.kappa()[drive->source] * drive->force(motion.x);
      const std::array<double, 4> largest = drive_amplitudes(*drive, motion);
      for (std::size_t k = 0; k < largest.size(); ++k) F.largest[k] += largest[k];
    }
    if (flow.sampled() != nullptr && i >= flow.harmonics() && i < flow.frequencies()) continue;
    if (signal.p[i] == 0.0 && signal.r[i] == 0.0) continue;
    const Added added = added_by(i, signal, motion, F, window);
    second += added.second;
    third += added.third;
  }
  const double v0 = value(signal, motion);
  const double v1 = rate(signal, motion);
  const double v2 = second_rate(signal, motion);
  SignalRange range;
  if (flow.sampled() != nullptr) {
    // phi'' may jump at knots: bounds by its value at the motion's time do not hold.
    range.second = second + sampled_second(signal, motion, window);
    const double of_rate = window > 0.0 ? window * range.second : 0.0;
    const double of_value = window * std::abs(v1) + 0.5 * window * of_rate;
    return {v0 - of_value, v0 + of_value, v1 - of_rate, v1 + of_rate, range.second};
  }
  range.second = std::min(second, std::abs(v2) + window * third);
  const double of_value = window * std::abs(v1) + 0.5 * window * window * range.second;
  const double of_rate =
      std::min(window * range.second, window * std::abs(v2) + 0.5 * window * window * third);
  range.low = v0 - of_value;
  range.high = v0 + of_value;
  range.rate_low = v1 - of_rate;
  range.rate_high = v1 + of_rate;
  return range;
}

}  // namespace sprag
