// One run of an adaptive observer beside a replica with the same scene, which is wrong about the
// machine that both listen to.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag::adaptation_study {

/// What a machine does to one of its parameters: by this share over the whole run, evenly.
struct Move {
  std::string key;
  double share = 0.0;
};

struct Trial {
  double off = 0.1;  ///< each parameter of the scene is wrong by (0.5 ... 1) of it, signs random;
                     ///< phases by as many radians, clearances by as much of the amplitude
  std::string only = {};  ///< the key of the only one that is, by all of `off`; empty: all are
  double lost = 0.0, spurious = 0.0;  ///< shares of the events
  double jitter = 0.0;                ///< [s], told
  double walk = 0.0;                  ///< told
  std::vector<Move> moves = {};       ///< of the machine
  double duration = 120.0;            ///< [s]
  double tick = 0.01;                 ///< [s]
};

struct Tick {
  double t = 0.0;
  double V = 0.0;                        ///< of the adaptive estimate, against the machine
  double V_replica = 0.0, V_both = 0.0;  ///< of others with the same scene
  double energy = 0.0;  ///< expected of the error by the deviations that are published
  bool of_filter = false;
};

/// The upper one of two in the middle; 0 of none.
double median(std::vector<double> values);

struct Outcome {
  std::vector<Tick> ticks;
  std::vector<double> events;    ///< times that were heard [s]
  std::vector<double> accepted;  ///< since when parameters counted, each time [s]
  std::int64_t identifications = 0;
  std::int64_t inconsistencies = 0;
  double longest_identification = 0.0;  ///< CPU [s]
  Eigen::VectorXd truth;                ///< of the parameters at the end
  Eigen::VectorXd values, sigmas;       ///< at the end

  /// Median over ticks from t on of V, or of another's.
  double floor(double from, double Tick::*of = &Tick::V) const;
  /// Share of the ticks where V is more than `factor` times the replica's.
  double worse_than_replica(double factor) const;
};

/// The machine is the scene's own.
Outcome run(const Scene& machine, const Trial& trial, std::uint64_t seed);

}  // namespace sprag::adaptation_study
