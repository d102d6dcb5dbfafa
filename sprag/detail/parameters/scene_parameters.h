// Parameters of a scene's machine that can be identified (sprag/parameter.h), and the recorded
// inputs and harmonics that they belong to.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sprag/detail/parameters/scene_number.h"
#include "sprag/parameter.h"
#include "sprag/scene.h"

namespace sprag {

/// The usual parameters of the scene's machine: without lengths, masses and single entries of
/// matrices and vectors.
std::vector<Parameter> parameters_of(const Scene& scene);

/// Parameters for several different numbers at once: a factor on the restitutions, on all
/// amplitudes or frequencies, and a shift of all phases.
std::vector<Parameter> common_parameters(const Scene& scene);
/// Whether it is one of common_parameters() for harmonics.
bool is_common(const Parameter& unknown);

/// clock.rate, and with an excitation clock.offset.
std::vector<Parameter> clock_parameters(const Scene& scene);
/// Whether it is one of clock_parameters().
bool is_of_clock(const Parameter& unknown);

/// Whether a filter of state and parameters can estimate it: not one of the clock.
bool can_be_filtered(const Parameter& unknown);

/// Whether it is of the matrices M, C and K, or of the beam that they follow from.
bool is_of_flow(const Parameter& unknown);

/// The field of Tolerance that covers it: "restitution", "stiffness", "damping", "clearance", else
/// "".
std::string_view tolerance_of(const Parameter& unknown);

/// Whether it sets the scale of the motion. Events determine other such parameters only relative to
/// it.
bool carries_scale(const Parameter& unknown);

/// All parameters that events can determine, without `known`: one restitution if all contacts have
/// the same, and without one amplitude, gain of a record or constant force, in this order, that
/// sets the scale, unless one of `known` sets it.
std::vector<Parameter> all_but_the_scale(const Scene& scene, std::vector<std::string> known = {});

/// Parameter with this key, which may be any number of the machine. Throws std::invalid_argument
/// with the nearest key.
Parameter parameter_of(const Scene& scene, std::string_view key);
/// Parameters with these keys.
std::vector<Parameter> parameters_named(const Scene& scene, const std::vector<std::string>& keys);

/// Their values in the scene, P entries.
Eigen::VectorXd nominal_values(const std::vector<Parameter>& unknowns);

/// Common frequency [rad per unit of time] of all harmonics with an amplitude; 0: they differ.
double only_frequency(const Model& model);

/// Harmonics that share amplitude, frequency and phase in the scene file.
struct HarmonicGroup {
  std::vector<int> forces;    ///< from 0
  std::vector<int> contacts;  ///< contacts whose supports move with it, from 0
  std::string key;            ///< "excitation", "force.1", "contact.2.motion"
  double amplitude = 1.0, frequency = 0.0, phase = 0.0;
  bool of_frame = false;  ///< the forces are inertia forces, which grow with the frequency
};

/// A beam has one group. A general system has one for its shaken frame and one for each other
/// harmonic. Without a frame it has one for all harmonics of one frequency, else one for each.
/// `common`: false for one for each harmonic in any case.
std::vector<HarmonicGroup> harmonic_groups(const Scene& scene, bool common = true);

/// A recorded input of the scene, and the forces and supports that it moves.
struct RecordedInput {
  SampledInputPointer input;
  std::vector<int> forces, contacts;  ///< from 0
  std::string key;                    ///< "excitation", "force.1"
};

/// The record of the shaken frame, and one for each other force with a record.
std::vector<RecordedInput> recorded_inputs(const Scene& scene);

/// Moves these forces and supports of a model by another input.
void replace_input(const RecordedInput& record, const SampledInputPointer& input, Model& model);
/// The same for the scene's model, and its shaken frame if that moves by the same input.
void replace_input(const RecordedInput& record, const SampledInputPointer& input, Scene& scene);

/// Root mean square of the rate of a record's samples over that of the samples, both without their
/// means: the angular frequency of a sinusoid [rad/s].
double mean_frequency(const SampledInput& input);

}  // namespace sprag
