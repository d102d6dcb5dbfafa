// Parameters of a scene's machine that can be identified, by the keys of the scene file:
// impact.restitution, contact.1.position, beam.damping, excitation.phase, system.K.1.2, ...
//
// A key for several numbers (K and C of a general system, harmonics of one frequency) is a common
// factor, nominally 1; a phase is a common shift, nominally 0. impact.restitution is a factor if
// the contacts' restitutions differ. excitations.amplitude, .phase and .frequency apply to all
// harmonics of several frequencies. A recorded input has a gain and a delay: excitation.gain,
// force.1.delay.
//
// clock.rate and clock.offset [s] are those of the contact clock (sprag/contact_clock.h).
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
    frequency,        ///< of harmonic group `index`, or a factor on all
    clock_rate,       ///< of the contact clock
    clock_offset,     ///< reading of the contact clock at the machine's t = 0
    delay,            ///< of recorded input `index` [s]
    // The path is linear in the kinds below (linear_path.h).
    phase,
    amplitude,  ///< of harmonic group `index`, or a factor on all
    constant,   ///< of force `index`
    clearance,  ///< of contact `index`
    gain,       ///< of recorded input `index`
  };

  Kind kind = Kind::restitution;
  int index = -1;  ///< from 0; -1: all, or the whole machine
  int row = 0, column = 0;
  std::string key = {};  ///< as in the scene file
  std::string unit = {};
  double nominal = 0.0;
  double within = 0.2;       ///< largest change from the nominal value, relative to it
  bool logarithmic = false;  ///< the coordinate is log(value / nominal)
  double unit_step = 1.0;    ///< else: the change of the value per unit of the coordinate

  bool linear() const { return kind >= Kind::phase; }
  /// Whether a change is stated as a share of the nominal value: not that of a phase, of a time or
  /// of a value of 0.
  bool is_relative() const;
  /// Coordinate of a value in the search: 0 at the nominal value, +0.1 for a change of 10 %.
  double coordinate(double value) const;
  double value(double coordinate) const;
  /// d value / d coordinate at this value.
  double slope(double value) const { return logarithmic ? value : unit_step; }
  /// Two physical coordinates around `coordinate`, 2 `step` apart, for a difference quotient.
  std::pair<double, double> neighbours(double coordinate, double step) const;
  /// Range of coordinates to search.
  double lowest() const;
  double highest() const;
  /// Whether a value is at its physical limit: a damping or restitution of 0, or `upper_limit`.
  bool is_physical_bound(double value) const;
  /// Whether the relative change from the nominal value is at most `within`, up to a tolerance in
  /// coordinates.
  /// Phases, clearances, clock offsets and delays are not limited.
  bool is_within(double value, double tolerance) const;

  double upper_limit = 0.0;  ///< upper limit of the value: epsilon <= 1, x_c <= l; 0: none
};

/// All parameters of the scene's machine, without single entries of C and K.
std::vector<Unknown> unknowns_of(const Scene& scene);

/// Parameters for several different numbers at once: a factor on the restitutions, on all
/// amplitudes or frequencies, and a shift of all phases.
std::vector<Unknown> common_unknowns(const Scene& scene);
/// Whether it is one of common_unknowns() for harmonics.
bool is_common(const Unknown& unknown);

/// clock.rate, and with an excitation clock.offset.
std::vector<Unknown> clock_unknowns(const Scene& scene);
/// Whether it is one of clock_unknowns().
bool is_of_clock(const Unknown& unknown);

/// Whether a filter of state and parameters can estimate it: not one of the clock.
bool can_be_filtered(const Unknown& unknown);

/// Whether it sets the scale of the motion. Events determine other such parameters only relative to
/// it.
bool carries_scale(const Unknown& unknown);

/// All parameters that events can determine, without `known`: one restitution if all contacts have
/// the same, and without one amplitude, gain of a record or constant force, in this order, that
/// sets the scale, unless one of `known` sets it.
std::vector<Unknown> all_but_the_scale(const Scene& scene, std::vector<std::string> known = {});

/// Parameter with this key, which may be an entry of C or K. Throws std::invalid_argument with the
/// nearest key.
Unknown unknown_of(const Scene& scene, std::string_view key);
/// Parameters with these keys.
std::vector<Unknown> unknowns_named(const Scene& scene, const std::vector<std::string>& keys);

/// Common frequency [rad per unit of time] of all harmonics with an amplitude; 0: they differ.
double only_frequency(const Model& model);

/// Harmonics that share amplitude, frequency and phase in the scene file.
struct HarmonicGroup {
  std::vector<int> forces;    ///< from 0
  std::vector<int> contacts;  ///< contacts whose supports move with it, from 0
  std::string key;            ///< "excitation", "force.1", "contact.2.motion"
  double amplitude = 1.0, frequency = 0.0, phase = 0.0;
  bool of_frame = false;  ///< the forces are inertia forces, which grow with the frequency
};

/// A beam has one group. A general system has one for its shaken frame and one for each other
/// harmonic. Without a frame it has one for all harmonics of one frequency, else one for each.
std::vector<HarmonicGroup> harmonic_groups(const Scene& scene);

/// A recorded input of the scene, and the forces and supports that it moves.
struct RecordedInput {
  SampledInputPointer input;
  std::vector<int> forces, contacts;  ///< from 0
  std::string key;                    ///< "excitation", "force.1"
};

/// The record of the shaken frame, and one for each other force with a record.
std::vector<RecordedInput> recorded_inputs(const Scene& scene);

/// Moves these forces and supports of a model by another input.
void replace_input(const RecordedInput& record, const SampledInputPointer& input, Model& model);
/// The same for the scene's model, and its shaken frame if that moves by the same input.
void replace_input(const RecordedInput& record, const SampledInputPointer& input, Scene& scene);

/// Root mean square of the rate of a record's samples over that of the samples, both without their
/// means: the angular frequency of a sinusoid [rad/s].
double mean_frequency(const SampledInput& input);

}  // namespace sprag
