// A scene: one machine, where its master starts, where the replica starts, and how sure of it all
// the scene is.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sprag/mechanics/beam.h"
#include "sprag/mechanics/model.h"

namespace sprag {

struct Scene {
  std::string name;
  Model model;
  std::optional<Beam> beam;          ///< set when the scene has a [beam]
  std::vector<double> positions;     ///< x_c of a beam's contacts [m]; empty where there is no beam
  State master;                      ///< start of the master, padded with zeros to f entries
  State replica;                     ///< start of the replica, padded with zeros to f entries
  Eigen::VectorXd uncertainty;       ///< of the replica's start, energies by coordinate or, where M
                                     ///< and K are not diagonal, by mode; empty: not given
  double drift = 0.0;                ///< energy by which the model departs, per unit of time
  double jitter = 0.0;               ///< standard deviation of event times [s]
  bool release_penetration = false;  ///< master.penetration = "release"
};

}  // namespace sprag
