// Long-term behaviour of a machine by a stroboscope: its points (q, u) at the instants k T of the
// excitation's period (a Poincare section), impacts per period, the period in which the points
// repeat, the largest Lyapunov exponent, and the attractor reached. Pure functions of machine,
// start and settings.
#pragma once

#include <Eigen/Core>
#include <limits>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/model.h"
#include "sprag/simulate.h"

namespace sprag {

struct RecurrenceSettings {
  double period = 0.0;      ///< T of the stroboscope, > 0; 0: that of the excitation
  int transient = 300;      ///< periods before recording, >= 0
  int periods = 200;        ///< points, >= 1
  int longest = 32;         ///< longest period [T] to search for; at most a quarter of the points
  double tolerance = 1e-6;  ///< distance of repeating points, as a fraction of the largest point
                            ///< (or of 1e-6 of the start), > 0; |x|^2 = sum of M_jj
                            ///< ((2 pi / T)^2 q_j^2 + u_j^2)
  bool lyapunov = false;
};

struct Recurrence {
  double period = 0.0;  ///< T
  /// `periods` x 2f: q and u at t = (transient + k) T, right-continuous. An impact within 1e-9 T
  /// after that instant counts as before it, and the point is then the state after the impact.
  Simulation::Rows points;
  double impacts_per_period = 0.0;  ///< mean over `periods` of contacts that close, with pulses
  /// Smallest number of periods after which the last half of the points repeats. 0: none; the
  /// motion is not periodic, has a longer period, or has not settled.
  int attractor_period = 0;
  /// 2f entries: the lexicographically first of the points in which the attractor repeats; nan
  /// without a period.
  Eigen::VectorXd attractor;
  /// Largest exponent [1 / unit of time], nan unless requested. For a periodic motion from its
  /// Floquet multipliers, else over as many further periods. -infinity: impacts remove every
  /// difference.
  double lyapunov = std::numeric_limits<double>::quiet_NaN();
};

/// 2 pi / Omega of the single frequency that drives the machine. Throws std::invalid_argument if
/// there is none or more than one.
double excitation_period(const Dynamics& dynamics);

/// Throws std::invalid_argument (settings, or no single frequency and no period specified),
/// ModelError, SimulationError, or Interrupted.
Recurrence recurrence(const Model& model, const State& start, const RecurrenceSettings& settings);

/// Smallest p <= longest, and at most a quarter of the points, with |x_(k+p) - x_k| <= close for
/// all points of the last half; 0 if there is none. One point per row; |x|^2 = sum of weight_j
/// x_j^2.
int period_of_points(const Eigen::Ref<const Simulation::Rows>& points,
                     const Eigen::Ref<const Eigen::VectorXd>& weights, int longest, double close);

}  // namespace sprag
