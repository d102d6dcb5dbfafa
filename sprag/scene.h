// A scene: one machine, where its master starts, where the replica starts, and how sure of it all
// the scene is.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/parameter_uncertainty.h"
#include "sprag/detail/mechanics/tolerance.h"
#include "sprag/model.h"

namespace sprag {

/// What of a machine may be wrong, for who looks for it (parameters/unknowns.h).
struct Adaptation {
  std::vector<std::string> free;  ///< keys of parameters; empty: all that events tell
  /// How far each may be off, as a share: one for all, or one each of `free`.
  Eigen::VectorXd within = Eigen::VectorXd::Constant(1, 0.2);
  /// Standard deviation of its random walk after a unit of time, as a share; likewise.
  Eigen::VectorXd walk = Eigen::VectorXd::Zero(1);

  bool walks() const { return (walk.array() > 0.0).any(); }
};

/// The shaken frame of a general system, against which its coordinates are measured: e(t) acts as
/// the force -M r e''(t), and moves supports on the ground by w_i^T r e(t).
struct ShakenFrame {
  Eigen::VectorXd influence;   ///< r, f entries: q = r where the ground moves by 1 and the machine
                               ///< keeps its shape
  Harmonic motion;             ///< e(t)
  std::size_t force = 0;       ///< the number of -M r e''(t) among the model's forces
  std::vector<int> on_ground;  ///< contacts whose motion is w_i^T r e(t), from 0
};

/// -M r e''(t).
Force frame_force(const Eigen::MatrixXd& M, const ShakenFrame& frame);

/// s(t) of a support on the ground, w having f entries.
Harmonic ground_motion(const Eigen::VectorXd& w, const ShakenFrame& frame);

struct Scene {
  std::string name;
  Model model;
  std::optional<Beam> beam;          ///< set when the scene has a [beam]
  std::vector<double> positions;     ///< x_c of a beam's contacts [m]; empty where there is no beam
  std::optional<ShakenFrame> frame;  ///< set when a [system] has an [excitation]
  State master;                      ///< start of the master, padded with zeros to f entries
  State replica;                     ///< start of the replica, padded with zeros to f entries
  Eigen::VectorXd uncertainty;       ///< of the replica's start, energies by coordinate or, where M
                                     ///< and K are not diagonal, by mode; empty: not given
  std::optional<State> sigma;        ///< in place of uncertainty: standard deviations of its start
  double drift = 0.0;                ///< energy by which the model departs, per unit of time
  double jitter = 0.0;               ///< standard deviation of event times [s]
  Tolerance tolerance;               ///< hard limits of what may be off; all 0: nothing is
  Adaptation adaptation;
  ParameterUncertainty parameters;   ///< how uncertain parameters are; empty: not given
  bool has_master = true;            ///< false: where the machine starts is not said
  bool release_penetration = false;  ///< master.penetration = "release"
  std::vector<std::string> remarks;  ///< of its reader, for people: a line each
};

}  // namespace sprag
