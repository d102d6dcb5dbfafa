// Harmonic forces on single oscillators of a bank,
//
//   z'' + 2 delta z' + kappa z = alpha + F(t),   F = cos z_source + sin z_source',
//
// where the source is an undamped oscillator of the same bank: a frequency of the excitation.
// Drives serve the oscillators whose steady response is much larger than their motion: at and near
// resonance, and with very low stiffness. There the steady response and the free motion would
// cancel. All other oscillators are described relative to their steady response (flow.h).
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {

struct Drive {
  Eigen::Index mode, source;  ///< numbers of oscillators
  double cos, sin;

  /// F and F' with the bank at x.
  double force(const OscillatorState& x) const { return cos * x.z[source] + sin * x.v[source]; }
  double force_rate(const Oscillators& oscillators, const OscillatorState& x) const {
    return cos * x.v[source] - sin * oscillators.kappa()[source] * x.z[source];
  }
};

/// The drives of one bank, by ascending mode.
class Drives {
 public:
  Drives() = default;
  Drives(const Oscillators& oscillators, std::vector<Drive> drives);

  bool empty() const { return drives_.empty(); }
  std::span<const Drive> all() const { return drives_; }
  /// Time ahead for which the bounds of an event search hold under the forces: about half a period
  /// of the fastest source; infinity without drives.
  double reach() const { return reach_; }

  /// Adds the response to the forces over tau to the modes first <= mode < end of `to`, with the
  /// bank at `from` at the start. tau may be negative. Accurate to rounding in and off resonance;
  /// the cost grows with the logarithm of tau.
  void respond(const Oscillators& oscillators, const OscillatorState& from, double tau,
               Eigen::Index first, Eigen::Index end, OscillatorState& to) const;

 private:
  std::vector<Drive> drives_;
  double reach_ = 0.0;
};

/// The response of all drives over a fixed step h.
class DriveTable {
 public:
  DriveTable() = default;
  DriveTable(const Oscillators& oscillators, const Drives& drives, double h);

  bool empty() const { return rows_.empty(); }
  /// Adds the response to the modes of x, in which the sources are already at the end of the step.
  void apply(OscillatorState& x) const;

 private:
  struct Row {
    Eigen::Index mode, source;
    double zz, zv, vz, vv;  // per unit of z_source and z_source' at the end of the step
  };
  std::vector<Row> rows_;
};

}  // namespace sprag
