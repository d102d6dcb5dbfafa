// The belief of the event filter at another time: the flight of its mean and of its columns,
// linearized about a point; the row that a gap or a contact force has on these columns; and
// measurements, by Potter's square root.
//
// Second order in the parameters: a flight adds the columns sigma_k (dE / dc_k) S, the product of
// the deviations of state and parameter k, E its transition matrix. Considered parameters (Schmidt)
// keep mean and variance; they enter the gain of everything else.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/filter/filter_belief.h"
#include "sprag/detail/filter/flight.h"

namespace sprag {

class LinearizedFlight {
 public:
  /// `flight` and `model` must outlive this.
  LinearizedFlight(Flight& flight, const FilterModel& model);

  Flight& flight() const { return *flight_; }
  Eigen::Index n() const { return flight_->n(); }
  Eigen::Index unknowns() const { return flight_->unknowns(); }
  Eigen::Index size() const { return 2 * n() + unknowns(); }
  /// Columns of an event's belief before it is collapsed; X has three more, for what is published.
  Eigen::Index event_columns() const { return X.cols() - 3; }
  bool considers() const { return considers_; }

  /// Whether `past` is kept: what each column is of xi before the event.
  void keep_past(bool keep);
  bool keeps_past() const { return keeps_past_; }

  /// Sets A: the columns of the belief, and those of walk and drift in `duration` [s], which are
  /// taken as done at the beginning.
  void spread(const FilterBelief& belief, double duration);
  /// Flight of the point z and of the columns A from the belief's time to t.
  void fly(double t, const Eigen::VectorXd& z, const FilterBelief& belief,
           bool second_order = true);
  /// After fly(): a deviation of (x, c) before the flight becomes `dx`, that of x after it.
  void carry(const Eigen::Ref<const Eigen::VectorXd>& dz);
  /// After fly(): gap, or force, of a contact, what it sees of each column, and its rounding.
  void look(int contact, bool of_force, double t);

  /// Potter's update of X, T and of the mean (x, c) by the row phi. Considered parameters stay.
  void measure(double residual, double noise, Eigen::VectorXd& mean_x, Eigen::VectorXd& mean_c);
  /// Moves the mean by `shift` times the gain, the columns' product with `row`, and takes `share`
  /// of it off the columns along that.
  void update_along(const Eigen::VectorXd& row, double shift, double share, Eigen::VectorXd& mean_x,
                    Eigen::VectorXd& mean_c);

  Eigen::MatrixXd A;                    ///< columns of (x, c) before the flight
  Eigen::VectorXd x;                    ///< the point after it
  Eigen::MatrixXd X, T;                 ///< columns of x and of c
  Eigen::MatrixXd past;                 ///< columns of xi, where it is kept
  Eigen::VectorXd past_mean;            ///< and its mean
  Flight::Gap of;                       ///< gap or force
  Eigen::VectorXd phi, psi;             ///< its row, and that of its velocity, of each column
  Eigen::VectorXd of_g, of_velocity;    ///< gradients by x
  Eigen::VectorXd by_c, velocity_by_c;  ///< partial derivatives by c, P entries
  double noise = 0.0;                   ///< variance of its rounding
  Eigen::VectorXd dx;                   ///< of carry()

 private:
  Flight* flight_;
  const FilterModel* model_;
  bool considers_ = false, keeps_past_ = false;
  std::vector<Eigen::Index> flow_unknowns_;
  Eigen::VectorXd gain_, past_gain_;
};

}  // namespace sprag
