#include "sprag/mechanics/scale.h"

#include <algorithm>
#include <cmath>

#include "sprag/mechanics/linear_algebra.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

double largest_row_sum(const Eigen::MatrixXd& A) { return A.cwiseAbs().rowwise().sum().maxCoeff(); }

// Time to the ground or back to it, at constant acceleration; zero where it is not known.
double flight(double gap, double velocity, double acceleration) {
  const double g = std::abs(gap);
  const double v = std::abs(velocity);
  const double a = std::abs(acceleration);
  if (a > 0.0) return (v + std::sqrt(v * v + 2.0 * a * g)) / a;
  return v > 0.0 ? g / v : 0.0;
}

}  // namespace

double time_scale(const Model& model, const State& start) {
  constexpr double some_periods = 64.0;  // in radians
  const Eigen::MatrixXd M_inverse = inverse(model.M);
  // Upper bounds of the largest frequency squared and of the fastest decay.
  double fastest = std::sqrt(largest_row_sum(product(M_inverse, model.K)));
  fastest = std::max(fastest, largest_row_sum(product(M_inverse, model.C)));

  Eigen::VectorXd force = -(model.C * start.u) - model.K * start.q;
  const auto oscillates = [](const Harmonic& harmonic) { return harmonic.amplitude != 0.0; };
  for (const Force& f : model.forces) {
    force += f.direction * (f.constant + value(f.harmonic, 0.0));
    if (oscillates(f.harmonic)) fastest = std::max(fastest, f.harmonic.frequency);
  }
  const Eigen::VectorXd acceleration = M_inverse * force;
  double slowest = 0.0;
  for (const Contact& contact : model.contacts) {
    const Harmonic& s = contact.motion;
    if (oscillates(s)) fastest = std::max(fastest, s.frequency);
    slowest = std::max(
        slowest, flight(gap(contact, start.q, 0.0), gap_velocity(contact, start.u, 0.0),
                        contact.w.dot(acceleration) - s.frequency * s.frequency * value(s, 0.0)));
  }
  const double vibrates = fastest > 0.0 ? some_periods / fastest : infinity;
  return slowest > 0.0 ? std::min(vibrates, slowest) : vibrates;
}

void set_chatter_time(Model& model, const State& start) {
  constexpr double share = 1e-8;
  const double own = share * time_scale(model, start);
  if (own > 0.0 && std::isfinite(own)) model.chatter_time = own;
}

}  // namespace sprag
