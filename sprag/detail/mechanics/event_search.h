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
//
// With sampled inputs (sampled_inputs.h) a polynomial holds up to the next knot only. So most
// knots are passed by a cheaper test: phi is the sum of a free motion, whose polynomial holds over
// many intervals, and of the tabulated response to the inputs. Between two knots at distance d,
//
//   phi >= min(phi at the knots) - d^2 / 8 max|phi''|,
//
// and max|phi''| is bounded in advance for blocks of intervals. Expansions are needed only in the
// intervals in which this is not positive: those just before and after a touch.
#pragma once

#include <array>
#include <cstddef>
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

  // The free motion's polynomials, which pass many knots.
  struct March {
    std::array<double, 8> a{};        // of the free part, degree 6, then the remainder's bound
    double second = 0.0;              // bound of its |phi''| over the march
    double noise = 0.0;               // rounding error of phi
    double second_of_response = 0.0;  // bound of the response's |phi''| over the present block
    double phi = 0.0;                 // lower bound at the present knot
    double next = 0.0;                // at the knot under test
    bool jumps = false;               // phi' jumps at knots
  };

  void expand();
  void look(std::size_t i, Eigen::Index count, double t, double longest);
  Eigen::Index oscillators_needed() const;
  bool march();
  bool begin_march();
  bool pass(std::size_t to);
  void set_block(std::size_t number);
  double response_at_knot(const Watch& watch, std::size_t knot) const;
  void enter_interval();
  double time_of_knot(std::size_t knot) const;
  double to_next_knot() const;

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

  // With sampled inputs only.
  const SampledResponse* sampled_ = nullptr;
  std::size_t interval_ = 0;             // of the knots, contains certified_
  bool at_knot_ = false;                 // certified_ is at the knot of interval_
  std::vector<March> marches_;           // per watch
  double march_begin_ = 0.0;             // time of the polynomials after the start
  double march_end_ = -1.0;              // they hold up to this time
  std::size_t march_block_ = 0;          // block that second_of_response refers to
  std::size_t stride_ = 1;               // intervals of the next test
  std::vector<PolynomialForce> forces_;  // per mode, at x_
};

}  // namespace sprag
