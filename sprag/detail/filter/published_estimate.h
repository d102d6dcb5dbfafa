// The estimate that is published at a tick, from the belief after the last reported event.
//
// Reports are late by up to a few sigma. What has happened at t without having been reported is not
// in the belief, and a report may have come before its event. Both cases of such an event, with it
// and without it, are mixed:
//
//   x = p x_with + (1 - p) x_without,   P = p P_with + (1 - p) P_without + p (1 - p) d d^T,
//
// d = x_with - x_without. p follows from the gap (or the contact force) of the mean, its deviation,
// and how long ago the mean came to the event. The events that the mean comes to are taken in their
// order; after one that is more likely than not, the mixture goes on to the next.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/filter/linearized_flight.h"

namespace sprag {

class PublishedEstimate {
 public:
  /// \param at  holds the estimate; must outlive this
  /// \param example  a belief of the right size
  PublishedEstimate(LinearizedFlight& at, const FilterBelief& example);

  /// Puts mean and columns at t into at.x, at.X and at.T. Does not allocate.
  void find(double t, const FilterBelief& belief);

 private:
  // An event that the mean has come to, or is near, without a report.
  struct Unreported {
    int contact = -1;  // -1: there is none
    bool opens = false;
    double ago = 0.0;  // since then [s]
    double p = 0.0;    // probability that it has happened
  };

  Flight& flight() const { return at_->flight(); }
  void fly(double t, const FilterBelief& belief);
  void mix_last(double t, const FilterBelief& belief);
  void mix_unreported(double t, const FilterBelief& belief);
  Unreported next(double t, double longest, const FilterBelief& belief);
  double since_impact(int contact, double t, double longest, const FilterBelief& belief);
  double since_opening(int contact, double t, double longest, const FilterBelief& belief);
  ContactSet happen(const Unreported& event, double t, const FilterBelief& belief);
  void find_earlier(int contact, double t, double ago, const FilterBelief& belief);
  void mix(double p);

  LinearizedFlight* at_;
  FilterBelief mixed_;
  Eigen::VectorXd x_, earlier_;  // x with the event; change of it by its time
  Eigen::MatrixXd X_;            // columns with the event
  FilterBelief::Rows all_;
  Eigen::VectorXd reflector_;
};

}  // namespace sprag
