#include "sprag/detail/mechanics/drives.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace sprag {
namespace {

// Response after tau of an oscillator that starts at rest: z and z' under F = cos Omega t, and z
// under F = sin Omega t / Omega. The rate of `sine` equals `cosine`.
struct DrivenResponse {
  double cosine, rate, sine;
};

// Power series in tau. Requires |tau| times each of the rates involved <= 1/2.
DrivenResponse short_response(double delta, double kappa, double kappa_source, double tau) {
  constexpr std::size_t terms = 16;
  const double x = 2.0 * delta * tau;
  const double y = kappa * tau * tau;
  const double y_source = kappa_source * tau * tau;
  // Z_n = z_n tau^n, F_n = f_n tau^n: (n + 2)(n + 1) Z_(n+2) = tau^2 F_n - x (n + 1) Z_(n+1) -
  // y Z_n.
  const auto series = [&](double F, double next_F) {
    std::array<double, terms> Z{};
    for (std::size_t n = 0; n + 2 < terms; ++n) {
      const auto i = static_cast<double>(n);
      const double divisor = (i + 2.0) * (i + 1.0);
      Z[n + 2] = (tau * tau * F - x * (i + 1.0) * Z[n + 1] - y * Z[n]) / divisor;
      F = std::exchange(next_F, -y_source * F / divisor);
    }
    return Z;
  };
  const std::array<double, terms> cosine = series(1.0, 0.0);
  const std::array<double, terms> sine = series(0.0, tau);
  DrivenResponse z{};
  for (std::size_t n = terms - 1; n >= 2; --n) {
    z.cosine += cosine[n];
    z.rate += static_cast<double>(n) * cosine[n];
    z.sine += sine[n];
  }
  z.rate = tau != 0.0 ? z.rate / tau : 0.0;
  return z;
}

// The steady response minus the free motion with the same initial state. Inaccurate near resonance
// and over a small fraction of a period of the source, where the two cancel.
DrivenResponse steady_response(const OscillatorKernel& k, double delta, double kappa, double Omega,
                               double tau) {
  const double c = std::cos(Omega * tau);
  const double s = std::sin(Omega * tau);
  const double a = kappa - Omega * Omega;
  const double b = 2.0 * delta * Omega;
  const double size = a * a + b * b;
  return {(a * c + b * s - (k.zz * a + k.zv * Omega * b)) / size,
          (Omega * (b * c - a * s) - (k.vz * a + k.vv * Omega * b)) / size,
          ((a * s - b * c + k.zz * b) / Omega - k.zv * a) / size};
}

// Near resonance and over short times: the series over a small fraction of tau, doubled repeatedly.
// Nothing cancels, and each doubling costs one rounding.
DrivenResponse response(const Oscillators& oscillators, Eigen::Index mode, Eigen::Index source,
                        double tau) {
  const double delta = oscillators.delta()[mode];
  const double kappa = oscillators.kappa()[mode];
  const double Omega = oscillators.root_kappa()[source];
  const double kappa_source = oscillators.kappa()[source];
  if (Omega * std::abs(tau) > 0.5 &&
      std::abs(kappa - kappa_source) > 0.125 * std::max(kappa, kappa_source)) {
    return steady_response(oscillators.kernel(mode, tau), delta, kappa, Omega, tau);
  }
  const double fastest = std::max({2.0 * delta, oscillators.root_kappa()[mode], Omega});
  int doublings = 0;
  std::frexp(2.0 * fastest * tau, &doublings);
  doublings = std::max(doublings, 0);
  double part = std::ldexp(tau, -doublings);
  DrivenResponse z = short_response(delta, kappa, kappa_source, part);
  for (; doublings > 0; --doublings) {
    const OscillatorKernel k = oscillators.kernel(mode, part);
    const double c = std::cos(Omega * part);
    const double s = std::sin(Omega * part);
    z = {k.zz * z.cosine + k.zv * z.rate + z.cosine * c - z.sine * Omega * s,
         k.vz * z.cosine + k.vv * z.rate + z.rate * c - z.cosine * Omega * s,
         k.zz * z.sine + k.zv * z.cosine + z.cosine * s / Omega + z.sine * c};
    part *= 2.0;
  }
  return z;
}

}  // namespace

Drives::Drives(const Oscillators& oscillators, std::vector<Drive> drives)
    : drives_(std::move(drives)) {
  std::stable_sort(drives_.begin(), drives_.end(),
                   [](const Drive& a, const Drive& b) { return a.mode < b.mode; });
  double fastest = 0.0;
  for (const Drive& drive : drives_) {
    fastest = std::max(fastest, oscillators.root_kappa()[drive.source]);
  }
  reach_ = fastest > 0.0 ? 4.0 / fastest : std::numeric_limits<double>::infinity();
}

void Drives::respond(const Oscillators& oscillators, const OscillatorState& from, double tau,
                     Eigen::Index first, Eigen::Index end, OscillatorState& to) const {
  for (const Drive& drive : drives_) {
    if (drive.mode < first) continue;
    if (drive.mode >= end) break;
    const DrivenResponse z = response(oscillators, drive.mode, drive.source, tau);
    const double F = drive.force(from);
    const double rate = drive.force_rate(oscillators, from);
    to.z[drive.mode] += F * z.cosine + rate * z.sine;
    to.v[drive.mode] += F * z.rate + rate * z.cosine;
  }
}

DriveTable::DriveTable(const Oscillators& oscillators, const Drives& drives, double h) {
  OscillatorState source{Eigen::ArrayXd::Zero(oscillators.size()),
                         Eigen::ArrayXd::Zero(oscillators.size())};
  OscillatorState moved = source;
  for (const Drive& drive : drives.all()) {
    const Drives alone(oscillators, {drive});
    const auto from = [&](double z, double v) {
      // The source's state h earlier.
      const double c = std::cos(oscillators.root_kappa()[drive.source] * h);
      const double s = std::sin(oscillators.root_kappa()[drive.source] * h);
      const double Omega = oscillators.root_kappa()[drive.source];
      source.z[drive.source] = c * z - s / Omega * v;
      source.v[drive.source] = Omega * s * z + c * v;
      moved.z[drive.mode] = moved.v[drive.mode] = 0.0;
      alone.respond(oscillators, source, h, 0, oscillators.size(), moved);
      return std::pair(moved.z[drive.mode], moved.v[drive.mode]);
    };
    const auto [zz, vz] = from(1.0, 0.0);
    const auto [zv, vv] = from(0.0, 1.0);
    rows_.push_back({drive.mode, drive.source, zz, zv, vz, vv});
  }
}

void DriveTable::apply(OscillatorState& x) const {
  for (const Row& row : rows_) {
    const double z = x.z[row.source];
    const double v = x.v[row.source];
    x.z[row.mode] += row.zz * z + row.zv * v;
    x.v[row.mode] += row.vz * z + row.vv * v;
  }
}

}  // namespace sprag
