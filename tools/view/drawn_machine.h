// How a scene's machine is drawn: its shape as heights at fixed places across the picture, and its
// stops as heights that the shape must not pass. A beam is its deflection along its length; a
// general system is a chain of its coordinates.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag::view {

struct DrawnStop {
  double across = 0.0;  ///< where it is, on the scale of `places`
  /// With a height: on which side of the shape it is, -1 below, +1 above.
  int side = -1;
  /// Between two places instead: a contact of two coordinates.
  std::optional<double> other;
  bool has_height = true;
};

class DrawnMachine {
 public:
  explicit DrawnMachine(const Scene& scene);

  bool is_beam() const { return beam_; }
  /// Beam: x [m], from 0 to its length. Chain: 1, 2, ..., f.
  const std::vector<double>& places() const { return places_; }
  const std::vector<DrawnStop>& stops() const { return stops_; }

  /// Height of the ground motion e(t) by which all is lifted: a beam is drawn against the ground
  /// where one of its supports stands there, else against its frame. 0 for a chain.
  double base(double t) const;
  /// Heights of the shape at the places, base included. q may be shorter than f: zeros are missing.
  std::vector<double> shape(const Eigen::VectorXd& q, double t) const;
  /// Their standard deviations, as if errors of coordinates were independent: messages carry no
  /// covariances.
  std::vector<double> sigma(const Eigen::VectorXd& sigma_q) const;
  /// Height of a stop, where the gap is 0; for one that has a height.
  double stop(std::size_t contact, double t) const;

 private:
  bool beam_;
  Eigen::MatrixXd shapes_;  // places x f
  std::vector<double> places_;
  std::vector<DrawnStop> stops_;
  std::vector<Contact> contacts_;
  std::vector<double> weight_;  // of a stop's height in its gap
  Harmonic base_;
};

}  // namespace sprag::view
