// The event filter of a scene (event_filter.h), together with the data that its estimator needs:
// the prior of state and parameters, time scales, and the deviations of all published quantities.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/filter/belief_pool.h"
#include "sprag/detail/filter/event_filter.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/scene.h"

namespace sprag {

struct SceneFilter {
  /// For a scene with exact parameters.
  SceneFilter(const Scene& scene, std::shared_ptr<Flows> flows);
  /// For a scene with uncertain parameters.
  ///
  /// \param from_prior  true: the parameters have the prior of [parameters]; false: identification
  ///                    gives their first estimate
  ///
  /// \throws ModelError  if an unknown is of the contact clock, or if there is none
  SceneFilter(const Scene& scene, std::vector<Parameter> unknowns, bool from_prior);

  /// Sets mean and covariance of the parameters to their prior.
  void set_prior(FilterBelief& belief) const;
  /// Twice the energy of the motion in the members q and u.
  double motion_energy() const;

  /// Gap of one contact on the flight of the mean from a belief to t.
  struct LastFlight {
    double inside = 0.0;                 ///< share of the flight with a negative gap
    double lowest = 0.0, highest = 0.0;  ///< extreme values of the gap [m]
    bool ends_near = false;              ///< the gap was zero or negative shortly before or after t
  };
  LastFlight last_flight(int contact, double t, const FilterBelief& before);
  /// For a gap that is negative at t: the last time at which it fell through zero [s]. -infinity if
  /// that was before the belief.
  double crossing_before(double t, int contact, const FilterBelief& belief);

  /// Published estimate of a belief at t, q and u of f entries each.
  void publish(double t, const FilterBelief& of, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u);
  /// After publish(): fills in all deviations.
  void fill_deviations(double t, const FilterBelief& of, Confidence& confidence);
  /// Values and deviations of the parameters at t. `of` is null if they are not estimated: nominal
  /// values, infinite deviations.
  void fill_parameters(double t, const FilterBelief* of, ParameterEstimates& parameters) const;
  /// Sets `belief` to the mean and the square root of the covariance of (q, u) at t, with as many
  /// columns as state and parameters have entries. Returns the rows of the parameters' coordinates
  /// in that square root. Allocates.
  Eigen::MatrixXd belief(double t, const FilterBelief& of, Belief& belief);

  std::unique_ptr<SceneValues> family;  ///< null if no parameter is uncertain
  std::unique_ptr<Flight> flight;
  EventFilter filter;
  std::shared_ptr<const std::vector<std::string>> keys;  ///< of the parameters
  Eigen::MatrixXd outputs;  ///< rows by (q, u), 2f x the model's outputs
  double sigma = 0.0;       ///< jitter, at least the minimum that uncertain parameters require [s]
  double of_start = 0.0;    ///< twice the expected energy of the prior's error
  double largest_w = 1.0;   ///< largest entry of the contacts' directions
  Eigen::MatrixXd M, K;
  double least_look = 0.0, longest_look = infinity;  ///< shortest and longest interval between two
                                                     ///< checks for an overdue event [s]
  double first_flight = 0.0;                         ///< assumed duration of the first flight [s]
  /// The scale of the motion is unobservable: homogeneous machine with a jitter.
  bool scale_is_open = false;
  bool may_start_inside = false;
  Eigen::MatrixXd start;     ///< square root of the state's prior covariance, 2f x 2f
  Eigen::MatrixXd inflated;  ///< that of a reset, after covariance inflation
  /// Square root of the parameters' prior covariance in their coordinates, P x P. Empty if they are
  /// identified, or if there are none.
  Eigen::MatrixXd prior;
  FilterBelief nothing;  ///< zero belief of the filter's sizes
  std::unique_ptr<BeliefPool> pool;
  // Scratch.
  FilterBelief next;
  Eigen::VectorXd q, u, x, off;
  Eigen::MatrixXd of_state;  // 2f x (2f + P)

 private:
  void set_up(const Scene& scene);

  Eigen::MatrixXd of_gaps_, columns_;  // scratch
  Eigen::RowVectorXd row_;
};

}  // namespace sprag
