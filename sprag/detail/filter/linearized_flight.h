// Prediction and measurement update of the event filter's belief: the flight of its mean and square
// root, linearized about a point; the row of a gap or a contact force on the columns; and
// measurements by Potter's square root (Bierman 1977).
//
// Second order in the parameters: a flight adds the columns sigma_k (dE / dc_k) S, the product of
// the deviations of state and parameter k, with the transition matrix E. Considered parameters
// (Schmidt) keep mean and variance, but enter the gain of all other variables.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/filter/flight.h"

namespace sprag {

/// Events closer than so many deviations of their times may be simultaneous.
inline constexpr double indistinct = 3.0;

class LinearizedFlight {
 public:
  /// `flight` and `model` must outlive this.
  LinearizedFlight(Flight& flight, const FilterModel& model);

  Flight& flight() const { return *flight_; }
  Eigen::Index n() const { return flight_->n(); }
  Eigen::Index unknowns() const { return flight_->unknowns(); }
  Eigen::Index size() const { return 2 * n() + unknowns(); }
  /// Columns of an event's belief before moment matching. X has three more, for the published
  /// estimate.
  Eigen::Index event_columns() const { return X.cols() - 3; }
  bool considers() const { return considers_; }

  /// Whether `past` is computed: the derivative of each column with respect to xi before the event.
  void keep_past(bool keep);

  /// Sets A to the columns of the belief and of the process noise (walk, drift) of `duration` [s].
  /// The noise is applied at the start of the duration.
  void spread(const FilterBelief& belief, double duration);
  /// Moves the point z and the columns A from the belief's time to t.
  void fly(double t, const Eigen::VectorXd& z, const FilterBelief& belief,
           bool second_order = true);
  /// After fly(): maps a deviation of (x, c) before the flight to `dx`, that of x after it.
  void carry(const Eigen::Ref<const Eigen::VectorXd>& dz);
  /// After fly(): evaluates the gap or force of a contact, its rows on the columns and its
  /// rounding.
  void look(int contact, bool of_force, double t);

  /// Potter's measurement update of X, T and the mean (x, c) by the row phi. Considered parameters
  /// do not change.
  void measure(double residual, double noise, Eigen::VectorXd& mean_x, Eigen::VectorXd& mean_c);
  /// Rank-one update with the gain k = (X; T) row: mean += shift k, (X; T) -= share k row^T.
  void update_along(const Eigen::VectorXd& row, double shift, double share, Eigen::VectorXd& mean_x,
                    Eigen::VectorXd& mean_c);

  Eigen::MatrixXd A;          ///< columns of (x, c) before the flight
  Eigen::VectorXd x;          ///< the point after it
  Eigen::MatrixXd X, T;       ///< columns of x and of c
  Eigen::MatrixXd past;       ///< columns of xi before the event, if kept
  Eigen::VectorXd past_mean;  ///< mean of xi before the event, if kept
  Flight::Gap of;             ///< of look(): gap or force
  Eigen::VectorXd phi, psi;   ///< rows on the columns of the gap or force, and of its velocity
  Eigen::VectorXd of_g, of_velocity;    ///< gradients by x
  Eigen::VectorXd by_c, velocity_by_c;  ///< partial derivatives by c, P entries
  double noise = 0.0;                   ///< variance of the rounding error of `of`
  Eigen::VectorXd dx;                   ///< result of carry()

 private:
  void spread_kicks(Eigen::Index column, double duration, ContactSet held);

  Flight* flight_;
  const FilterModel* model_;
  bool considers_ = false, keeps_past_ = false;
  std::vector<Eigen::Index> flow_unknowns_;
  Eigen::MatrixXd kick_;  // scratch
  Eigen::VectorXd gain_, past_gain_;
};

}  // namespace sprag
