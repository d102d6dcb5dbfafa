// Replica by Moreau-Jean time stepping, theta = 1/2: the standard method, for comparison with the
// exact replica. With x_theta = theta x_(k+1) + (1 - theta) x_k:
//
//   M (u_(k+1) - u_k) = h (f_theta - C u_theta - K q_theta) + W P,   q_(k+1) = q_k + h u_theta,
//
// and the impact law of the closed contacts between gamma_k and gamma_(k+1) with G = W^T (M + h
// theta C + h^2 theta^2 K)^-1 W. An event acts in the tick that contains it. First order in h
// across impacts. Source: J. J. Moreau, Comput. Methods Appl. Mech. Eng. 177 (1999); M. Jean, ibid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/scene.h"

namespace sprag {

struct MoreauState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  Eigen::VectorXd q, u;
  std::int64_t refused_impacts = 0;  ///< impacts whose contacts' directions are linearly dependent
};

class MoreauReplica {
 public:
  using State = MoreauState;

  /// Tick h > 0. Throws ModelError.
  MoreauReplica(Model model, double h);
  MoreauReplica(const Scene& scene, double h) : MoreauReplica(scene.model, h) {}

  /// Puts the replica at (q, u) with chi at tick k.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, MoreauState& state);

  /// Moves to the next tick; `events` are those after the present tick, up to and including the
  /// next. Does not allocate.
  void tick(std::span<const ContactEvent> events, MoreauState& state);

  /// Applies events of the present instant without moving: only chi changes, the impulse belongs to
  /// the next tick.
  void apply(std::span<const ContactEvent> events, MoreauState& state);

  /// q and u at the present tick, f entries each.
  void output(const MoreauState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  /// Reports only the number of refused impacts; `initial` is not used.
  Confidence no_confidence() const { return {}; }
  void note(const MoreauState& state, Confidence& confidence) const;

  double h() const { return h_; }

 private:
  void add_force(double t, double weight);

  Dynamics dynamics_;
  double h_;
  Eigen::VectorXd mass_hat_;     // diagonal of M + h theta C + h^2 theta^2 K, if that is diagonal
  Eigen::MatrixXd inverse_hat_;  // else its inverse
  Eigen::MatrixXd minv_hat_W_;
  Eigen::MatrixXd G_hat_;
  Eigen::VectorXd force_, u_new_, product_;  // scratch
};

}  // namespace sprag
