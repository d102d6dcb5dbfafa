// Events whose windows of +- delta overlap: between them nothing contracts, and the path from the
// replica to the machine has moved by what the earlier ones add.
//
// The order of one contact's events is kept. Events of different contacts whose windows meet may
// have happened in either order or at once: for each such pair the end states differ by a jump. One
// contact's events together add no more than their impulses allow (momentum), however many they
// are.
#pragma once

#include <array>
#include <cstddef>

#include "sprag/contact_event.h"

namespace sprag {

/// An event whose window may still be open.
struct OpenWindow {
  double end = 0.0;  ///< [s]
  double J = 0.0;    ///< sqrt of energy
  double approach = 0.0;
  int contact = -1;     ///< -1: of several
  bool simple = false;  ///< an impact of one contact with nothing else closed
};

/// All sqrt of energy unless said otherwise.
struct EventCluster {
  static constexpr std::size_t most_windows = 64;

  double start_b = 0.0;                                          ///< b where the first window opens
  double D = 0.0, E = 0.0, R = 0.0, swap = 0.0, rounding = 0.0;  ///< sums of what stays
  double growth = 1.0;        ///< by restitutions that differ between contacts
  double first_t = 0.0;       ///< of the first event [s]
  double first_speed = 0.0;   ///< sup |gamma| about it [m/s]
  double impulse = 0.0;       ///< sum of the replica's [N s]
  double acceleration = 0.0;  ///< sup |gamma'| of the free path [m/s^2]
  int events = 0;

  std::array<OpenWindow, most_windows> windows{};
  std::size_t open = 0;

  void begin(double b, double t) {
    *this = {};
    start_b = b;
    first_t = t;
  }
  /// How far the path has moved so far.
  double moved() const { return D + E + R + swap + rounding; }
  /// Forgets the windows that end at or before t.
  void close_windows(double t);
  /// False where there is no room.
  bool add(const OpenWindow& window);
  double open_J(double t) const;  ///< sum over the windows that are open at t

  /// What the events of one contact add by D, at most: their sum, or by momentum.
  /// \param G of the contact, \param turn omega_gamma of it [1/s], \param until end of the last
  /// window so far [s], \param delta half a window [s].
  double shift(double G, double turn, double until, double delta) const;
};

}  // namespace sprag
