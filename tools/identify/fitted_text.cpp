#include "tools/identify/fitted_text.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/identification/fitted_tolerance.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/reduction.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

class Text {
 public:
  Text(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void set(const std::string& path, double value) { put({path, {value}}); }
  void set(const std::string& path, const Eigen::VectorXd& value) {
    put({path, {value.data(), value.data() + value.size()}, true});
  }
  void set(const std::string& path, const Eigen::MatrixXd& matrix) {
    SceneValue value{path, {}, true, static_cast<std::size_t>(matrix.cols())};
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) value.numbers.push_back(matrix(i, j));
    }
    put(std::move(value));
  }
  bool is_file(const std::string& path) const { return is_text(text_, path, file_); }
  bool has(const std::string& path) const { return has_key(text_, path, file_); }
  double number(const std::string& path, double fallback) const {
    return number_of(text_, path, fallback, file_);
  }
  std::string written() const { return with_values(text_, values_, file_); }

 private:
  // Two entries of a vector set the same path.
  void put(SceneValue value) {
    std::erase_if(values_, [&](const SceneValue& before) { return before.path == value.path; });
    values_.push_back(std::move(value));
  }

  std::string_view text_;
  const std::string& file_;
  std::vector<SceneValue> values_;
};

std::string entry(const std::string& matrix, Eigen::Index i, Eigen::Index j) {
  return matrix + '.' + std::to_string(i + 1) + '.' + std::to_string(j + 1);
}

// A matrix that was read from a file is written in place of the file's name.
void set_matrix(const std::string& path, const Eigen::MatrixXd& matrix, Text& text) {
  if (text.is_file(path)) {
    text.set(path, matrix);
    return;
  }
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) text.set(entry(path, i, j), matrix(i, j));
  }
}

// The one of the two keys for zeta that `table` uses.
std::string damping_ratio_path(const Text& text, const std::string& table) {
  const std::string other = table + ".modal_damping";
  return text.has(other) ? other : table + ".damping_ratio";
}

void set_damping_ratio(const std::string& path, double factor, const Eigen::VectorXd& ratios,
                       Text& text) {
  const double one = text.number(path, -1.0);
  if (one >= 0.0) {
    text.set(path, factor * one);
  } else {
    text.set(path, ratios);
  }
}

void set_harmonics(const Scene& fitted, const HarmonicGroup& group, const std::string& key,
                   Text& text) {
  const auto value_of = [&](const Harmonic& harmonic) {
    return key == "amplitude"   ? harmonic.amplitude
           : key == "frequency" ? harmonic.frequency
                                : harmonic.phase;
  };
  if (group.of_frame) {
    text.set(group.key + "." + key, value_of(fitted.frame->motion));
    return;
  }
  for (const int j : group.forces) {
    text.set("force." + std::to_string(j + 1) + '.' + key,
             value_of(fitted.model.forces[static_cast<std::size_t>(j)].harmonic));
  }
  for (const int i : group.contacts) {
    text.set("contact." + std::to_string(i + 1) + ".motion." + key,
             value_of(fitted.model.contacts[static_cast<std::size_t>(i)].motion));
  }
}

// Sets a number of all harmonics, or of a group. Returns false for a frame, whose key is in the
// text, and for other keys.
bool set_harmonics(const Scene& scene, const Scene& fitted, const std::string& key, Text& text) {
  const bool all = key.starts_with("excitations.");
  if (!is_of_harmonic(key)) return false;
  const std::string number(quantity(key));
  bool is_set = false;
  for (const HarmonicGroup& group : harmonic_groups(scene)) {
    if (!all && (group.of_frame || key != group.key + '.' + number)) continue;
    set_harmonics(fitted, group, number, text);
    is_set = true;
  }
  return is_set;
}

// Restitutions of which some depend on the speed.
void set_curves(const Scene& fitted, Text& text) {
  const std::vector<Contact>& contacts = fitted.model.contacts;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Contact& contact = contacts[i];
    const std::string own = "contact." + std::to_string(i + 1) + ".restitution";
    const std::string path = text.has(own) || contacts.size() > 1 ? own : "impact.restitution";
    if (contact.curve.is_constant()) {
      text.set(path, contact.restitution);
    } else if (!text.has(path + ".value")) {
      throw std::invalid_argument(path +
                                  " is not in the scene, which has one restitution by speed "
                                  "for all contacts: give each contact its own");
    } else if (contact.curve.at.empty()) {
      text.set(path + ".value", contact.restitution);
      text.set(path + ".slope", contact.curve.slope);
    } else {
      text.set(path + ".value", restitutions_at_points(contact));
    }
  }
}

// A restitution for all contacts. Contacts with a restitution of their own keep it unless it is
// written as well.
void set_restitutions(const Scene& scene, const Scene& fitted, double value, Text& text) {
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    const std::string own = "contact." + std::to_string(i + 1) + ".restitution";
    if (text.has(own)) text.set(own, fitted.model.contacts[i].restitution);
  }
  const std::string common = "impact.restitution";
  if (!text.has(common)) return;
  const bool one = has_one_restitution(scene.model);
  text.set(common, one ? value : value * text.number(common, 0.0));
}

// Sets an entry of a matrix or a vector, whose place may have the name of a file.
void set_entry(const Scene& fitted, const std::string& key, double value, Text& text) {
  const SceneNumber number = *scene_number(fitted, key);
  const auto i = static_cast<std::size_t>(number.i);
  const std::string_view of = quantity(key);
  const std::string path = key.substr(0, key.rfind('.'));
  const Model& model = fitted.model;
  if (number.symmetric) {
    const std::string matrix = "system." + std::string(of);
    if (text.is_file(matrix)) {
      set_matrix(matrix, of == "M" ? model.M : of == "C" ? model.C : model.K, text);
      return;
    }
    text.set(entry(matrix, number.i, number.j), value);
    text.set(entry(matrix, number.j, number.i), value);
  } else if (of == "damping_ratio") {
    text.set(damping_ratio_path(text, "beam"), fitted.beam->damping_ratio);
  } else if (of == "influence") {
    text.set(path, fitted.frame->influence);
  } else {
    text.set(path, key.starts_with("force.") ? model.forces[i].direction : model.contacts[i].w);
  }
}

void set_unknown(const Scene& scene, const Scene& fitted, const FittedUnknown& of, Text& text) {
  const std::string& key = of.unknown.key;
  const std::string_view number = quantity(key);
  const bool of_curve = number == "restitution" || number == "slope";
  if (of_curve && has_curves(scene.model)) return;  // set_curves()
  if (is_of_entry(key)) {
    set_entry(fitted, key, of.value, text);
  } else if (key == "impact.restitution") {
    set_restitutions(scene, fitted, of.value, text);
  } else if (key == "system.C") {
    if (!text.has(key)) return;
    set_matrix(key, scene.kept ? of.value * scene.kept->C : fitted.model.C, text);
  } else if (key == "system.K") {
    set_matrix(key, scene.kept ? of.value * scene.kept->K : fitted.model.K, text);
  } else if (key == "beam.damping_ratio") {
    set_damping_ratio(damping_ratio_path(text, "beam"), of.value, fitted.beam->damping_ratio, text);
  } else if (!set_harmonics(scene, fitted, key, text)) {
    text.set(key, of.value);
  }
}

bool is_of_matrix_entry(const Parameter& unknown) {
  return unknown.key.starts_with("system.") && is_of_entry(unknown.key);
}

// Sets a system's Rayleigh damping such that the fitted K gives the fitted C.
void set_rayleigh(const Identification& fit, const std::string& file, Text& text) {
  double of_C = 1.0, of_K = 1.0;
  for (const FittedUnknown& of : fit.unknowns) {
    if (of.unknown.key == "system.C") of_C = of.value;
    if (of.unknown.key == "system.K") of_K = of.value;
    if (is_of_matrix_entry(of.unknown)) {
      throw SceneError(file, "system.rayleigh cannot say a single entry; give system.C");
    }
  }
  const std::string alpha = "system.rayleigh.alpha", beta = "system.rayleigh.beta";
  if (of_C != 1.0) text.set(alpha, of_C * text.number(alpha, 0.0));
  if (of_C != of_K) text.set(beta, of_C / of_K * text.number(beta, 0.0));
}

// Sets a system's damping ratios such that the fitted K gives the fitted C.
void set_system_ratio(const Identification& fit, const std::string& file, Text& text) {
  const std::string path = damping_ratio_path(text, "system");
  double factor = 1.0;
  for (const FittedUnknown& of : fit.unknowns) {
    if (of.unknown.key == "system.C") factor *= of.value;
    if (of.unknown.key == "system.K") factor /= std::sqrt(of.value);
    if (is_of_matrix_entry(of.unknown)) {
      throw SceneError(file, path + " cannot say a single entry; give system.C");
    }
  }
  if (factor == 1.0) return;
  if (text.is_file(path)) throw SceneError(file, path + " is a file; give its numbers in place");
  const double one = text.number(path, -1.0);
  if (one >= 0.0) {
    text.set(path, factor * one);
    return;
  }
  const Scene& fitted = fit.fitted;
  const Eigen::Index f = fitted.kept ? fitted.kept->given() : fitted.model.coordinates();
  for (Eigen::Index i = 0; i < f; ++i) {
    const std::string entry_path = path + '.' + std::to_string(i + 1);
    if (text.has(entry_path)) text.set(entry_path, factor * text.number(entry_path, 0.0));
  }
}

constexpr std::string_view not_covered = "# The bound B covers no error of";

// The text without [tolerance] and the comment of an earlier fit.
std::string without_tolerance(std::string_view given) {
  std::string text = without_table(given, "tolerance");
  const std::size_t begin = text.find(not_covered);
  if (begin == std::string::npos) return text;
  std::size_t end = begin;
  while (end < text.size() && text[end] == '#') {
    end = std::min(text.find('\n', end), text.size() - 1) + 1;
  }
  text.erase(begin, end - begin);
  while (text.ends_with("\n\n")) text.pop_back();
  return text;
}

// Adds an empty line, as the beginning of a table.
void begin_table(std::string& text) {
  if (!text.ends_with("\n")) text += '\n';
  if (!text.ends_with("\n\n")) text += '\n';
}

// If no tolerance covers one of the fitted parameters, the table is written as a comment: the bound
// does not hold for such a machine.
void add_tolerance(const Identification& fit, std::string& text) {
  const std::string table =
      to_toml(fitted_tolerance(fit, fit.fitted.prior.jitter),
              "by identify: limits of four standard deviations of the fit, which are no proof");
  if (table.empty()) return;
  begin_table(text);
  const std::vector<std::string> others = not_tolerated(fit);
  if (others.empty()) {
    text += table;
    return;
  }
  text += not_covered;
  for (const std::string& key : others) text += (key == others.front() ? " " : ", ") + key;
  text += ".\n# Where these are known otherwise:\n";
  for (std::size_t begin = 0; begin < table.size();) {
    const std::size_t end = table.find('\n', begin);
    text += "# " + table.substr(begin, end + 1 - begin);
    begin = end + 1;
  }
}

State as_given(const State& state, const Scene& scene) {
  return scene.kept ? expanded(state, *scene.kept) : state;
}

void set_start(const Scene& fitted, Text& text) {
  const State start = as_given(fitted.prior.start, fitted);
  text.set("replica.q", start.q);
  text.set("replica.u", start.u);
  if (fitted.prior.sigma) {
    text.set("replica.sigma_q", fitted.prior.sigma->q);
    text.set("replica.sigma_u", fitted.prior.sigma->u);
  } else {
    text.set("replica.uncertainty", fitted.prior.uncertainty.sum());
  }
}

}  // namespace

std::string fitted_text(std::string_view given, const Scene& scene, const Identification& fit,
                        const std::filesystem::path& from, const std::filesystem::path& to) {
  const std::string file = to.string();
  const std::string text = with_files_from(without_table(without_tolerance(given), "parameters"),
                                           from.parent_path(), to.parent_path(), file);
  const Scene& fitted = fit.fitted;
  Text out(text, file);
  for (const FittedUnknown& unknown : fit.unknowns) {
    if (unknown.determined) set_unknown(scene, fitted, unknown, out);
  }
  if (has_curves(scene.model)) set_curves(fitted, out);
  if (!scene.beam && out.has(damping_ratio_path(out, "system"))) set_system_ratio(fit, file, out);
  if (out.has("system.rayleigh")) set_rayleigh(fit, file, out);
  if (fit.start_t == fit.begins) set_start(fitted, out);
  const State &master = fitted.truth.start, &given_master = scene.truth.start;
  if (out.has("master") && (master.q != given_master.q || master.u != given_master.u)) {
    const State start = as_given(master, fitted);
    out.set("master.q", start.q);
    out.set("master.u", start.u);
  }
  if (fitted.prior.drift != scene.prior.drift) out.set("replica.drift", fitted.prior.drift);
  if (fitted.prior.jitter > 0.0 || out.has("events.jitter")) {
    out.set("events.jitter", fitted.prior.jitter);
  }
  std::string written = out.written();
  if (!fitted.prior.parameters.empty()) {
    begin_table(written);
    written += to_toml(fitted.prior.parameters,
                       "by identify: standard deviations, and correlations of the fit");
  }
  add_tolerance(fit, written);
  parse_scene(written, file);
  return written;
}

}  // namespace sprag
