// Exact flow of the machine while a set L of contacts is locked (gamma_L = 0, g_L constant):
//
//   M u' + C u + K q = W_L lambda + f(t),   w_i^T q + s_i(t) + c_i = g_i for i in L,
//
// eqs. (2), (4) of Baumann & Leine 2014 with a constant set L. On null(W_L^T) the motion is a bank
// of scalar oscillators z; q and u, and with them every gap, gap velocity and contact force, are
// linear in (z, z', 1). The excitation's frequencies ride along as undamped oscillators in front of
// the modes; a mode moves about its steady response to them, or is driven by them where that is far
// beyond where it moves (drives.h). L = {} is free flight.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/drives.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/oscillators.h"

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

/// A point on a flow: everything that changes. Copies between objects of one model do not allocate
/// once both have been used.
struct Motion {
  const Flow* flow = nullptr;
  Instant t;
  OscillatorState x;
  Eigen::ArrayXd alpha;  ///< per oscillator: what pushes it for good
  Eigen::VectorXd held;  ///< m entries; the first are g_i of the locked contacts, by ascending i
};

enum class FlowPath {
  diagonal,  ///< M, C, K diagonal: the coordinates are the modes
  modal,     ///< one transformation diagonalizes M, C and K
  dense      ///< complex modes: C couples the real ones
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
  /// Contacts outside L whose directions depend on those of L: L moves them.
  ContactSet tied() const { return tied_; }
  FlowPath path() const { return path_; }
  /// Oscillators, the same for all flows of a model: frequencies, modes, then idle ones.
  Eigen::Index size() const { return oscillators_.size(); }
  Eigen::Index frequencies() const { return nf_; }
  Eigen::Index modes() const { return modes_; }
  const Oscillators& oscillators() const { return oscillators_; }
  const Drives& drives() const { return drives_; }
  /// Whether a constant force acts where all held gaps are zero: some alpha is not zero.
  bool pushed() const { return (alpha0_ != 0.0).any(); }

  /// Puts `motion` on this flow at (q, u, t), f entries each. The locked contacts keep the gaps
  /// `held` (as many entries as L has contacts).
  void enter(const Eigen::Ref<const Eigen::VectorXd>& q, const Eigen::Ref<const Eigen::VectorXd>& u,
             Instant t, const Eigen::Ref<const Eigen::VectorXd>& held, Motion& motion) const;

  /// Moves from `from` to the instant t >= from.t; `to` may be the same object.
  void propagate(const Motion& from, Instant t, Motion& to) const;

  /// Oscillators first..first+count-1, which are modes, tau after `from`, or before it where tau is
  /// negative; written into x.
  void move_modes(const Motion& from, double tau, Eigen::Index first, Eigen::Index count,
                  OscillatorState& x) const;

  /// The excitation's oscillators at t, written into the first frequencies() entries of x.
  void set_phases(Instant t, OscillatorState& x) const;

  /// q and u of a motion on this flow, f entries each.
  void state(const Motion& motion, Eigen::Ref<Eigen::VectorXd> q,
             Eigen::Ref<Eigen::VectorXd> u) const;

  /// Differences between motions on this flow that hold the same gaps, one a column: those of q and
  /// u, f rows each, to those of z and z', modes() rows each, and back. The first projects, in the
  /// metric of M, what does not fit the locked contacts. They do not allocate.
  void enter_differences(const Eigen::Ref<const Eigen::MatrixXd>& q,
                         const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Ref<Eigen::MatrixXd> z,
                         Eigen::Ref<Eigen::MatrixXd> v) const;
  void state_differences(const Eigen::Ref<const Eigen::MatrixXd>& z,
                         const Eigen::Ref<const Eigen::MatrixXd>& v, Eigen::Ref<Eigen::MatrixXd> q,
                         Eigen::Ref<Eigen::MatrixXd> u) const;

  /// Adds the impulse Lambda (one entry, contact i) to a motion on this flow. Only where
  /// accepts_kicks(); the sum of all kicks must leave gamma_L alone.
  void kick(int contact, double Lambda, Motion& motion) const;
  bool accepts_kicks() const { return path_ != FlowPath::dense; }

  /// g_i, gamma_i for i outside L (for i in L they are `held` and 0), lambda_i for i in L.
  const Signal& gap(int contact) const { return gap_[static_cast<std::size_t>(contact)]; }
  const Signal& gap_velocity(int contact) const {
    return gap_velocity_[static_cast<std::size_t>(contact)];
  }
  const Signal& force(int contact) const { return force_[static_cast<std::size_t>(contact)]; }

  Signal signal(const Functional& functional) const;

  /// Moves q, f entries, so that these contacts of L have g = 0 at t, by what takes the least
  /// elastic energy: a static deflection. Where q does not fit L, the metric of M, in which enter()
  /// projects, would put the misfit into the highest modes.
  void close_gaps(ContactSet contacts, Instant t, Eigen::VectorXd& q) const;
  /// enter() behind that of all of L, with held gaps of zero.
  void enter_closed(Eigen::VectorXd& q, const Eigen::Ref<const Eigen::VectorXd>& u, Instant t,
                    Motion& motion) const;
  /// The same for differences of q, one a column.
  void close_gap_differences(Eigen::Ref<Eigen::MatrixXd> q) const;

 private:
  class Builder;

  const Dynamics* dynamics_;
  ContactSet locked_;
  ContactSet tied_ = 0;
  FlowPath path_ = FlowPath::diagonal;
  Eigen::Index nf_ = 0;
  Eigen::Index modes_ = 0;
  Oscillators oscillators_;
  Drives drives_;

  // What follows the excitation, in a space of any dimension: constant + held g_L + cos z_f +
  // sin z_f', z_f the excitation's oscillators.
  struct Forced {
    Eigen::VectorXd constant;
    Eigen::MatrixXd held, cos, sin;
  };

  // q = q_forced + Phi z + Psi z', u = u_forced + Phi z' + Psi (-kappa z - 2 delta z'): constant
  // forces and drives leave Psi (alpha + F) in u_forced. z = enter_zq
  // q + enter_zu u - z_forced, z' likewise. Phi and enter_zq = enter_vu are the identity on the
  // diagonal path; Psi, enter_zu and enter_vq are zero but on the dense path, where all of them are
  // set.
  Forced q_forced_, u_forced_, z_forced_, v_forced_;
  Eigen::MatrixXd Phi_, Psi_;
  Eigen::MatrixXd enter_zq_, enter_zu_, enter_vq_, enter_vu_;
  Eigen::ArrayXd alpha0_;
  Eigen::MatrixXd alpha_held_;
  Eigen::MatrixXd kick_;           // modes x m
  Eigen::MatrixXd static_shapes_;  // f x L: each opens one contact of L by 1, and no other

  std::vector<Signal> gap_, gap_velocity_, force_;
};

/// Value of a signal, and its first two time derivatives, at a point of the motion's flow.
double value(const Signal& signal, const Motion& motion);
double rate(const Signal& signal, const Motion& motion);
double second_rate(const Signal& signal, const Motion& motion);

/// Sum of the absolute terms of a signal: its roundings are in proportion.
double largest_terms(const Signal& signal, const Motion& motion);

}  // namespace sprag
