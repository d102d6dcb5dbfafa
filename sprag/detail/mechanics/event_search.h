// Guaranteed search for the first time at which a signal of an exact flow falls to zero.
//
// At an expansion point every signal phi is a Taylor polynomial of degree p plus a remainder. The
// remainder is bounded for all later times: the derivative z^(j) of a damped oscillator obeys the
// oscillator's own equation, so its energy never grows, and |z^(j+1)(t)| is at most the present
// sqrt(z^(j+1)^2 + kappa z^(j)^2).
//
// An interval has no root where polynomial minus remainder is positive, which the Bernstein
// coefficients decide (bernstein.h). A visible root ends the interval, where those coefficients are
// sharp. Steps do not leave the certified interval, so no touch is stepped over. A root is accepted
// if the remainder moves it by less than the resolution of time. Modes whose whole amplitude is
// small against phi are bounded by that amplitude and not evaluated.
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/mechanics/flow.h"

namespace sprag {

/// A signal to watch, sign * phi, positive at the start.
struct Watch {
  const Signal* signal = nullptr;
  double sign = 1.0;
  int order = 0;  ///< how many of phi, phi', phi'', ... are zero at the start by construction
  int id = 0;     ///< identifier for the caller, not used here
};

class EventSearch {
 public:
  /// Reserves memory, so that begin() need not allocate.
  void reserve(std::size_t watches, Eigen::Index oscillators);

  /// Starts a search at the motion's present time. `start` must stay valid until the next begin().
  /// Does not allocate after an earlier search with as many watches and oscillators.
  void begin(const Motion& start, std::span<const Watch> watches);

  /// Continues until an event is found or every signal is certified positive for at least tau after
  /// the start. The expansion points do not depend on tau. Throws Interrupted (interrupt.h) in a
  /// long search.
  void advance(double tau);

  bool found() const { return found_; }
  /// Time of the first event after the start; valid only if found().
  double tau() const { return tau_; }
  /// Whether watch i, in the order given, fires at tau(). Simultaneous watches all fire.
  bool fires(std::size_t i) const { return states_[i].fires; }
  /// No event occurs before this time after the start.
  double certified() const { return found_ ? tau_ : certified_; }

  /// Number of expansions since construction, a measure of the work.
  long expansions() const { return expansions_; }

 private:
  struct WatchState {
    Watch watch;
    double constant = 0.0;   // of sign * phi on this motion
    double predicted = 0.0;  // phi at the next expansion point, approximately
    double certified = 0.0;  // certified interval of the last expansion
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
  // The next expansion evaluates all oscillators. Set by begin() and where the bound of the omitted
  // ones is too large; cleared by each expansion.
  bool need_all_ = false;
  long expansions_ = 0;
};

}  // namespace sprag
