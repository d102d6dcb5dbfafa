// Drawing of a scene's machine: its shape as heights at fixed places across the picture, and its
// stops as heights that the shape must not pass. A beam is drawn as its deflection along its
// length. A general system is drawn by its nodes, if its outputs name at least two displacements,
// or one and it has more coordinates than a chain shows well: a node for each such output and for
// each contact at none of them. Rotations of a finite-element model then share no axis with
// displacements. Any other system is drawn as a chain of its coordinates.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag::view {

struct DrawnStop {
  double across = 0.0;  ///< place of the stop, on the scale of `places`
  /// Side of the shape on which a stop with a height lies: -1 below, +1 above.
  int side = -1;
  /// Second place of a contact between two coordinates, which has no height.
  std::optional<double> other;
  bool has_height = true;
};

/// The longest period of a machine's excitation; without one, of its undamped vibration [s].
/// Nullopt if nothing vibrates.
std::optional<double> longest_period(const Model& model);

class DrawnMachine {
 public:
  explicit DrawnMachine(const Scene& scene);

  enum class Kind { beam, nodes, chain };

  Kind kind() const { return kind_; }
  bool is_beam() const { return kind_ == Kind::beam; }
  /// Beam: x [m], from 0 to its length. Else the numbers of nodes or coordinates, from 1.
  const std::vector<double>& places() const { return places_; }
  /// Names of the places; empty for a beam.
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<DrawnStop>& stops() const { return stops_; }

  /// Height of the ground motion e(t), which is added to all heights. A beam with a moving support
  /// is drawn relative to the ground, any other beam relative to its frame. 0 for a chain.
  double base(double t) const;
  /// Heights of the shape at the places, base included. q may be shorter than f; missing entries
  /// count as zero.
  std::vector<double> shape(const Eigen::VectorXd& q, double t) const;
  /// Standard deviations of the heights. The errors of the coordinates are taken as independent,
  /// since messages carry no covariances.
  std::vector<double> sigma(const Eigen::VectorXd& sigma_q) const;
  /// Height of a stop, at which the gap is 0; only for stops with a height.
  double stop(std::size_t contact, double t) const;

 private:
  void draw_nodes(const Scene& scene);
  void draw_chain(const Scene& scene);

  Kind kind_ = Kind::chain;
  Eigen::MatrixXd shapes_;  // places x f
  std::vector<double> places_;
  std::vector<std::string> names_;
  std::vector<DrawnStop> stops_;
  std::vector<Contact> contacts_;
  std::vector<double> weight_;  // derivative of a gap with respect to the height of the shape
  Harmonic base_;
};

}  // namespace sprag::view
