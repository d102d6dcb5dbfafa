/// \file
/// \brief The clock of the contact sensor: [clock] of a scene.
///
/// The sensor's clock reads t_clock = offset + rate t at the machine's time t. A clock that is 200
/// ppm fast has the rate 1.0002. Programs convert event times to the machine's time where they
/// enter: from a file or from a message. All functions of the library take the machine's time.
#pragma once

namespace sprag {

/// \brief Offset and rate of the contact clock against the machine's time.
struct ContactClock {
  double offset = 0.0;  ///< reading of the contact clock at the machine's t = 0 [s]
  double rate = 1.0;    ///< seconds of the contact clock per second of the machine, > 0

  /// \brief Whether the contact clock reads the machine's time.
  /// \return true if it does.
  bool is_true() const { return offset == 0.0 && rate == 1.0; }
  /// \brief Compares two clocks.
  friend bool operator==(const ContactClock&, const ContactClock&) = default;
};

/// \brief The machine's time at a reading of the contact clock; the reading itself if it is_true().
/// \param clock the contact clock.
/// \param t_clock reading [s].
/// \return (t_clock - offset) / rate [s].
constexpr double machine_time(const ContactClock& clock, double t_clock) {
  return (t_clock - clock.offset) / clock.rate;
}

/// \brief The reading of the contact clock; the time itself if the clock is_true().
/// \param clock the contact clock.
/// \param t the machine's time [s].
/// \return offset + rate t [s].
constexpr double clock_time(const ContactClock& clock, double t) {
  return clock.offset + clock.rate * t;
}

}  // namespace sprag
