// The machine with other values of parameters.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {

/// Gain and delay of a recorded input.
struct GainAndDelay {
  double gain = 1.0;
  double delay = 0.0;  ///< [s]
};

/// Sets parameters in copies of one scene.
class SceneValues {
 public:
  SceneValues(const Scene& nominal, std::vector<Parameter> unknowns);

  const Scene& nominal() const { return nominal_; }
  const std::vector<Parameter>& unknowns() const { return unknowns_; }
  const std::vector<HarmonicGroup>& groups() const { return groups_; }
  const std::vector<RecordedInput>& records() const { return records_; }
  /// Settings of the nominal scene's records.
  std::vector<GainAndDelay> gains_and_delays() const;
  /// The number of a key that is of no group of harmonics or records, and no common factor.
  std::optional<SceneNumber> single_number(const std::string& key) const;

  /// Sets all unknowns in `scene`, a copy of the nominal scene with any values of them, except that
  /// its recorded inputs do not change: their gains and delays are in `records`. Does not allocate.
  void set(const Eigen::VectorXd& values, Scene& scene, std::vector<GainAndDelay>& records) const;

 private:
  // Sets one parameter in a scene that is reset, or in the settings of its records.
  using Setter = std::function<void(double value, Scene&, std::vector<GainAndDelay>&)>;

  void reset(Scene& scene, std::vector<GainAndDelay>& records) const;
  void find_directions(double old_length, Scene& scene) const;
  static Setter setter_of(const std::string& key, const SceneNumber& number);
  Setter setter_of_several(const std::string& key) const;
  Setter setter_of_harmonics(const std::string& key) const;

  Scene nominal_;
  std::vector<Parameter> unknowns_;
  std::vector<HarmonicGroup> groups_;
  std::vector<RecordedInput> records_;
  std::vector<Setter> setters_;  // of each unknown
  // One value for all contacts, then single numbers, then common factors and shifts.
  std::vector<std::size_t> in_order_;
};

/// The scene with these values of some of its parameters, in its beam, frame, model, positions and
/// clock. A factor multiplies what the scene has. The amplitude of a frame's motion stays at
/// another frequency, so that its acceleration grows with the frequency squared.
Scene with(const Scene& scene, const std::vector<Parameter>& unknowns,
           const Eigen::VectorXd& values);

/// The scene with another value of one parameter.
Scene with(const Scene& scene, const Parameter& unknown, double value);

}  // namespace sprag
