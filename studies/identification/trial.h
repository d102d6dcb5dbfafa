// One trial of identification: a machine, its events, and a scene with wrong parameters.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag::identification_study {

struct Trial {
  double off = 0.2;  ///< the machine differs in each nonlinear parameter by (0.5 ... 1) of it
  double machine_off = 0.0;  ///< the machine is off by up to it; its phase and clearance are random
  double damping_off = 0.0;  ///< of the damping, instead of `off`; 0: `off`
  int impacts = 100;
  double jitter = 0.0;                ///< [s]
  double lost = 0.0, spurious = 0.0;  ///< shares of the events
  bool jitter_given = true;
  std::vector<std::string> keys = {};  ///< keys of the unknowns; empty: all but the scale
  std::optional<double> within = {};   ///< specified to the identification; none: `off`
};

struct Outcome {
  bool too_few = false;
  Identification found;
  Eigen::VectorXd truth;          ///< of the unknowns, in their order
  double worst = 0.0;             ///< error in coordinates of the unknowns
  double worst_sigmas = 0.0;      ///< the same in claimed standard deviations
  int inside_95 = 0, values = 0;  ///< errors below 1.96 standard deviations
  double seconds = 0.0;           ///< of CPU
  int events_lost = 0, events_spurious = 0;

  bool accepted() const { return !too_few && found.fits(); }
  /// Accepted, and every value within 1e-9, or with jitter within 6 claimed standard deviations.
  bool right(const Trial& trial) const;
};

/// Default unknowns of a trial: all but the scale, and one restitution for all contacts.
std::vector<std::string> usual_keys(const Scene& scene);

/// Input of a trial: the events of a machine, and a scene with wrong parameters.
struct Question {
  Scene nominal;
  std::vector<ContactEvent> events;
  IdentificationSettings settings;
  Eigen::VectorXd truth;  ///< of the unknowns, in their order
  int events_lost = 0, events_spurious = 0;
};

/// Empty if no machine of the kind has enough impacts.
std::optional<Question> question(const Scene& machine, const Trial& trial, std::uint64_t seed);

/// Error in coordinates of the unknown; that of a phase is within half a turn.
double error_of(const Unknown& unknown, double value, double truth);

/// A trial with the machine of this scene, drawn with `seed`.
Outcome run(const Scene& machine, const Trial& trial, std::uint64_t seed);

}  // namespace sprag::identification_study
