// Cluster of events whose windows of +- delta overlap. No contraction counts between them, and the
// terms of earlier events add to the distance between replica and machine.
//
// Events of one contact keep their order. Events of different contacts with overlapping windows may
// have happened in either order or at once; for each such pair the end states differ by a jump. The
// events of one contact together add at most what their impulses admit (momentum), for any number
// of events.
#pragma once

#include <array>
#include <cstddef>

#include "sprag/contact_event.h"

namespace sprag {

/// An event whose window may still be open.
struct OpenWindow {
  double end = 0.0;     ///< [s]
  double J = 0.0;       ///< sqrt of energy
  int contact = -1;     ///< -1: several
  bool simple = false;  ///< an impact of one contact with no other closed
};

/// All in sqrt of energy unless stated otherwise.
struct EventCluster {
  static constexpr std::size_t most_windows = 64;

  double start_b = 0.0;                                          ///< b when the first window opens
  double D = 0.0, E = 0.0, R = 0.0, swap = 0.0, rounding = 0.0;  ///< sums of the permanent terms
  double growth = 1.0;        ///< factor by restitutions that differ between contacts
  double first_t = 0.0;       ///< time of the first event [s]
  double first_speed = 0.0;   ///< sup |gamma| in its window [m/s]
  double impulse = 0.0;       ///< sum of the replica's impulses [N s]
  double acceleration = 0.0;  ///< sup |gamma'| of the free path [m/s^2]
  int events = 0;

  std::array<OpenWindow, most_windows> windows{};
  std::size_t open = 0;

  void begin(double b, double t) {
    *this = {};
    start_b = b;
    first_t = t;
  }
  /// Distance added by the cluster so far.
  double moved() const { return D + E + R + swap + rounding; }
  /// Removes the windows that end at or before t.
  void close_windows(double t);
  /// Returns false if there is no room.
  bool add(const OpenWindow& window);
  double open_J(double t) const;  ///< sum over the windows that are open at t

  /// Bound on the term D of one contact's events: their sum, or by momentum if that is less.
  /// \param G of the contact, \param turn omega_gamma of it [1/s], \param until end of the last
  /// window so far [s], \param delta half a window [s].
  double shift(double G, double turn, double until, double delta) const;
};

}  // namespace sprag
