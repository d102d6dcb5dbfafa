// The estimate that is published at a tick, from the belief after the last reported event
// (docs/explanation/filter.md, Unreported events).
//
// Reports are late by up to a few sigma. An event may have happened at t without a report, and a
// report may precede its event. The published estimate mixes both cases of such an event, with it
// and without it:
//
//   x = p x_with + (1 - p) x_without,   P = p P_with + (1 - p) P_without + p (1 - p) d d^T,
//
// d = x_with - x_without. p follows from the gap (or the contact force) of the mean, its deviation,
// and the time since the mean reached the event. Events that the mean has reached are mixed in
// their order; the mixture continues beyond an event that is more likely than not.
#pragma once

#include <Eigen/Core>

#include "sprag/detail/filter/linearized_flight.h"

namespace sprag {

class PublishedEstimate {
 public:
  /// \param at  receives the estimate; must outlive this
  /// \param example  a belief of the filter's sizes
  PublishedEstimate(LinearizedFlight& at, const FilterBelief& example);

  /// Writes the mean and the columns at t to at.x, at.X and at.T. Does not allocate.
  void find(double t, const FilterBelief& belief);
  /// After find(): false if the state at t is not known, because more events than are mixed have
  /// probably happened without a report, as in a chatter, or because two events of different
  /// contacts were reported before they happened.
  bool is_determined() const { return determined_; }

 private:
  // An unreported event that the mean has reached or is close to.
  struct Unreported {
    int contact = -1;  // -1: no event
    bool opens = false;
    double ago = 0.0;  // time since the mean reached it [s]
    double p = 0.0;    // probability that it has happened
  };

  Flight& flight() const { return at_->flight(); }
  void fly(double t, const FilterBelief& belief);
  static bool another_is_later(double t, const FilterBelief& belief);
  void mix_last(double t, const FilterBelief& belief);
  void mix_unreported(double t, const FilterBelief& belief);
  Unreported next(double t, double longest, const FilterBelief& belief);
  static double look_back(const Flight::Gap& present, double longest, const FilterBelief& belief);
  ContactSet happen(const Unreported& event, double t, const FilterBelief& belief);
  void find_earlier(int contact, double t, double ago, const FilterBelief& belief);
  void mix(double p);

  LinearizedFlight* at_;
  FilterBelief mixed_;
  bool determined_ = true;
  Eigen::VectorXd x_, earlier_;  // x with the event; its change if the event is earlier
  Eigen::MatrixXd X_;            // columns with the event
  FilterBelief::Rows all_;
  Eigen::VectorXd reflector_;
};

}  // namespace sprag
