/// \file
/// \brief Parameters of a scene's machine that can be identified, by the keys of the scene file:
/// impact.restitution, contact.1.position, beam.damping, excitation.phase, system.K.1.2, ...
///
/// A key for several numbers (K and C of a general system, harmonics of one frequency) is a common
/// factor, nominally 1; a phase is a common shift, nominally 0. impact.restitution is a factor if
/// the contacts' restitutions differ. One that depends on the speed has impact.restitution.value,
/// of the slowest impacts, and impact.restitution.slope. excitations.amplitude, .phase and
/// .frequency apply to all harmonics of several frequencies. A recorded input has a gain and a
/// delay: excitation.gain, force.1.delay.
///
/// clock.rate and clock.offset [s] are those of the contact clock (sprag/contact_event.h).
#pragma once

#include <string>
#include <utility>

namespace sprag {

/// \brief A parameter of a scene's machine, and how a search treats it.
struct Unknown {
  /// \brief What it is a parameter of.
  enum class Kind {
    restitution,        ///< epsilon of contact `index`, or of all; of a curve that of the slowest
                        ///< impacts, with which the others change in proportion
    restitution_slope,  ///< d epsilon / dv of contact `index`, or of all [s/m]
    damping,            ///< d of a beam, or a factor on C
    stiffness,          ///< EI of a beam, or a factor on K
    damping_entry,      ///< C at (row, column) and (column, row)
    stiffness_entry,    ///< K at (row, column) and (column, row)
    position,           ///< x_c of contact `index` of a beam
    frequency,          ///< of harmonic group `index`, or a factor on all
    clock_rate,         ///< of the contact clock
    clock_offset,       ///< reading of the contact clock at the machine's t = 0
    delay,              ///< of recorded input `index` [s]
    // The path is linear in the kinds below.
    phase,      ///< of harmonic group `index`, or a shift of all [rad]
    amplitude,  ///< of harmonic group `index`, or a factor on all
    constant,   ///< of force `index`
    clearance,  ///< of contact `index`
    gain,       ///< of recorded input `index`
  };

  Kind kind = Kind::restitution;  ///< what it is a parameter of
  int index = -1;                 ///< from 0; -1: all, or the whole machine
  int row = 0, column = 0;        ///< of an entry
  std::string key = {};           ///< as in the scene file
  std::string unit = {};          ///< of its value
  double nominal = 0.0;           ///< value in the scene
  double within = 0.2;            ///< largest change from the nominal value, relative to it
  bool logarithmic = false;       ///< the coordinate is log(value / nominal)
  double unit_step = 1.0;         ///< else: the change of the value per unit of the coordinate

  /// \brief Whether the path is linear in it.
  /// \return true if it is.
  bool linear() const { return kind >= Kind::phase; }
  /// \brief Whether a change is stated as a share of the nominal value: not that of a phase, of a
  /// time or of a value of 0.
  /// \return true if it is.
  bool is_relative() const;
  /// \brief Coordinate of a value in the search: 0 at the nominal value, +0.1 for a change of 10 %.
  /// \param value a value.
  /// \return its coordinate.
  double coordinate(double value) const;
  /// \brief Value at a coordinate.
  /// \param coordinate a coordinate.
  /// \return its value.
  double value(double coordinate) const;
  /// \brief d value / d coordinate.
  /// \param value where.
  /// \return the slope.
  double slope(double value) const { return logarithmic ? value : unit_step; }
  /// \brief Two physical coordinates for a difference quotient.
  /// \param coordinate between them.
  /// \param step half of their distance.
  /// \return both.
  std::pair<double, double> neighbours(double coordinate, double step) const;
  /// \brief Lower end of the range to search.
  /// \return a coordinate.
  double lowest() const;
  /// \brief Upper end of the range to search.
  /// \return a coordinate.
  double highest() const;
  /// \brief Whether a value is at its physical limit: a damping or restitution of 0, or
  /// `upper_limit`.
  /// \param value a value.
  /// \return true if it is.
  bool is_physical_bound(double value) const;
  /// \brief Whether the relative change from the nominal value is at most `within`. Phases,
  /// clearances, clock offsets and delays are not limited.
  /// \param value a value.
  /// \param tolerance in coordinates.
  /// \return true if it is.
  bool is_within(double value, double tolerance) const;

  double upper_limit = 0.0;  ///< upper limit of the value: epsilon <= 1, x_c <= l; 0: none
};

}  // namespace sprag
