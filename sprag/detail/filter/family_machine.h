// The machines that the unknowns of a scene span, in coordinates y that they share: q = V y with
// the modes V of the nominal machine, V^T M V = 1. In them a machine is
//
//   y'' + C y' + K y = F(t) + W lambda,   g_i = w_i^T y + s_i(t) + c_i.
//
// t is the time of the events by the nominal contact clock. With another rate or offset of the
// clock the machine runs at another speed in t.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/parameters/scene_with.h"
#include "sprag/scene.h"

namespace sprag {

/// One machine of the family: n coordinates, m contacts, H harmonics.
struct FamilyMachine {
  Scene scene;                        ///< with the machine's values, except for its records
  std::vector<GainAndDelay> records;  ///< gain and delay of each record
  Eigen::MatrixXd C, K;               ///< n x n
  Eigen::MatrixXd W, CW, KW;          ///< n x m: W, C^T W, K W
  Eigen::MatrixXd G;                  ///< W^T W, m x m
  Eigen::VectorXd clearance;
  Eigen::VectorXd restitution;  ///< of the slowest impacts; scene.model has those of the faster
  double clock_scale = 1.0;     ///< speeds in the machine's own time over those of the events' time
  Eigen::VectorXd constant_force;    ///< n entries
  Eigen::VectorXd frequencies;       ///< H entries [rad per unit of time]
  Eigen::MatrixXcd forces, motions;  ///< n x H and m x H: F and s are Re(forces e^(i Omega t))
  Eigen::MatrixXcd response;         ///< n x H: steady y, if the family is uncoupled

  /// Whether free and held motions of both machines are the same functions of their start.
  bool moves_like(const FamilyMachine& other) const;
};

class FamilyOfMachines {
 public:
  /// Throws ModelError if M is not positive definite.
  FamilyOfMachines(const Scene& scene, std::vector<Unknown> unknowns);

  const Scene& scene() const { return values_.nominal(); }
  const std::vector<Unknown>& unknowns() const { return values_.unknowns(); }
  const std::vector<RecordedInput>& records() const { return values_.records(); }
  Eigen::Index n() const { return V_.rows(); }
  int contacts() const { return static_cast<int>(scene().model.contacts.size()); }
  const Eigen::MatrixXd& V() const { return V_; }
  /// Forces n x R by a(t), and motions of the supports m x R by e(t), of each record.
  const Eigen::MatrixXd& recorded_forces() const { return recorded_forces_; }
  const Eigen::MatrixXd& shares() const { return shares_; }
  /// Whether C and K of all machines are diagonal, and no mode is in resonance with a harmonic.
  bool uncoupled() const { return uncoupled_; }
  /// Whether C or K depends on unknown number k.
  bool changes_flow(Eigen::Index k) const { return changes_flow_[static_cast<std::size_t>(k)]; }

  const FamilyMachine& nominal() const { return nominal_; }
  /// Sets the machine with these values of the unknowns, in place. `like`: a machine whose contacts
  /// are probably at the same positions. Does not allocate.
  void set(const Eigen::VectorXd& values, const FamilyMachine& like, FamilyMachine& machine);

 private:
  void to_modes(const Eigen::MatrixXd& nominal, const Eigen::MatrixXd& of_nominal,
                const Eigen::MatrixXd& of, Eigen::MatrixXd& in_modes);
  bool resonates() const;

  SceneValues values_;
  Eigen::MatrixXd V_, V_transposed_;
  Eigen::MatrixXd C_, K_;       // of the nominal machine
  Eigen::MatrixXd directions_;  // n x forces: V^T d_j
  Eigen::MatrixXd recorded_forces_, shares_;
  bool uncoupled_ = false;
  std::vector<bool> changes_flow_;
  FamilyMachine nominal_;
  Eigen::MatrixXd change_, product_;  // scratch
};

}  // namespace sprag
