/// \file
/// \brief Parameters of a scene's machine that can be identified, by the keys of the scene file:
/// impact.restitution, contact.1.position, beam.damping, excitation.phase, and any other number of
/// the machine by its path: system.K.1.2, system.M.1.1, contact.1.direction.2, beam.length.
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

#include <limits>
#include <string>

namespace sprag {

/// \brief A parameter of a scene's machine: a number of the scene by its key, or a common factor or
/// shift of several; and how a search treats it.
struct Parameter {
  std::string key = {};      ///< as in the scene file
  std::string unit = {};     ///< of its value
  double nominal = 0.0;      ///< value in the scene
  double within = 0.2;       ///< largest change from the nominal value, relative to it
  bool logarithmic = false;  ///< the coordinate is log(value / nominal)
  double unit_step = 1.0;    ///< else: the change of the value per unit of the coordinate
  /// \brief Whether a change is stated as a share of the nominal value.
  bool relative = true;
  /// \brief Largest change to search, in coordinates, of a parameter that `within` does not limit:
  /// infinity for a phase or a clearance, half a period for a delay or an offset. 0: by `within`.
  double reach = 0.0;
  double lower_limit = -std::numeric_limits<double>::infinity();  ///< physical limit of the value
  double upper_limit = std::numeric_limits<double>::infinity();   ///< physical limit of the value

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
  /// \brief Lower end of the range to search.
  /// \return a coordinate.
  double lowest() const;
  /// \brief Upper end of the range to search.
  /// \return a coordinate.
  double highest() const;
  /// \brief Whether a value is at its lower or upper limit.
  /// \param value a value.
  /// \return true if it is.
  bool is_physical_bound(double value) const;
  /// \brief Whether the change from the nominal value is at most `within`, if that limits it.
  /// \param value a value.
  /// \param tolerance in coordinates.
  /// \return true if it is.
  bool is_within(double value, double tolerance) const;
};

}  // namespace sprag
