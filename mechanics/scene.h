// A scene file (TOML): one machine, where its master starts and where the replica starts.
// Either a beam, eqs. (19)-(22) of Baumann & Leine 2014, or a general linear [system].
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "mechanics/beam.h"
#include "mechanics/model.h"

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

/// what() reads "file:line:column: key is value; must be ..." (line and column where known).
struct SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Reads and checks a scene file. Throws SceneError.
Scene read_scene(const std::filesystem::path& file);

/// The same from text; `file` is the name that errors carry. Throws SceneError.
Scene parse_scene(std::string_view text, const std::string& file);

}  // namespace sprag
