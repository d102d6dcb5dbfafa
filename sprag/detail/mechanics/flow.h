// Exact flow of the machine while a set L of contacts is locked (gamma_L = 0, g_L constant):
//
//   M u' + C u + K q = W_L lambda + f(t),   w_i^T q + s_i(t) + c_i = g_i for i in L,
//
// eqs. (2), (4) of Baumann & Leine 2014 with a constant set L. On null(W_L^T) the motion is a bank
// of scalar oscillators z. q, u, and with them every gap, gap velocity and contact force, are
// linear in (z, z', 1). The bank starts with one undamped oscillator for each frequency of the
// excitation; the entries of sampled inputs (sampled_inputs.h) and the modes follow. A mode is
// described relative to its steady response to the harmonics, or is driven by them where that
// response is much larger than the motion (drives.h), and relative to its response to the inputs.
// The empty set L is free flight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/drives.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/oscillators.h"
#include "sprag/detail/mechanics/sampled_inputs.h"

namespace sprag {

class Dynamics;
class Flow;
struct Functional;

/// phi = constant + held . g_L + sum over oscillators of p z + r z'.
struct Signal {
  Eigen::ArrayXd p, r;
  double constant = 0.0;
  Eigen::VectorXd held;
};

/// The complete changing state of a motion on a flow. Copies between objects of one model do not
/// allocate once both have been used.
struct Motion {
  const Flow* flow = nullptr;
  Instant t;
  OscillatorState x;
  Eigen::ArrayXd alpha;  ///< per oscillator: constant acceleration
  Eigen::VectorXd held;  ///< m entries; the first are g_i of the locked contacts, by ascending i
};

enum class FlowPath {
  diagonal,  ///< M, C, K diagonal: the coordinates are the modes
  modal,     ///< one transformation diagonalizes M, C and K
  dense      ///< complex modes, since C couples the real ones
};

/// "diagonal", "modal" or "dense".
constexpr const char* name(FlowPath path) {
  switch (path) {
    case FlowPath::diagonal:
      return "diagonal";
    case FlowPath::modal:
      return "modal";
    default:
      return "dense";
  }
}

class Flow {
 public:
  /// Throws ModelError: linearly dependent directions in L, defective modes.
  Flow(const Dynamics& dynamics, ContactSet locked);

  ContactSet locked() const { return locked_; }
  /// Contacts outside L whose directions depend linearly on those of L.
  ContactSet tied() const { return tied_; }
  FlowPath path() const { return path_; }
  /// Number of oscillators, the same for all flows of a model: frequencies, modes, then unused
  /// ones.
  Eigen::Index size() const { return oscillators_.size(); }
  /// Number of prescribed oscillators at the front, which follow from the time alone: harmonics()
  /// of the excitation's frequencies, then the entries of sampled inputs.
  Eigen::Index frequencies() const { return nf_; }
  Eigen::Index harmonics() const { return nh_; }
  Eigen::Index modes() const { return modes_; }
  const Oscillators& oscillators() const { return oscillators_; }
  const Drives& drives() const { return drives_; }
  /// The modes' response to sampled inputs; null: the model has none.
  const SampledResponse* sampled() const { return sampled_.get(); }
  /// Takes new samples of a streamed input. Does not allocate.
  void follow_input() {
    if (sampled_) sampled_->follow();
  }
  /// Whether some alpha is not zero with all held gaps zero, that is, a constant force acts.
  bool pushed() const { return (alpha0_ != 0.0).any(); }

  /// Puts `motion` on this flow at (q, u, t), f entries each. The locked contacts keep the gaps
  /// `held`, one entry for each contact of L.
  void enter(const Eigen::Ref<const Eigen::VectorXd>& q, const Eigen::Ref<const Eigen::VectorXd>& u,
             Instant t, const Eigen::Ref<const Eigen::VectorXd>& held, Motion& motion) const;

  /// Moves from `from` to the instant t >= from.t; `to` may be the same object.
  void propagate(const Motion& from, Instant t, Motion& to) const;

  /// Computes oscillators first..first+count-1, which must be modes, at tau after `from` and writes
  /// them into x. tau may be negative.
  void move_modes(const Motion& from, double tau, Eigen::Index first, Eigen::Index count,
                  OscillatorState& x) const;

  /// The prescribed oscillators at t, written into the first frequencies() entries of x.
  void set_phases(Instant t, OscillatorState& x) const {
    set_harmonics(t, x);
    if (sampled_) sampled_->set(t, x);
  }
  /// The first harmonics() of them alone.
  void set_harmonics(Instant t, OscillatorState& x) const;

  /// q and u of a motion on this flow, f entries each.
  void state(const Motion& motion, Eigen::Ref<Eigen::VectorXd> q,
             Eigen::Ref<Eigen::VectorXd> u) const;

  /// Maps differences between motions on this flow with the same held gaps, one per column: from q
  /// and u (f rows each) to z and z' (modes() rows each), and back. The first map projects, in the
  /// metric of M, the part that violates the locked contacts. Neither allocates.
  void enter_differences(const Eigen::Ref<const Eigen::MatrixXd>& q,
                         const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Ref<Eigen::MatrixXd> z,
                         Eigen::Ref<Eigen::MatrixXd> v) const;
  void state_differences(const Eigen::Ref<const Eigen::MatrixXd>& z,
                         const Eigen::Ref<const Eigen::MatrixXd>& v, Eigen::Ref<Eigen::MatrixXd> q,
                         Eigen::Ref<Eigen::MatrixXd> u) const;

  /// Applies the impulse Lambda at a contact to a motion on this flow. Requires accepts_kicks().
  /// The sum of all kicks must leave gamma_L unchanged.
  void kick(int contact, double Lambda, Motion& motion) const;
  bool accepts_kicks() const { return path_ != FlowPath::dense; }

  /// g_i, gamma_i for i outside L (for i in L they are `held` and 0), lambda_i for i in L.
  const Signal& gap(int contact) const { return gap_[static_cast<std::size_t>(contact)]; }
  const Signal& gap_velocity(int contact) const {
    return gap_velocity_[static_cast<std::size_t>(contact)];
  }
  const Signal& force(int contact) const { return force_[static_cast<std::size_t>(contact)]; }

  Signal signal(const Functional& functional) const;

  /// Moves q, f entries, by a static deflection of least elastic energy, so that these contacts of
  /// L have g = 0 at t. enter() alone would project the violation in the metric of M, which puts it
  /// into the highest modes.
  void close_gaps(ContactSet contacts, Instant t, Eigen::VectorXd& q) const;
  /// close_gaps() of all of L, then enter() with held gaps of zero.
  void enter_closed(Eigen::VectorXd& q, const Eigen::Ref<const Eigen::VectorXd>& u, Instant t,
                    Motion& motion) const;
  /// close_gaps() of L for differences of q, one per column.
  void close_gap_differences(Eigen::Ref<Eigen::MatrixXd> q) const;

 private:
  class Builder;

  const Dynamics* dynamics_;
  ContactSet locked_;
  ContactSet tied_ = 0;
  FlowPath path_ = FlowPath::diagonal;
  Eigen::Index nh_ = 0;
  Eigen::Index nf_ = 0;
  Eigen::Index modes_ = 0;
  Oscillators oscillators_;
  Drives drives_;

  // Dependence of a vector on the excitation: constant + held g_L + cos z_f + sin z_f', where z_f
  // are the prescribed oscillators.
  struct Forced {
    Eigen::VectorXd constant;
    Eigen::MatrixXd held, cos, sin;
  };

  // q = q_forced + Phi z + Psi z', u = u_forced + Phi z' + Psi (-kappa z - 2 delta z'), where
  // u_forced includes Psi (alpha + F) of constant forces and drives. z = enter_zq q + enter_zu u -
  // z_forced, and z' likewise. On the diagonal path Phi and enter_zq = enter_vu are the identity.
  // Psi, enter_zu and enter_vq are zero except on the dense path. Matrices that are zero or the
  // identity are not set.
  Forced q_forced_, u_forced_, z_forced_, v_forced_;
  Eigen::MatrixXd Phi_, Psi_;
  Eigen::MatrixXd enter_zq_, enter_zu_, enter_vq_, enter_vu_;
  Eigen::ArrayXd alpha0_;
  Eigen::MatrixXd alpha_held_;
  Eigen::MatrixXd kick_;           // modes x m
  Eigen::MatrixXd static_shapes_;  // f x L: each opens one contact of L by 1 and no other

  std::vector<Signal> gap_, gap_velocity_, force_;
  std::unique_ptr<SampledResponse> sampled_;
};

/// Value of a signal, and its first two time derivatives, at a point of the motion's flow.
double value(const Signal& signal, const Motion& motion);
double rate(const Signal& signal, const Motion& motion);
double second_rate(const Signal& signal, const Motion& motion);

/// Sum of the absolute terms of a signal, which scales its rounding error.
double largest_terms(const Signal& signal, const Motion& motion);

}  // namespace sprag
