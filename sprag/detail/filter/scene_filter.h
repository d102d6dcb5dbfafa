// The event filter of a scene (event_filter.h), with what its estimator needs beside it: the prior
// of state and parameters, time scales, and the deviations of all quantities that are published.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/estimates/confidence.h"
#include "sprag/detail/filter/belief_pool.h"
#include "sprag/detail/filter/event_filter.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/scene.h"

namespace sprag {

struct SceneFilter {
  /// Of a scene whose parameters are exact.
  SceneFilter(const Scene& scene, std::shared_ptr<Flows> flows);
  /// \param from_prior  the parameters have the prior of [parameters]; false: they are identified
  ///
  /// \throws ModelError  where the scene's damping couples the modes, or an unknown is unsupported
  SceneFilter(const Scene& scene, std::vector<Unknown> unknowns, bool from_prior);

  /// Sets mean and covariance of the parameters to their prior.
  void set_prior(FilterBelief& belief) const;
  /// Twice the energy of the motion in q and u below.
  double motion_energy() const;

  /// The flight from a belief to t, as one contact sees it.
  struct LastFlight {
    double inside = 0.0;                 ///< share of its time with a negative gap
    double lowest = 0.0, highest = 0.0;  ///< gap [m]
    bool ends_near = false;              ///< the gap was zero or negative shortly before or after t
  };
  LastFlight last_flight(int contact, double t, const FilterBelief& before);
  /// When the gap fell through zero before t, where it is negative; -infinity: before the belief
  /// [s].
  double crossing_before(double t, int contact, const FilterBelief& belief);

  /// The estimate of a belief at t, q and u of f entries each.
  void publish(double t, const FilterBelief& of, Eigen::Ref<Eigen::VectorXd> q,
               Eigen::Ref<Eigen::VectorXd> u);
  /// After publish(): all deviations.
  void fill_deviations(double t, const FilterBelief& of, Confidence& confidence);
  /// Values and deviations of the parameters at t; null: nothing is known of them.
  void fill_parameters(double t, const FilterBelief* of, ParameterEstimates& parameters) const;
  /// Mean and square root of the covariance of (q, u) at t, of as many columns as state and
  /// parameters have entries; the rows of the parameters' coordinates are returned. Allocates.
  Eigen::MatrixXd belief(double t, const FilterBelief& of, Belief& belief);

  std::unique_ptr<MachineFamily> family;  ///< null: no parameter is uncertain
  std::unique_ptr<Flight> flight;
  EventFilter filter;
  std::shared_ptr<const std::vector<std::string>> keys;  ///< of the parameters
  Eigen::MatrixXd outputs;  ///< rows by (q, u), 2f x the model's outputs
  double sigma = 0.0;       ///< of event times, with the floor of uncertain parameters [s]
  double of_start = 0.0;    ///< twice the expected energy of a start's error
  double largest_w = 1.0;   ///< largest entry of the contacts' directions
  Eigen::MatrixXd M, K;
  double least_look = 0.0, longest_look = infinity;  ///< between looks for an overdue impact [s]
  double first_flight = 0.0;                         ///< length that is assumed of it [s]
  bool scale_is_open = false;  ///< no event determines how large the motion is
  bool may_start_inside = false;
  Eigen::MatrixXd start;     ///< deviations of a start, 2f x 2f
  Eigen::MatrixXd inflated;  ///< of a reset
  /// Root of the prior covariance of the parameters' coordinates, P x P; empty: they are
  /// identified, or there are none.
  Eigen::MatrixXd prior;
  FilterBelief nothing;  ///< of the right size
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
