#include "sprag/detail/bound/half_width.h"

#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

HalfWidths::HalfWidths(const EnergyMetric& metric) {
  const Model& model = metric.dynamics().model();
  const Eigen::Index f = metric.coordinates();
  // c^T q = (Phi^T c)^T z.
  const auto displacement = [&](const Eigen::VectorXd& c) {
    const Eigen::VectorXd of_modes = metric.from_modes().transpose() * c;
    double sum = 0.0;
    for (Eigen::Index i = 0; i < f; ++i) {
      const double omega = metric.omega()[i];
      if (omega > 0.0) {
        sum += square(of_modes[i] / omega);
      } else if (std::abs(of_modes[i]) > share_of_rounding * of_modes.norm()) {
        return infinity;
      }
    }
    return std::sqrt(2.0 * sum);
  };
  const auto velocity = [&](const Eigen::VectorXd& c) {
    return std::sqrt(2.0) * (metric.from_modes().transpose() * c).norm();
  };
  q_.resize(f);
  u_.resize(f);
  for (Eigen::Index i = 0; i < f; ++i) {
    q_[i] = displacement(Eigen::VectorXd::Unit(f, i));
    u_[i] = velocity(Eigen::VectorXd::Unit(f, i));
  }
  gaps_.resize(metric.dynamics().contacts());
  for (Eigen::Index i = 0; i < gaps_.size(); ++i) {
    gaps_[i] = displacement(metric.dynamics().W().col(i));
  }
  outputs_.resize(static_cast<Eigen::Index>(model.outputs.size()));
  for (Eigen::Index i = 0; i < outputs_.size(); ++i) {
    const Output& output = model.outputs[static_cast<std::size_t>(i)];
    outputs_[i] = output.velocity ? velocity(output.direction) : displacement(output.direction);
  }
}

double half_width(double factor, double bound) {
  if (factor == 0.0) return 0.0;
  return std::isfinite(factor) && std::isfinite(bound) ? factor * std::sqrt(bound) : infinity;
}

}  // namespace sprag
