// Harmonic forces on single oscillators of a bank,
//
//   z'' + 2 delta z' + kappa z = alpha + F(t),   F = cos z_source + sin z_source',
//
// where the source is another oscillator of the bank, without damping: a frequency of the
// excitation. Only for those oscillators whose steady response to it is far beyond where they move,
// at and near resonance and where next to nothing holds them: there the steady response and what it
// leaves to the free motion would cancel. All others move about their steady response (flow.h).
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
  /// How far ahead the bounds of a search may count on the forces: half a period or so of the
  /// fastest source; infinity where there is none.
  double reach() const { return reach_; }

  /// Adds to the modes from `first` to below `end` of `to` what the forces make of them over tau,
  /// the bank being at `from` before; where tau is negative, what they have made of them. All
  /// digits of it, in and off resonance; at a cost that grows with the logarithm of tau.
  void respond(const Oscillators& oscillators, const OscillatorState& from, double tau,
               Eigen::Index first, Eigen::Index end, OscillatorState& to) const;

 private:
  std::vector<Drive> drives_;
  double reach_ = 0.0;
};

/// Their response over a fixed step.
class DriveTable {
 public:
  DriveTable() = default;
  DriveTable(const Oscillators& oscillators, const Drives& drives, double h);

  bool empty() const { return rows_.empty(); }
  /// Adds it to the modes of a bank whose sources stand at the end of the step.
  void apply(OscillatorState& x) const;

 private:
  struct Row {
    Eigen::Index mode, source;
    double zz, zv, vz, vv;  // of z_source and z_source' at the end
  };
  std::vector<Row> rows_;
};

}  // namespace sprag
