// What a belief was some time ago: mean and columns of a motion without events, exactly, and what a
// signal of it (a gap, a contact force) and its rate were then. With x = m + S xi the value of the
// signal is value() + phi . xi, and its rate is rate() + psi . xi.
#pragma once

#include <Eigen/Core>

#include "sprag/estimation/belief.h"
#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/flows.h"

namespace sprag {

class Retrodiction {
 public:
  /// For beliefs of up to `columns` columns.
  Retrodiction(const Flows& flows, Eigen::Index columns);

  /// Of a belief at the motion's time, whose mean the motion is; `signal` is one of its flow's.
  /// Both must outlive what is asked.
  void begin(const Signal& signal, const Motion& motion, const Belief& belief);
  const Flow& flow() const { return *motion_->flow; }
  const Motion& motion() const { return *motion_; }
  const Signal& signal() const { return *signal_; }
  /// The largest angular frequency of the flow, 0 where it has no mode.
  double fastest() const { return fastest_; }
  /// Whether tau, where it is negative, does not make what has decayed since grow back further
  /// than there is anything left of it.
  bool reaches(double tau) const;

  /// Goes to `age` before the motion, which may be negative: what was if nothing has happened
  /// since.
  void go_back(double age);
  /// The signal of the mean alone; mean() is then that of the age.
  double value_at(double age);
  const Motion& mean() const { return then_; }
  double value() const { return sprag::value(*signal_, then_); }
  double rate() const { return sprag::rate(*signal_, then_); }
  auto phi() const { return phi_.head(columns_); }
  auto psi() const { return psi_.head(columns_); }

  /// Where xi is this, not 0: mean() is then that of the age.
  void set_xi(const Eigen::Ref<const Eigen::VectorXd>& xi);
  /// The same at the motion's own time; after set_xi().
  void return_to_motion();

  /// S where the machine has been on the flow `after` since `age`, behind an impact that changed u
  /// by `impact_u` times `kick` times the rate of the signal, as go_back(age) has left it; the
  /// first columns of S_q and S_u.
  void change_flow(const Flow& after, double age, double kick, const Eigen::VectorXd& impact_u,
                   Eigen::MatrixXd& S_q, Eigen::MatrixXd& S_u);

  /// What differences of the flow's modes become in tau, which may be negative.
  void move(double tau, const Eigen::Ref<const Eigen::VectorXd>& z,
            const Eigen::Ref<const Eigen::VectorXd>& v, Eigen::Ref<Eigen::VectorXd> moved_z,
            Eigen::Ref<Eigen::VectorXd> moved_v);

 private:
  template <typename Move>
  static void for_each_tau(const Flow& flow, double growth, double tau, const Move& move);
  void set_kernels(const Flow& flow, double growth, double tau);

  const Motion* motion_ = nullptr;
  const Signal* signal_ = nullptr;
  double fastest_ = 0.0, growth_ = 0.0;
  Eigen::Index columns_ = 0;
  Eigen::MatrixXd Z_, V_;  // S in the flow's oscillators
  Eigen::MatrixXd moved_Z_, moved_V_;

  Motion then_;
  // What z = 1 and v = 1 become on the way.
  OscillatorKernels kernels_;
  Eigen::VectorXd row_z_, row_v_, phi_, psi_, off_z_, off_v_;
};

}  // namespace sprag
