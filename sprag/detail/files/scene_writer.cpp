#include "sprag/detail/files/scene_writer.h"

#include <algorithm>
#include <vector>

#include "sprag/detail/files/output_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/toml_reader.h"
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

void add_force(std::string& text, const Force& force) {
  text += "\n[[force]]\n";
  add(text, "direction", force.direction);
  add(text, "constant", force.constant);
  if (!is_given(force.harmonic)) return;
  add(text, "amplitude", force.harmonic.amplitude);
  add(text, "frequency", force.harmonic.frequency);
  add(text, "phase", force.harmonic.phase);
}

void add_frame(std::string& text, const ShakenFrame& frame) {
  text += "\n[excitation]\n";
  add(text, "influence", frame.influence);
  add(text, "amplitude", frame.motion.amplitude);
  add(text, "frequency", frame.motion.frequency);
  add(text, "phase", frame.motion.phase);
}

// How the motion of a support is written.
struct Mount {
  const char* word = nullptr;  // of the key `mount`; null: none
  bool own_motion = false;     // `motion` is written, even if it is zero
};

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
  add(text, "restitution", contact.restitution);
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
}

// A beam is written as matrices, which its keys do not name.
void add_adaptation(std::string& text, const Scene& scene) {
  if (scene.beam) return;
  text += "\n[adapt]\n";
  if (!scene.prior.adaptation.free.empty()) add(text, "free", scene.prior.adaptation.free);
  add(text, "within", scene.prior.adaptation.within);
  add(text, "walk", scene.prior.adaptation.walk);
}

}  // namespace

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
  if (has_sampled_inputs(scene.model)) {
    throw SceneError("a scene with a recorded input (the key `file`) cannot be written");
  }
  std::string text;
  while (!comment.empty()) {
    const std::string_view line = comment.substr(0, comment.find('\n'));
    comment.remove_prefix(std::min(line.size() + 1, comment.size()));
    text += "# ";
    text += line;
    text += '\n';
  }
  text += "name = " + in_quotes(scene.name) + "\n\n[system]\n";
  const Model& model = scene.model;
  add(text, "M", model.M);
  add(text, "C", model.C);
  add(text, "K", model.K);
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    if (!scene.frame || scene.frame->force != j) add_force(text, model.forces[j]);
  }
  if (scene.frame) add_frame(text, *scene.frame);
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    add_contact(text, model.contacts[i], mount_of(scene, i));
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
  add_adaptation(text, scene);
  if (!scene.beam && !scene.prior.parameters.empty())
    text += '\n' + to_toml(scene.prior.parameters);
  return text;
}

void write_scene(const std::filesystem::path& file, const Scene& scene, std::string_view comment) {
  write_file(file, to_toml(scene, comment));
}

}  // namespace sprag
