#include "sprag/detail/bound/flight_contraction.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

FlightContraction::FlightContraction(const Flows& flows, double damping_factor) {
  const Flow& free = flows[0];
  is_dense_ = free.path() == FlowPath::dense;
  frequencies_ = free.frequencies();
  modes_ = free.modes();
  if (is_dense_) {
    if (damping_factor == 1.0) {
      dense_ = ContractionTable(flows.dynamics().model());
    } else {
      Model model = flows.dynamics().model();
      model.C *= damping_factor;
      dense_ = ContractionTable(model);
    }
    damping_ = dense_.damping();
  } else if (modes_ > 0) {
    const Oscillators& of_free = free.oscillators();
    oscillators_ = Oscillators(damping_factor * of_free.delta(), of_free.kappa());
    damping_ = 2.0 * oscillators_.delta().maxCoeff();
    // Rigid motions as in energy.h, where they have no potential energy.
    const double noise =
        free.path() == FlowPath::modal ? static_cast<double>(modes_) * machine_epsilon : 0.0;
    rigid_ = std::sqrt(noise) * oscillators_.root_kappa().segment(frequencies_, modes_).maxCoeff();
  }
  kernels_.resize(free.size());
  known_.fill(-1.0);
}

double FlightContraction::square(double tau) {
  if (is_dense_) return std::min(1.0, sprag::square(dense_(tau)) + state_share_of_rounding);
  oscillators_.kernels(tau, frequencies_, modes_, kernels_);
  double largest = 0.0;
  for (Eigen::Index i = frequencies_; i < frequencies_ + modes_; ++i) {
    const double omega = oscillators_.root_kappa()[i];
    // In (omega z, v), whose length is the root of the energy; without stiffness in v alone.
    const bool rigid = omega <= rigid_;
    const double zz = rigid ? 0.0 : kernels_.zz[i];
    const double vz = rigid ? 0.0 : kernels_.vz[i] / omega;
    const double zv = kernels_.zv[i] * omega;
    const double vv = kernels_.vv[i];
    const double a = zz * zz + vz * vz;
    const double d = zv * zv + vv * vv;
    const double b = zz * zv + vz * vv;
    largest = std::max(largest, 0.5 * (a + d) + std::hypot(0.5 * (a - d), b));
  }
  return std::min(1.0, largest + state_share_of_rounding);
}

double FlightContraction::square_at_node(double tau) {
  if (is_dense_) return square(tau);
  int exponent = 0;
  const double mantissa = std::frexp(tau, &exponent);  // in [0.5, 1)
  if (tau == 0.0 || exponent < first_octave) return 1.0;
  const int octave = std::min(exponent - first_octave, octaves - 1);
  const int node = octave < exponent - first_octave
                       ? nodes_in_octave - 1
                       : static_cast<int>((mantissa - 0.5) * 2.0 * nodes_in_octave);
  double& known =
      known_[static_cast<std::size_t>(octave) * nodes_in_octave + static_cast<std::size_t>(node)];
  if (known < 0.0) {
    known = square(std::ldexp(0.5 + 0.5 * node / nodes_in_octave, octave + first_octave));
  }
  return known;
}

ToleratedContraction::ToleratedContraction(const Flows& flows, const Tolerance& tolerance)
    : time_factor_(std::sqrt(1.0 - tolerance.stiffness)) {
  const double low = (1.0 - tolerance.damping) / std::sqrt(1.0 + tolerance.stiffness);
  const double high = (1.0 + tolerance.damping) / std::sqrt(1.0 - tolerance.stiffness);
  if (!(high > low)) {
    nodes_.emplace_back(flows);
    return;
  }
  constexpr int nodes = 5;
  const double spacing = (high - low) / (nodes - 1);
  for (int i = 0; i < nodes; ++i) nodes_.emplace_back(flows, low + spacing * i);
  // The last node has the largest damping.
  margin_ = 0.5 * spacing * nodes_.back().damping() / high;
}

template <typename Square>
double ToleratedContraction::largest(double tau, Square&& square_of) {
  const double scaled = time_factor_ * tau;
  double square = 0.0;
  for (FlightContraction& node : nodes_) square = std::max(square, square_of(node, scaled));
  return std::min(1.0, std::sqrt(square) + margin_ * scaled);
}

double ToleratedContraction::operator()(double tau) {
  return largest(tau, [](FlightContraction& node, double of) { return node.square(of); });
}

double ToleratedContraction::at_node(double tau) {
  return largest(tau, [](FlightContraction& node, double of) { return node.square_at_node(of); });
}

}  // namespace sprag
