// Belief of the event filter about the state of the machine and its uncertain parameters. It is
// Gaussian,
//
//   (x, c) = z + S xi,   xi ~ N(0, I),
//
// with the state x in the coordinates of a flight (flight.h, 2n entries) and the coordinates c of P
// parameters.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"

namespace sprag {

/// Estimate of the last event. The published estimate uses it at ticks that may precede the event,
/// the impact records use its velocities.
struct ImpactEstimate {
  double time = 0.0, time_sigma = 0.0;  ///< [s]; sigma 0: the published estimate does not mix the
                                        ///< cases before and after it
  ContactSet held_before = 0;           ///< contacts held before it
  double before = 0.0, before_sigma = 0.0;  ///< gap velocity before it [m/s]
  double after = 0.0, after_sigma = 0.0;    ///< and after it [m/s]
  Eigen::VectorXd jump;                     ///< change of x at the event, 2n entries
};

/// Value type. Copies between beliefs of one filter do not allocate.
struct FilterBelief {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  double t = 0.0;         ///< time of the belief [s]
  ContactSet closed = 0;  ///< contacts closed by the reports
  /// Contacts that the flight holds closed, with linearly independent directions.
  ContactSet held = 0;
  /// Held contacts in a burst: set by a report within 3 sigma of the previous one, cleared by a
  /// report of a sustained closing or of an opening, or by 3 sigma without a report.
  ContactSet bursting = 0;
  ContactSet touched = 0;  ///< exact times only: contacts whose gap was zero at the last event of
                           ///< another contact, closed ones excluded
  Eigen::VectorXd z;       ///< mean, 2n + P entries
  Rows S;                  ///< square root of the covariance, square
  double sigma = 0.0;      ///< standard deviation of event times [s]
  Innovation innovation;   ///< innovation of the last closing
  double square = 0.0;     ///< normalized innovation squared of the last event; infinite if the
                           ///< estimated motion has vanished
  double length = 0.0;     ///< largest sum of absolute terms of a gap so far [m]
  double speed = 0.0;      ///< largest gap velocity at a closing so far [m/s]
  /// Homogeneous machine with exact event times: log of the factor by which all measurement updates
  /// since the last reset have reduced the energy of the estimated motion. Every innovation also
  /// fits a vanished motion; this detects one.
  double log_left = 0.0;
  Eigen::VectorXd reported;  ///< per contact: time of its last report, -infinity before it [s]
  Eigen::VectorXd occurred;  ///< per contact: estimated time of its last event [s]
  /// Per contact: speed after its last impact, 0 if it stayed closed or opened [m/s].
  Eigen::VectorXd rebound;
  ImpactEstimate impact;

  /// False after events that contradict every motion of the machine.
  bool is_finite() const {
    return std::isfinite(z.squaredNorm()) && std::isfinite(S.squaredNorm());
  }
};

/// One forward step of the filter, recorded for the fixed-interval smoother. With z + S xi before
/// the step, z' + S' eta after it and the event given,
///
///   xi = mean + on_next eta + rest zeta,   eta, zeta ~ N(0, I).
///
/// This form inverts no covariance, and no entry of on_next and rest exceeds 1.
struct FilterStep {
  FilterBelief after;                ///< the belief z', S' after the step
  int contact = -1;                  ///< contact of the event
  Eigen::VectorXd mean;              ///< 2n + P entries
  FilterBelief::Rows on_next, rest;  ///< square
};

/// Process noise of state and parameters, and properties of the machine that the filter needs.
struct FilterModel {
  /// Standard deviation of the random walk of each parameter's coordinate per root of a unit of
  /// time, P entries; or empty.
  Eigen::VectorXd walk = {};
  /// Root of the covariance of the process noise in x per unit of time, 2n rows; or empty.
  Eigen::MatrixXd drift = {};
  /// The same for white noise of forces during a flight, which acts on the velocities at all of its
  /// times; 2n rows, or empty. `drift` acts at its start.
  Eigen::MatrixXd kicks = {};
  /// For each parameter: true if it is considered (Schmidt), that is never updated. Empty: none is.
  std::vector<bool> considered = {};
  /// The master completes a chatter whose remainder is shorter than this [s].
  double chatter_time = 0.0;
  /// No force, clearance or support motion: the scale of the motion is unobservable.
  bool homogeneous = false;
};

}  // namespace sprag
