// One run of an adaptive observer and of a replica with the same scene, whose parameters differ
// from those of the machine that both observe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag::adaptation_study {

/// Change of one parameter of the machine: by this share, evenly over the whole run.
struct Move {
  std::string key;
  double share = 0.0;
};

struct Trial {
  double off = 0.1;  ///< each parameter of the scene is wrong by (0.5 ... 1) of it, with random
                     ///< signs; phases by as many radians, clearances by as much of the amplitude
  std::string only = {};  ///< key of the only wrong parameter, wrong by all of `off`; empty: all
  double lost = 0.0, spurious = 0.0;  ///< shares of the events
  double jitter = 0.0;                ///< [s], specified to the observer
  double walk = 0.0;                  ///< specified to the observer
  std::vector<Move> moves = {};       ///< of the machine
  double duration = 120.0;            ///< [s]
  double tick = 0.01;                 ///< [s]
};

struct Tick {
  double t = 0.0;
  double V = 0.0;                        ///< of the adaptive estimate, against the machine
  double V_replica = 0.0, V_both = 0.0;  ///< of the other estimators with the same scene
  double energy = 0.0;                   ///< expected energy of the error by the published sigmas
  bool of_filter = false;
};

/// The upper of the two middle values for an even count; 0 without values.
double median(std::vector<double> values);

struct Outcome {
  std::vector<Tick> ticks;
  std::vector<double> events;    ///< reported times [s]
  std::vector<double> accepted;  ///< times at which identified parameters were accepted [s]
  std::int64_t identifications = 0;
  std::int64_t inconsistencies = 0;
  double longest_identification = 0.0;  ///< CPU [s]
  Eigen::VectorXd truth;                ///< of the parameters at the end
  Eigen::VectorXd values, sigmas;       ///< at the end

  /// Median over ticks from `from` on of V, or of another estimator's V.
  double floor(double from, double Tick::*of = &Tick::V) const;
  /// Share of the ticks where V is more than `factor` times the replica's.
  double worse_than_replica(double factor) const;
};

/// The machine has the scene's own parameters.
Outcome run(const Scene& machine, const Trial& trial, std::uint64_t seed);

}  // namespace sprag::adaptation_study
