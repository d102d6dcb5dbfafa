// The parameters of a scene's machine that identification can seek, by the keys of the scene file:
// impact.restitution, contact.1.position, beam.damping, excitation.phase, system.K.1.2, ...
//
// Where a key stands for several numbers (K and C of a general system, harmonics of one frequency)
// it is a common factor, nominally 1, and a phase a common shift, nominally 0. impact.restitution
// is a factor where contacts' own differ, excitations.amplitude, .phase and .frequency are of all
// harmonics where there are several frequencies, which also tell clock.offset, in seconds.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

struct Unknown {
  enum class Kind {
    restitution,  ///< epsilon of contact `index`, or of all
    damping,      ///< d of a beam, or a factor on C
    stiffness,    ///< EI of a beam, or a factor on K
    damping_entry,
    stiffness_entry,  ///< C and K at (row, column) and (column, row)
    position,         ///< x_c of contact `index` of a beam
    frequency,        ///< of group `index` of harmonics, or a factor on all
    clock_offset,     ///< recorded minus true times
    // The path is linear in what follows (linear_path.h).
    phase,
    amplitude,  ///< of group `index` too, or a factor on all
    constant,   ///< of force `index`
    clearance,  ///< of contact `index`
  };

  Kind kind = Kind::restitution;
  int index = -1;  ///< from 0; -1: all of them, or the machine as a whole
  int row = 0, column = 0;
  std::string key = {};  ///< of the scene file
  std::string unit = {};
  double nominal = 0.0;
  double within = 0.2;       ///< how far it may be off, as a share
  bool logarithmic = false;  ///< sought as log(value / nominal)
  double unit_step = 1.0;    ///< of one that is not: what counts as a change by 1

  bool linear() const { return kind >= Kind::phase; }
  /// Sought on a scale where a change by 0.1 is one of 10 %, 0 at the nominal value.
  double coordinate(double value) const;
  double value(double coordinate) const;
  /// d value / d coordinate at this value.
  double slope(double value) const { return logarithmic ? value : unit_step; }
  /// Two coordinates about `coordinate`, 2 `step` apart, for a difference quotient: both physical.
  std::pair<double, double> neighbours(double coordinate, double step) const;
  /// Coordinates that may be tried.
  double lowest() const;
  double highest() const;
  /// Whether a value lies at the end of what is physically possible: a damping or restitution of 0,
  /// `upper_limit`.
  bool is_physical_bound(double value) const;
  /// Whether a value is off by no more than `within`, to a tolerance in coordinates. Phases,
  /// clearances and clock offsets are not limited.
  bool is_within(double value, double tolerance) const;

  double upper_limit = 0.0;  ///< of the value, where there is one: epsilon <= 1, x_c <= l; else 0
};

/// All that the scene's machine has, without single entries of C and K.
std::vector<Unknown> unknowns_of(const Scene& scene);

/// Those that stand for several of these at once, as they differ: a factor on the restitutions, on
/// all amplitudes or frequencies, a shift of all phases, and the clock's offset.
std::vector<Unknown> common_unknowns(const Scene& scene);
/// Whether it is one of these, where harmonics are concerned.
bool is_common(const Unknown& unknown);

/// Whether it is one number of the machine, or a factor on C or K, which a filter of state and
/// parameters can follow: no single entry of C or K, and none of common_unknowns() of harmonics.
bool can_be_filtered(const Unknown& unknown);

/// Whether it says how large the motion is; events tell no more than ratios to it.
bool carries_scale(const Unknown& unknown);

/// All that the events of the scene's machine tell: one restitution where all contacts have the
/// same, nothing of `known`, and one amplitude, or else a constant force, that holds the scale,
/// unless one of `known` does.
std::vector<Unknown> all_but_the_scale(const Scene& scene, std::vector<std::string> known = {});

/// The one of this key, entries included. Throws std::invalid_argument, with the nearest key there
/// is.
Unknown unknown_of(const Scene& scene, std::string_view key);
/// Those of these keys.
std::vector<Unknown> unknowns_named(const Scene& scene, const std::vector<std::string>& keys);

/// Harmonics that have one amplitude, frequency and phase in the scene file.
struct HarmonicGroup {
  std::vector<int> forces;    ///< from 0
  std::vector<int> contacts;  ///< whose supports move with it, from 0
  std::string key;            ///< "excitation", "force.1", "contact.2.motion"
  double amplitude = 1.0, frequency = 0.0, phase = 0.0;
  bool of_frame = false;  ///< the forces are accelerations, which grow with the frequency
};

/// Of a beam one; of a general system one of its shaken frame and one of each other harmonic, or,
/// without a frame, one of all where they have one frequency, else one each.
std::vector<HarmonicGroup> harmonic_groups(const Scene& scene);

}  // namespace sprag
