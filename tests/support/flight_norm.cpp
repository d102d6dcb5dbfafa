#include "tests/support/flight_norm.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/energy.h"

namespace sprag {

FlightNorm::FlightNorm(const Flows& flows) : free_(&flows[0]) {
  const NaturalModes modes = natural_modes(flows.dynamics().model());
  omega_ = modes.stiffness.cwiseQuotient(modes.mass).cwiseSqrt();
  inverse_ = (omega_.array() > 0.0).select(1.0 / omega_.array(), 0.0);
  const Eigen::VectorXd root = modes.mass.cwiseSqrt();
  to_q_ = modes.Phi * root.cwiseInverse().asDiagonal();
  from_q_ = root.asDiagonal() * inverse(modes.Phi);
}

double FlightNorm::square(double tau) const {
  const Eigen::Index f = omega_.size();
  Eigen::MatrixXd flight(2 * f, 2 * f);
  Motion motion;
  Eigen::VectorXd q(f), u(f);
  const auto land = [&](const Eigen::VectorXd& x) {
    free_->enter(to_q_ * inverse_.asDiagonal() * x.head(f), to_q_ * x.tail(f), at(0.0),
                 Eigen::VectorXd(), motion);
    free_->propagate(motion, at(tau), motion);
    free_->state(motion, q, u);
    Eigen::VectorXd y(2 * f);
    y << omega_.asDiagonal() * from_q_ * q, from_q_ * u;
    return y;
  };
  // The motion from zero is the contribution of the forces.
  const Eigen::VectorXd forced = land(Eigen::VectorXd::Zero(2 * f));
  for (Eigen::Index j = 0; j < 2 * f; ++j) {
    flight.col(j) = land(Eigen::VectorXd::Unit(2 * f, j)) - forced;
  }
  return std::min(1.0, std::pow(singular_values(flight).values[0], 2));
}

}  // namespace sprag
