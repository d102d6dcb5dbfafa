// Guaranteed search for the first time at which a signal of an exact flow falls to zero.
//
// At an expansion point every signal phi is a Taylor polynomial of degree p plus a remainder that
// is bounded for all later times: the derivative z^(j) of a damped oscillator obeys the
// oscillator's own equation, so its energy only falls, and |z^(j+1)(t)| <= sqrt(z^(j+1)^2 + kappa
// z^(j)^2) taken now. The interval is root-free as far as the polynomial minus the remainder stays
// positive, which its Bernstein coefficients decide; a root in sight ends the interval, where those
// coefficients are sharp. Steps go no further than that, so no touch is stepped over; a root is
// accepted when the remainder moves it by less than the resolution of time. Modes whose whole
// amplitude is small against phi are bounded by that amplitude and not evaluated.
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/mechanics/flow.h"

namespace sprag {

/// One signal to watch, sign * phi, positive now.
struct Watch {
  const Signal* signal = nullptr;
  double sign = 1.0;
  int order = 0;  ///< how many of phi, phi', phi'', ... are zero at the start by construction
  int id = 0;     ///< the caller's name for it
};

class EventSearch {
 public:
  /// Makes room, so that begin() need not allocate.
  void reserve(std::size_t watches, Eigen::Index oscillators);

  /// Starts anew at the motion's present time, which must stay in place until the next begin().
  /// Does not allocate once it has been used with as many watches and oscillators.
  void begin(const Motion& start, std::span<const Watch> watches);

  /// Goes on until an event is found or every signal is known to stay positive for at least tau
  /// after the start. The points where it stops to look do not depend on tau. Throws Interrupted
  /// (interrupt.h) in a long search.
  void advance(double tau);

  bool found() const { return found_; }
  /// Time of the first event after the start; only if found().
  double tau() const { return tau_; }
  /// Whether watch number i (in the order given) fires at tau(); simultaneous ones all do.
  bool fires(std::size_t i) const { return states_[i].fires; }
  /// No event before this time after the start.
  double certified() const { return found_ ? tau_ : certified_; }

  /// Expansions computed since construction: the work done.
  long expansions() const { return expansions_; }

 private:
  struct WatchState {
    Watch watch;
    double constant = 0.0;   // of sign * phi on this motion
    double predicted = 0.0;  // phi at the next expansion point, roughly
    double certified = 0.0;  // how far the last expansion reached
    double root = 0.0;       // accepted at the last expansion, infinity if none
    bool fires = false;
  };

  void expand();
  void look(std::size_t i, Eigen::Index count, double t);
  Eigen::Index oscillators_needed() const;

  const Motion* start_ = nullptr;
  std::vector<WatchState> states_;
  std::vector<double> tail_;  // watch-major: bound on the modes from k on, k = 0..N
  OscillatorState x_;         // at certified_
  double certified_ = 0.0;
  double tau_ = 0.0;
  bool found_ = false;
  bool need_all_ = false;
  long expansions_ = 0;
};

}  // namespace sprag
