// Belief of the event filter about the state of the machine and its uncertain parameters: Gaussian,
//
//   (x, c) = z + S xi,   xi ~ N(0, I),
//
// x the state in the coordinates of a flight (flight.h, 2n entries), c the coordinates of P
// parameters.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/innovation.h"

namespace sprag {

/// The last event, for ticks that may precede it and for a table of impacts.
struct ImpactEstimate {
  double time = 0.0, time_sigma = 0.0;      ///< [s]; sigma 0: ticks are not mixed about it
  ContactSet held_before = 0;               ///< held before it
  double before = 0.0, before_sigma = 0.0;  ///< gap velocity before it [m/s]
  double after = 0.0, after_sigma = 0.0;    ///< and after it [m/s]
  Eigen::VectorXd jump;                     ///< its change of x, 2n entries
};

/// A value: copies between beliefs of one filter do not allocate.
struct FilterBelief {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  double t = 0.0;           ///< the belief is that of this time [s]
  ContactSet closed = 0;    ///< contacts that are reported closed
  ContactSet held = 0;      ///< contacts that the flight holds closed, linearly independent
  ContactSet bursting = 0;  ///< of `held`, those whose reports are too close for single impacts
  ContactSet touched = 0;   ///< contacts whose gap was zero at an impact of another one
  Eigen::VectorXd z;        ///< mean, 2n + P entries
  Rows S;                   ///< square root of the covariance, square
  double sigma = 0.0;       ///< standard deviation of event times [s]
  Innovation innovation;    ///< of the last closing
  double square = 0.0;      ///< normalized innovation squared of the last event
  double length = 0.0;      ///< largest terms of a gap so far [m]
  double speed = 0.0;       ///< largest terms of a gap velocity so far [m/s]
  /// Log of the share of the motion's energy that the measurements have left, of a homogeneous
  /// machine with exact event times.
  double log_left = 0.0;
  Eigen::VectorXd reported;  ///< per contact: time of its last report, -infinity before it [s]
  Eigen::VectorXd occurred;  ///< per contact: estimated time of its last event [s]
  Eigen::VectorXd rebound;   ///< per contact: speed after its last impact; 0: none [m/s]
  ImpactEstimate impact;

  /// Not so after events that no machine could have.
  bool is_finite() const {
    return std::isfinite(z.squaredNorm()) && std::isfinite(S.squaredNorm());
  }
};

/// One step of the filter for a smoother. With z + S xi before it and z' + S' eta after it, given
/// the event, xi = mean + on_next eta + rest zeta with eta, zeta ~ N(0, I).
/// No inverse of a covariance occurs, and no entry exceeds 1.
struct FilterStep {
  FilterBelief after;                ///< z', S'
  int contact = -1;                  ///< whose event it is
  Eigen::VectorXd mean;              ///< 2n + P entries
  FilterBelief::Rows on_next, rest;  ///< square
};

/// What is not deterministic about machine and parameters, and how exact the events are.
struct FilterModel {
  /// Standard deviation of the random walk of each parameter's coordinate after a unit of time, P
  /// entries; or empty.
  Eigen::VectorXd walk = {};
  /// Root of the covariance of the process noise in x per unit of time, 2n rows; or empty.
  Eigen::MatrixXd drift = {};
  /// Of each parameter whether it is only considered; empty: none is.
  std::vector<bool> considered = {};
  double chatter_time = 0.0;  ///< a chatter is completed over this time by the master [s]
  bool homogeneous = false;   ///< no force and no clearance sets the scale of the motion
};

}  // namespace sprag
