#include "sprag/detail/files/scene_writer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "sprag/detail/files/output_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

std::string text_of(double value) {
  std::string text = to_text(value);
  // "-0" would be an integer and lose its sign.
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string text_of(const Eigen::VectorXd& vector) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    if (i > 0) text += ", ";
    text += text_of(vector[i]);
  }
  return text + "]";
}

std::string text_of(const Eigen::MatrixXd& matrix) {
  std::string text = "[\n";
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    text += "  " + text_of(Eigen::VectorXd(matrix.row(i))) + ",\n";
  }
  return text + "]";
}

std::string text_of(const std::vector<std::string>& strings) {
  std::string text = "[";
  for (const std::string& of : strings) text += (text.size() > 1 ? ", " : "") + in_quotes(of);
  return text + "]";
}

bool is_given(const Harmonic& harmonic) {
  return harmonic.amplitude != 0.0 || harmonic.frequency != 0.0 || harmonic.phase != 0.0;
}

template <typename Value>
void add(std::string& text, std::string_view key, const Value& value) {
  text += key;
  text += " = " + text_of(value) + '\n';
}

void add_harmonic(std::string& text, const Harmonic& harmonic) {
  add(text, "amplitude", harmonic.amplitude);
  add(text, "frequency", harmonic.frequency);
  add(text, "phase", harmonic.phase);
}

Eigen::VectorXd vector_of(std::span<const double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

// The samples of a recorded input themselves, in the scene's unit.
void add_record(std::string& text, const SampledInput& input) {
  const SampledInput::Settings& settings = input.settings();
  const auto name_of = [](Outside outside) {
    return outside == Outside::zero ? "zero" : outside == Outside::hold ? "hold" : "error";
  };
  const bool linear = settings.interpolation == Interpolation::linear;
  text += std::string("interpolation = ") + (linear ? "\"linear\"\n" : "\"spline\"\n");
  text += std::string("outside = \"") + name_of(settings.outside) + "\"\n";
  if (settings.noise > 0.0) add(text, "uncertainty", settings.noise);
  add(text, "gain", settings.gain);
  add(text, "delay", settings.delay);
  text += "record = { name = " + in_quotes(settings.name) +
          ", time = " + text_of(vector_of(input.sample_times())) +
          ", values = " + text_of(vector_of(input.sample_values())) + " }\n";
}

void add_force(std::string& text, const Force& force) {
  text += "\n[[force]]\n";
  add(text, "direction", force.direction);
  add(text, "constant", force.constant);
  if (is_given(force.harmonic)) add_harmonic(text, force.harmonic);
  if (force.input) add_record(text, *force.input);
}

// The motion e(t) of a frame, without its influence.
void add_frame_motion(std::string& text, const Scene& scene, const Harmonic& motion,
                      const SampledInputPointer& input) {
  if (!input || is_given(motion)) add_harmonic(text, motion);
  if (!input) return;
  text += std::string("quantity = ") +
          (input->settings().displacement ? "\"displacement\"\n" : "\"acceleration\"\n");
  add_record(text, *input);
  if (scene.stream_duration > 0.0) {
    text += "stream = true\n";
    add(text, "stream_duration", scene.stream_duration);
    add(text, "unit", scene.stream_unit);
  }
}

void add_frame(std::string& text, const Scene& scene) {
  text += "\n[excitation]\n";
  add(text, "influence", scene.frame->influence);
  add_frame_motion(text, scene, scene.frame->motion, scene.frame->input);
}

// How the motion of a support is written.
struct Mount {
  const char* word = nullptr;  // of the key `mount`; null: none
  bool own_motion = false;     // `motion` is written, even if it is zero
};

void add_restitution(std::string& text, const Contact& contact) {
  const RestitutionCurve& curve = contact.curve;
  if (curve.is_constant()) return add(text, "restitution", contact.restitution);
  if (curve.at.empty()) {
    text += "restitution = { value = " + text_of(contact.restitution) +
            ", slope = " + text_of(curve.slope) + " }\n";
    return;
  }
  const Eigen::VectorXd at = Eigen::VectorXd::Map(curve.at.data(), std::ssize(curve.at));
  text += "restitution = { at = " + text_of(at) +
          ", value = " + text_of(restitutions_at_points(contact)) + " }\n";
}

void add_contact(std::string& text, const Contact& contact, const Mount& mount) {
  text += "\n[[contact]]\n";
  add(text, "direction", contact.w);
  add(text, "clearance", contact.clearance);
  if (mount.own_motion || (mount.word == nullptr && is_given(contact.motion))) {
    const Harmonic& s = contact.motion;
    text += "motion = { amplitude = " + text_of(s.amplitude) +
            ", frequency = " + text_of(s.frequency) + ", phase = " + text_of(s.phase) + " }\n";
  } else if (mount.word != nullptr) {
    text += std::string("mount = ") + mount.word + '\n';
  }
  add_restitution(text, contact);
}

void add_output(std::string& text, const Output& output) {
  text += "\n[[output]]\nname = " + in_quotes(output.name) + '\n';
  add(text, "direction", output.direction);
  if (output.velocity) text += "quantity = \"velocity\"\n";
  if (!output.unit.empty()) text += "unit = " + in_quotes(output.unit) + '\n';
}

// In kept modes the motion of a support on the ground does not follow from w and the influence.
Mount mount_of(const Scene& scene, std::size_t contact) {
  if (!scene.frame) return {};
  const std::vector<int>& ground = scene.frame->on_ground;
  if (std::find(ground.begin(), ground.end(), static_cast<int>(contact)) != ground.end()) {
    return scene.kept ? Mount{.own_motion = true} : Mount{.word = "\"ground\""};
  }
  return is_given(scene.model.contacts[contact].motion) ? Mount{} : Mount{.word = "\"frame\""};
}

void add_replica(std::string& text, const Scene& scene) {
  text += "\n[replica]\n";
  add(text, "q", scene.prior.start.q);
  add(text, "u", scene.prior.start.u);
  Eigen::VectorXd restitution(static_cast<Eigen::Index>(scene.model.contacts.size()));
  bool own = false;
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    const Contact& contact = scene.model.contacts[i];
    own = own || contact.replica_restitution.has_value();
    restitution[static_cast<Eigen::Index>(i)] = restitution_of_replica(contact);
  }
  if (own) add(text, "restitution", restitution);
  if (scene.prior.uncertainty.size() > 0) add(text, "uncertainty", scene.prior.uncertainty);
  if (scene.prior.sigma) {
    add(text, "sigma_q", scene.prior.sigma->q);
    add(text, "sigma_u", scene.prior.sigma->u);
  }
  add(text, "drift", scene.prior.drift);
  text += "confidence = " + in_quotes(name(scene.prior.confidence)) + "\n";
}

void add_adaptation(std::string& text, const Scene& scene) {
  text += "\n[adapt]\n";
  if (!scene.prior.adaptation.free.empty()) add(text, "free", scene.prior.adaptation.free);
  add(text, "within", scene.prior.adaptation.within);
  add(text, "walk", scene.prior.adaptation.walk);
}

// What a [beam] needs beside its table.
struct BeamText {
  Harmonic excitation;
  SampledInputPointer input;
  std::vector<Side> sides;  // of the contacts
  std::vector<bool> on_ground;
};

bool equal(const Harmonic& a, const Harmonic& b) {
  return a.amplitude == b.amplitude && a.frequency == b.frequency && a.phase == b.phase;
}

// The motion with this second derivative bit for bit; empty if rounding admits none.
std::optional<Harmonic> motion_of(const Harmonic& acceleration) {
  const double w = acceleration.frequency;
  double amplitude = -acceleration.amplitude / (w * w);
  constexpr int ulps = 4;
  for (int i = 0; i < ulps; ++i) amplitude = std::nextafter(amplitude, -infinity);
  for (int i = -ulps; i <= ulps; ++i) {
    const Harmonic motion{amplitude, w, acceleration.phase};
    if (equal(second_derivative(motion), acceleration)) return motion;
    amplitude = std::nextafter(amplitude, infinity);
  }
  return std::nullopt;
}

// Empty if the keys of a beam do not give the machine bit for bit, as with other damping or forces.
std::optional<BeamText> beam_text(const Scene& scene) {
  const Model& model = scene.model;
  if (!scene.beam || scene.positions.size() != model.contacts.size()) return std::nullopt;
  const Beam& beam = *scene.beam;
  BeamText text;
  if (!model.forces.empty()) text.input = model.forces.back().input;
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = model.contacts[i];
    const Eigen::VectorXd v = mode_shapes(beam, scene.positions[i]);
    if (contact.w != v && contact.w != -v) return std::nullopt;
    text.sides.push_back(contact.w == v ? Side::below : Side::above);
    text.on_ground.push_back(is_given(contact.motion) || contact.input);
    if (!is_given(contact.motion)) continue;
    text.excitation = contact.motion;
    if (text.sides.back() == Side::above) text.excitation.amplitude *= -1.0;
  }
  if (!is_given(text.excitation) && !model.forces.empty() && !model.forces.front().input) {
    const std::optional<Harmonic> motion = motion_of(model.forces.front().harmonic);
    if (!motion) return std::nullopt;
    text.excitation = *motion;
  }
  const Model again = beam_model(beam, text.excitation);
  std::vector<Force> forces = again.forces;
  if (text.input) forces.push_back({inertia_direction(beam), 0.0, {}, text.input});
  const auto same_force = [](const Force& a, const Force& b) {
    return a.direction == b.direction && a.constant == b.constant &&
           equal(a.harmonic, b.harmonic) && a.input == b.input;
  };
  if (again.M != model.M || again.C != model.C || again.K != model.K ||
      !std::equal(forces.begin(), forces.end(), model.forces.begin(), model.forces.end(),
                  same_force)) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = model.contacts[i];
    const double sign = text.sides[i] == Side::below ? 1.0 : -1.0;
    Harmonic motion = text.on_ground[i] ? text.excitation : Harmonic{};
    motion.amplitude *= sign;
    const bool moves_with_record = text.on_ground[i] && text.input;
    if (!equal(contact.motion, motion) ||
        contact.input != (moves_with_record ? text.input : nullptr) ||
        contact.input_share != (moves_with_record ? sign : 0.0)) {
      return std::nullopt;
    }
  }
  return text;
}

void add_beam(std::string& text, const Scene& scene, const BeamText& of) {
  const Beam& beam = *scene.beam;
  text += "[beam]\nmodes = " + std::to_string(beam.modes) + '\n';
  add(text, "length", beam.length);
  add(text, "bending_stiffness", beam.bending_stiffness);
  add(text, "mass_per_length", beam.mass_per_length);
  if (beam.damping_ratio.size() > 0) {
    add(text, "damping_ratio", beam.damping_ratio);
  } else {
    add(text, "damping", beam.damping);
  }
  if (is_given(of.excitation) || of.input) {
    text += "\n[excitation]\n";
    add_frame_motion(text, scene, of.excitation, of.input);
  }
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    const Contact& contact = scene.model.contacts[i];
    text += "\n[[contact]]\n";
    add(text, "position", scene.positions[i]);
    text += of.sides[i] == Side::below ? "side = \"below\"\n" : "side = \"above\"\n";
    add(text, "clearance", contact.clearance);
    text += of.on_ground[i] ? "mount = \"ground\"\n" : "mount = \"frame\"\n";
    add_restitution(text, contact);
  }
}

void add_system(std::string& text, const Scene& scene) {
  const Model& model = scene.model;
  text += "[system]\n";
  add(text, "M", model.M);
  add(text, "C", model.C);
  add(text, "K", model.K);
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    if (!scene.frame || scene.frame->force != j) add_force(text, model.forces[j]);
  }
  if (scene.frame) add_frame(text, scene);
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    add_contact(text, model.contacts[i], mount_of(scene, i));
  }
}

// Throws SceneError for inputs that no key describes.
void refuse_unwritten_inputs(const Scene& scene, bool as_beam) {
  const bool on_ground =
      std::any_of(scene.model.contacts.begin(), scene.model.contacts.end(),
                  [](const Contact& contact) { return contact.input != nullptr; });
  const bool streamed =
      std::any_of(scene.model.forces.begin(), scene.model.forces.end(),
                  [](const Force& force) { return force.input && force.input->is_streamed(); });
  if (streamed) throw SceneError("a scene with a streamed input cannot be written");
  if (!as_beam && on_ground && (scene.kept || !scene.frame)) {
    throw SceneError("supports that move with a record cannot be written in kept modes");
  }
}

}  // namespace

Eigen::VectorXd restitutions_at_points(const Contact& contact) {
  const std::vector<double>& at = contact.curve.at;
  Eigen::VectorXd values(std::ssize(at));
  std::transform(at.begin(), at.end(), values.begin(),
                 [&](double v) { return restitution_at(contact, -v).epsilon; });
  return values;
}

std::string to_toml(const ParameterUncertainty& parameters, std::string_view comment) {
  if (parameters.empty()) return {};
  std::string text = "[parameters]\n";
  if (!comment.empty()) text += "# " + std::string(comment) + '\n';
  std::string correlations;
  for (Eigen::Index i = 0; i < parameters.size(); ++i) {
    const auto number = static_cast<std::size_t>(i);
    text += parameters.keys[number] + " = { sigma = " + text_of(parameters.sigma[i]);
    text += parameters.consider[number] ? ", consider = true }\n" : " }\n";
    for (Eigen::Index j = 0; j < i; ++j) {
      const double correlation = parameters.correlation(i, j);
      if (correlation == 0.0) continue;
      correlations += "  [" + in_quotes(parameters.keys[static_cast<std::size_t>(j)]) + ", " +
                      in_quotes(parameters.keys[number]) + ", " + text_of(correlation) + "],\n";
    }
  }
  if (!correlations.empty()) text += "correlation = [\n" + correlations + "]\n";
  return text;
}

std::string to_toml(const Tolerance& tolerance, std::string_view comment) {
  if (!tolerance.any()) return {};
  std::string text = "[tolerance]\n";
  if (!comment.empty()) text += "# " + std::string(comment) + '\n';
  add(text, "time", tolerance.time);
  add(text, "restitution", tolerance.restitution);
  add(text, "stiffness", tolerance.stiffness);
  add(text, "damping", tolerance.damping);
  add(text, "force", tolerance.force);
  add(text, "clearance", tolerance.clearance);
  return text;
}

std::string to_toml(const Scene& scene, std::string_view comment) {
  const std::optional<BeamText> beam = beam_text(scene);
  refuse_unwritten_inputs(scene, beam.has_value());
  std::string text;
  while (!comment.empty()) {
    const std::string_view line = comment.substr(0, comment.find('\n'));
    comment.remove_prefix(std::min(line.size() + 1, comment.size()));
    text += "# ";
    text += line;
    text += '\n';
  }
  text += "name = " + in_quotes(scene.name) + "\n\n";
  const Model& model = scene.model;
  if (beam) {
    add_beam(text, scene, *beam);
  } else {
    add_system(text, scene);
  }
  for (const Output& output : model.outputs) add_output(text, output);
  text += "\n[impact]\nlaw = ";
  text += model.law == ImpactLaw::newton ? "\"newton\"\n" : "\"poisson\"\n";
  add(text, "chatter_time", model.chatter_time);
  if (scene.truth.given) {
    text += "\n[master]\n";
    add(text, "q", scene.truth.start.q);
    add(text, "u", scene.truth.start.u);
    if (scene.truth.release_penetration) text += "penetration = \"release\"\n";
  }
  add_replica(text, scene);
  text += "\n[events]\n";
  add(text, "jitter", scene.prior.jitter);
  if (!scene.clock.is_true()) {
    text += "\n[clock]\n";
    add(text, "rate", scene.clock.rate);
    add(text, "offset", scene.clock.offset);
  }
  if (scene.prior.tolerance.any()) text += '\n' + to_toml(scene.prior.tolerance);
  // A beam that is written as a system has other keys.
  const bool has_keys = beam || !scene.beam;
  if (has_keys) add_adaptation(text, scene);
  if (has_keys && !scene.prior.parameters.empty()) text += '\n' + to_toml(scene.prior.parameters);
  return text;
}

void write_scene(const std::filesystem::path& file, const Scene& scene, std::string_view comment) {
  write_file(file, to_toml(scene, comment));
}

}  // namespace sprag
