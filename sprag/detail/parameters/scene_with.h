// The machine with other values of parameters.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"

namespace sprag {

/// Gain and delay of a recorded input.
struct GainAndDelay {
  double gain = 1.0;
  double delay = 0.0;  ///< [s]
};

/// Sets parameters in copies of one scene. Nothing else knows which number of a scene a parameter
/// is.
class SceneValues {
 public:
  SceneValues(const Scene& nominal, std::vector<Unknown> unknowns);

  const Scene& nominal() const { return nominal_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  const std::vector<HarmonicGroup>& groups() const { return groups_; }
  const std::vector<RecordedInput>& records() const { return records_; }
  /// Settings of the nominal scene's records.
  std::vector<GainAndDelay> gains_and_delays() const;

  /// Sets all unknowns in `scene`, a copy of the nominal scene with any values of them, except that
  /// its recorded inputs do not change: their gains and delays are in `records`. Does not allocate.
  void set(const Eigen::VectorXd& values, Scene& scene, std::vector<GainAndDelay>& records) const;

 private:
  void set(const Unknown& unknown, double value, Scene& scene,
           std::vector<GainAndDelay>& records) const;
  void set_harmonics(const Unknown& unknown, double value, Scene& scene) const;
  void set_restitution(int index, double value, Model& model) const;
  void set_position(std::size_t contact, double value, Scene& scene) const;

  Scene nominal_;
  std::vector<Unknown> unknowns_;
  std::vector<HarmonicGroup> groups_;
  std::vector<RecordedInput> records_;
  bool one_restitution_;
};

/// The scene with these values of some of its parameters, in its beam, frame, model, positions and
/// clock. A factor multiplies what the scene has. The amplitude of a frame's motion stays at
/// another frequency, so that its acceleration grows with the frequency squared.
Scene with(const Scene& scene, const std::vector<Unknown>& unknowns, const Eigen::VectorXd& values);

/// The scene with another value of one parameter.
Scene with(const Scene& scene, const Unknown& unknown, double value);

}  // namespace sprag
