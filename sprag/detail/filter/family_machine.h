// The machines that the unknowns of a scene span, in coordinates y that they share: q = V y with
// the modes V of the nominal machine, V^T M V = 1. In them a machine is
//
//   y'' + C y' + K y = F(t) + D lambda,   g_i = w_i^T y + s_i(t) + c_i,
//
// with C, K and F times the inverse of the machine's own mass matrix in them, and D = M^-1 W.
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
  Eigen::MatrixXd C, K;               ///< n x n: M^-1 C, M^-1 K
  Eigen::MatrixXd W, D, CW, KW;       ///< n x m: W, M^-1 W, C^T W, K^T W
  Eigen::MatrixXd G;                  ///< W^T D, m x m
  Eigen::MatrixXd shares;             ///< m x R: motions of the supports by e(t) of each record
  Eigen::VectorXd clearance;
  Eigen::VectorXd restitution;  ///< of the slowest impacts; scene.model has those of the faster
  double clock_scale = 1.0;     ///< speeds in the machine's own time over those of the events' time
  Eigen::MatrixXd recorded_forces;   ///< n x R: F by a(t) of each record
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
  FamilyOfMachines(const Scene& scene, std::vector<Parameter> unknowns);

  const Scene& scene() const { return values_.nominal(); }
  const std::vector<Parameter>& unknowns() const { return values_.unknowns(); }
  const std::vector<RecordedInput>& records() const { return values_.records(); }
  Eigen::Index n() const { return V_.rows(); }
  int contacts() const { return static_cast<int>(scene().model.contacts.size()); }
  const Eigen::MatrixXd& V() const { return V_; }
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
  void divide_by_mass(Eigen::Ref<Eigen::MatrixXd> columns) const;
  bool resonates() const;

  SceneValues values_;
  std::vector<HarmonicGroup> groups_;  // of one frequency each
  Eigen::MatrixXd V_, V_transposed_;
  Eigen::MatrixXd C_, K_;  // of the nominal machine
  bool uncoupled_ = false;
  std::vector<bool> changes_flow_;
  FamilyMachine nominal_;
  Eigen::MatrixXd identity_;
  Eigen::MatrixXd change_, product_, M_, directions_;  // scratch; directions: n x forces
};

}  // namespace sprag
