#include "sprag/detail/parameters/scene_parameters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_number.h"

namespace sprag {
namespace {

constexpr double margin = 0.05;        // of the search range in coordinates
constexpr double widest_reach = 10.0;  // in nominal slopes of a restitution, or in steps

// A positive number has the coordinate log(value / nominal).
Parameter positive(std::string key, std::string_view unit, double nominal) {
  Parameter unknown{.key = std::move(key), .unit = std::string(unit), .nominal = nominal};
  unknown.logarithmic = nominal > 0.0;
  unknown.relative = nominal != 0.0;
  if (nominal < 0.0) unknown.unit_step = -nominal;
  return unknown;
}

// A number with the coordinate (value - nominal) / step, which the search limits by `reach`.
Parameter linear(std::string key, std::string_view unit, double nominal, double step,
                 double reach) {
  Parameter unknown{.key = std::move(key), .unit = std::string(unit), .nominal = nominal};
  unknown.unit_step = step;
  unknown.relative = false;
  unknown.reach = reach;
  return unknown;
}

Parameter phase_of(std::string key, double nominal) {
  return linear(std::move(key), "rad", nominal, 1.0, infinity);
}

// Damping may be 0, so that its coordinate is linear. `step` is for an undamped machine.
Parameter damping_of(std::string key, std::string_view unit, double nominal, double step) {
  Parameter unknown = linear(std::move(key), unit, nominal, nominal > 0.0 ? nominal : step,
                             nominal > 0.0 ? 0.0 : widest_reach);
  unknown.relative = nominal > 0.0;
  unknown.lower_limit = 0.0;
  return unknown;
}

std::string of(const char* table, std::size_t i, const char* key) {
  return std::string(table) + '.' + std::to_string(i + 1) + '.' + key;
}

void add_restitutions(const Model& model, std::vector<Parameter>& unknowns) {
  const auto& contacts = model.contacts;
  const bool one = has_one_restitution(model);
  const auto add = [&](const std::string& key, const Contact& contact) {
    const bool constant = contact.curve.is_constant();
    Parameter epsilon = positive(constant ? key : key + ".value", "", contact.restitution);
    epsilon.lower_limit = 0.0;
    epsilon.upper_limit =
        contact.restitution > 0.0 ? contact.restitution / largest_restitution(contact) : 1.0;
    unknowns.push_back(epsilon);
    const double slope = contact.curve.slope;
    if (slope == 0.0) return;
    unknowns.push_back(linear(key + ".slope", "s/m", slope, -slope, widest_reach));
    unknowns.back().upper_limit = 0.0;
    unknowns.back().within = widest_reach;
  };
  if (one) add("impact.restitution", contacts.front());
  for (std::size_t i = 0; (!one || contacts.size() > 1) && i < contacts.size(); ++i) {
    add(of("contact", i, "restitution"), contacts[i]);
  }
}

void add_flow(const Scene& scene, std::vector<Parameter>& unknowns) {
  if (!scene.beam) {
    if (!scene.model.C.isZero(0.0)) unknowns.push_back(damping_of("system.C", "", 1.0, 1.0));
    if (!scene.model.K.isZero(0.0)) unknowns.push_back(positive("system.K", "", 1.0));
    return;
  }
  const Beam& beam = *scene.beam;
  if (beam.damping_ratio.size() == 0) {
    // 2 % of critical damping of the first mode.
    const double step = 0.04 * std::sqrt(stiffness(beam)[0] / mass(beam)[0]) * beam.mass_per_length;
    unknowns.push_back(damping_of("beam.damping", "N s/m^2", beam.damping, step));
  } else if (!scene.model.C.isZero(0.0)) {
    unknowns.push_back(damping_of("beam.damping_ratio", "", 1.0, 1.0));
  }
  unknowns.push_back(positive("beam.bending_stiffness", "N m^2", beam.bending_stiffness));
}

// Typical length of the machine: the step for clearances, which may nominally be 0.
double usual_length(const Scene& scene) {
  double length = 0.0;
  for (const Contact& contact : scene.model.contacts) {
    length = std::max({length, std::abs(contact.clearance), std::abs(contact.motion.amplitude),
                       std::abs(contact.w.dot(scene.truth.start.q)),
                       std::abs(contact.w.dot(scene.prior.start.q))});
  }
  return length > 0.0 ? length : 1.0;
}

std::string_view unit_of_amplitude(const HarmonicGroup& group) {
  if (group.of_frame) return "m";
  if (group.forces.size() + group.contacts.size() > 1) return "";
  return group.forces.empty() ? "m" : "N";
}

}  // namespace

double Parameter::coordinate(double of_value) const {
  return logarithmic ? std::log(of_value / nominal) : (of_value - nominal) / unit_step;
}

double Parameter::value(double of_coordinate) const {
  return logarithmic ? nominal * std::exp(of_coordinate) : nominal + unit_step * of_coordinate;
}

namespace {

// Largest change to search, in coordinates.
double most_of(const Parameter& of) {
  if (of.reach > 0.0) return of.reach;
  return (of.logarithmic ? std::log1p(2.0 * of.within) : 2.0 * of.within) + margin;
}

}  // namespace

double Parameter::highest() const {
  const double most = most_of(*this);
  return upper_limit < infinity ? std::min(most, coordinate(upper_limit)) : most;
}

double Parameter::lowest() const {
  const double most = most_of(*this);
  return lower_limit > -infinity ? std::max(-most, coordinate(lower_limit)) : -most;
}

bool Parameter::is_physical_bound(double of_value) const {
  constexpr double rounding = 1e-9;
  return of_value <= lower_limit + rounding * std::abs(nominal) ||
         of_value >= upper_limit * (1.0 - 1e-12);
}

bool Parameter::is_within(double of_value, double tolerance) const {
  if (reach > 0.0) return true;
  const double at = coordinate(of_value);
  if (nominal == 0.0) return at <= highest() + tolerance;
  const double low = logarithmic ? std::log1p(-std::min(within, 0.9)) : -within;
  const double high = logarithmic ? std::log1p(within) : within;
  return at >= low - tolerance && at <= high + tolerance;
}

namespace {

bool moves(const Harmonic& harmonic) {
  return harmonic.amplitude != 0.0 && harmonic.frequency > 0.0;
}

bool is_on_ground(const ShakenFrame& frame, int contact) {
  return std::find(frame.on_ground.begin(), frame.on_ground.end(), contact) !=
         frame.on_ground.end();
}

}  // namespace

Eigen::VectorXd nominal_values(const std::vector<Parameter>& unknowns) {
  Eigen::VectorXd values(std::ssize(unknowns));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    values[k] = unknowns[static_cast<std::size_t>(k)].nominal;
  }
  return values;
}

double only_frequency(const Model& model) {
  double common = 0.0;
  bool differ = false;
  const auto add = [&](const Harmonic& harmonic) {
    if (!moves(harmonic)) return;
    differ = differ || (common > 0.0 && harmonic.frequency != common);
    common = harmonic.frequency;
  };
  for (const Force& force : model.forces) add(force.harmonic);
  for (const Contact& contact : model.contacts) add(contact.motion);
  return differ ? 0.0 : common;
}

std::vector<HarmonicGroup> harmonic_groups(const Scene& scene, bool common) {
  std::vector<HarmonicGroup> groups;
  const Model& model = scene.model;
  const bool shaken = scene.frame && moves(scene.frame->motion);
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const Harmonic& harmonic = model.forces[j].harmonic;
    if (!moves(harmonic) || (shaken && scene.frame->force == j)) continue;
    groups.push_back({{static_cast<int>(j)},
                      {},
                      "force." + std::to_string(j + 1),
                      harmonic.amplitude,
                      harmonic.frequency,
                      harmonic.phase});
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Harmonic& harmonic = model.contacts[i].motion;
    if (!moves(harmonic) || (shaken && is_on_ground(*scene.frame, static_cast<int>(i)))) continue;
    groups.push_back({{},
                      {static_cast<int>(i)},
                      of("contact", i, "motion"),
                      harmonic.amplitude,
                      harmonic.frequency,
                      harmonic.phase});
  }
  if (shaken) {
    HarmonicGroup frame{.forces = {static_cast<int>(scene.frame->force)},
                        .contacts = {},
                        .key = "excitation",
                        .amplitude = scene.frame->motion.amplitude,
                        .frequency = scene.frame->motion.frequency,
                        .phase = scene.frame->motion.phase,
                        .of_frame = true};
    frame.contacts = scene.frame->on_ground;
    groups.insert(groups.begin(), std::move(frame));
    return groups;
  }
  const double frequency = only_frequency(model);
  if (!common || groups.empty() || frequency == 0.0 || (!scene.beam && groups.size() == 1)) {
    return groups;
  }
  HarmonicGroup all{.forces = {}, .contacts = {}, .key = "excitation", .frequency = frequency};
  for (const HarmonicGroup& group : groups) {
    all.forces.insert(all.forces.end(), group.forces.begin(), group.forces.end());
    all.contacts.insert(all.contacts.end(), group.contacts.begin(), group.contacts.end());
  }
  if (scene.beam) {
    // Amplitude and phase of e(t), from the frame's force -e''(t).
    all.amplitude = std::abs(groups.front().amplitude) / square(frequency);
    all.phase = groups.front().phase;
    all.of_frame = true;
  }
  return {all};
}

std::vector<RecordedInput> recorded_inputs(const Scene& scene) {
  std::vector<RecordedInput> records;
  const std::vector<Force>& forces = scene.model.forces;
  for (std::size_t j = 0; j < forces.size(); ++j) {
    if (!forces[j].input) continue;
    const bool of_frame = scene.beam || (scene.frame && scene.frame->force == j);
    const auto same =
        std::find_if(records.begin(), records.end(),
                     [&](const RecordedInput& record) { return record.input == forces[j].input; });
    if (same != records.end()) {
      same->forces.push_back(static_cast<int>(j));
      continue;
    }
    records.push_back({forces[j].input,
                       {static_cast<int>(j)},
                       {},
                       of_frame ? "excitation" : "force." + std::to_string(j + 1)});
  }
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    for (RecordedInput& record : records) {
      if (scene.model.contacts[i].input == record.input) {
        record.contacts.push_back(static_cast<int>(i));
      }
    }
  }
  return records;
}

void replace_input(const RecordedInput& record, const SampledInputPointer& input, Model& model) {
  for (const int j : record.forces) model.forces[static_cast<std::size_t>(j)].input = input;
  for (const int i : record.contacts) model.contacts[static_cast<std::size_t>(i)].input = input;
}

void replace_input(const RecordedInput& record, const SampledInputPointer& input, Scene& scene) {
  const SampledInputPointer present =
      scene.model.forces[static_cast<std::size_t>(record.forces.front())].input;
  replace_input(record, input, scene.model);
  if (scene.frame && scene.frame->input == present) scene.frame->input = input;
}

double mean_frequency(const SampledInput& input) {
  const std::vector<double>& t = input.sample_times();
  const std::vector<double>& values = input.sample_values();
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  double squares = 0.0, of_rate = 0.0;
  for (std::size_t k = 0; k + 1 < values.size(); ++k) {
    const double h = t[k + 1] - t[k];
    squares += h * square(values[k] - mean);
    of_rate += square(values[k + 1] - values[k]) / h;
  }
  // A constant record has no frequency: a tenth of its duration is as good as any time.
  if (!(squares > 0.0) || !(of_rate > 0.0)) return 10.0 / (t.back() - t.front());
  return std::sqrt(of_rate / squares);
}

std::vector<Parameter> parameters_of(const Scene& scene) {
  const Model& model = scene.model;
  std::vector<Parameter> unknowns;
  add_restitutions(model, unknowns);
  add_flow(scene, unknowns);
  const double length = usual_length(scene);
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    if (scene.beam) {
      unknowns.push_back(positive(of("contact", i, "position"), "m", scene.positions[i]));
      unknowns.back().upper_limit = scene.beam->length;
    }
    const double clearance = model.contacts[i].clearance;
    unknowns.push_back(linear(of("contact", i, "clearance"), "m", clearance, length, infinity));
    unknowns.back().relative = clearance != 0.0;
  }
  for (const HarmonicGroup& group : harmonic_groups(scene)) {
    unknowns.push_back(positive(group.key + ".frequency", "rad/s", group.frequency));
    unknowns.push_back(phase_of(group.key + ".phase", group.phase));
    unknowns.push_back(
        positive(group.key + ".amplitude", unit_of_amplitude(group), group.amplitude));
  }
  // Half of a record's mean period: larger delays are equivalent to smaller ones.
  for (const RecordedInput& record : recorded_inputs(scene)) {
    const SampledInput::Settings& settings = record.input->settings();
    unknowns.push_back(linear(record.key + ".delay", "s", settings.delay,
                              1.0 / mean_frequency(*record.input), std::numbers::pi));
    unknowns.push_back(positive(record.key + ".gain", "", settings.gain));
  }
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const double constant = model.forces[j].constant;
    if (constant != 0.0) unknowns.push_back(positive(of("force", j, "constant"), "N", constant));
  }
  return unknowns;
}

std::vector<Parameter> common_parameters(const Scene& scene) {
  std::vector<Parameter> unknowns;
  if (!has_one_restitution(scene.model)) {
    double largest = 0.0;
    for (const Contact& contact : scene.model.contacts) {
      largest = std::max(largest, contact.restitution);
    }
    unknowns.push_back(positive("impact.restitution", "", 1.0));
    unknowns.back().lower_limit = 0.0;
    unknowns.back().upper_limit = 1.0 / largest;
  }
  if (harmonic_groups(scene).size() < 2 || has_sampled_inputs(scene.model)) return unknowns;
  unknowns.push_back(positive("excitations.frequency", "", 1.0));
  unknowns.push_back(phase_of("excitations.phase", 0.0));
  unknowns.push_back(positive("excitations.amplitude", "", 1.0));
  return unknowns;
}

std::vector<Parameter> clock_parameters(const Scene& scene) {
  // A record has a delay, which an offset of the clock would change as well.
  if (has_sampled_inputs(scene.model)) return {};
  constexpr double largest_error = 0.01;  // of a rate; a ceramic resonator is off by 0.005
  std::vector<Parameter> unknowns{positive("clock.rate", "", scene.clock.rate)};
  unknowns.back().within = largest_error;
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  if (groups.empty()) return unknowns;
  double slowest = groups.front().frequency;
  for (const HarmonicGroup& group : groups) slowest = std::min(slowest, group.frequency);
  // Half of the slowest period: larger offsets are equivalent to smaller ones.
  unknowns.push_back(linear("clock.offset", "s", scene.clock.offset, scene.clock.rate / slowest,
                            std::numbers::pi));
  return unknowns;
}

bool is_of_clock(const Parameter& unknown) { return unknown.key.starts_with("clock."); }

bool is_common(const Parameter& unknown) { return unknown.key.starts_with("excitations."); }

bool can_be_filtered(const Parameter& unknown) { return !is_of_clock(unknown); }

bool is_of_flow(const Parameter& unknown) {
  return unknown.key.starts_with("system.") || unknown.key.starts_with("beam.");
}

std::string_view tolerance_of(const Parameter& unknown) {
  const std::string_view of = quantity(unknown.key);
  if (of == "restitution" || of == "clearance") return of;
  if (unknown.key == "system.K" || of == "bending_stiffness") return "stiffness";
  const bool is_damping =
      unknown.key == "system.C" || unknown.key == "beam.damping_ratio" || of == "damping";
  return is_damping ? "damping" : "";
}

bool carries_scale(const Parameter& unknown) {
  const std::string_view of = quantity(unknown.key);
  return of == "amplitude" || of == "constant" || of == "gain" ||
         (of == "clearance" && unknown.nominal != 0.0);
}

std::vector<Parameter> all_but_the_scale(const Scene& scene, std::vector<std::string> known) {
  const std::vector<Parameter> all = parameters_of(scene);
  const bool one = all.front().key.starts_with("impact.");
  const auto is_known = [&](const std::string& key) {
    return std::find(known.begin(), known.end(), key) != known.end();
  };
  bool held = std::any_of(all.begin(), all.end(), [&](const Parameter& unknown) {
    return is_known(unknown.key) && carries_scale(unknown);
  });
  for (const std::string_view of_scale : {"amplitude", "gain", "constant"}) {
    for (const Parameter& unknown : all) {
      if (held || quantity(unknown.key) != of_scale) continue;
      known.push_back(unknown.key);
      held = true;
    }
  }
  std::vector<Parameter> unknowns;
  for (const Parameter& unknown : all) {
    const bool own_restitution = unknown.key.starts_with("contact.") &&
                                 unknown.key.find(".restitution") != std::string::npos;
    if (!is_known(unknown.key) && !(one && own_restitution)) unknowns.push_back(unknown);
  }
  return unknowns;
}

namespace {

// Any other number of the machine, by its key.
std::optional<Parameter> number_of(const Scene& scene, const std::string& key) {
  if (key.starts_with("clock.")) return std::nullopt;
  const std::optional<SceneNumber> number = scene_number(scene, key);
  if (!number) return std::nullopt;
  const std::string_view of = quantity(key);
  // parameters_of() has all restitutions. A harmonic without an amplitude is no part of the motion.
  const bool is_absent = of == "amplitude" && number->value == 0.0;
  if (of == "restitution" || of == "slope" || is_absent) return std::nullopt;
  if (of == "phase") return phase_of(key, number->value);
  if (of == "damping_ratio") return damping_of(key, number->unit, number->value, 0.01);
  Parameter unknown = positive(key, number->unit, number->value);
  if (of == "length") {
    for (const double x : scene.positions) unknown.lower_limit = std::max(unknown.lower_limit, x);
  }
  if (unknown.nominal != 0.0 || !key.starts_with("system.")) return unknown;
  const Model& model = scene.model;
  if (of == "C" && number->i == number->j) {
    // 2 % of critical damping of this coordinate alone.
    const Eigen::Index i = number->i;
    const double critical = 2.0 * std::sqrt(std::max(model.K(i, i), 0.0) * model.M(i, i));
    return damping_of(key, number->unit, 0.0, critical > 0.0 ? 0.02 * critical : model.M(i, i));
  }
  // The step of an entry that is nominally 0 is the largest of its matrix.
  const Eigen::MatrixXd& matrix = of == "M" ? model.M : of == "C" ? model.C : model.K;
  if (!matrix.isZero(0.0)) unknown.unit_step = matrix.cwiseAbs().maxCoeff();
  return unknown;
}

std::string listed(const Scene& scene, const std::vector<std::string_view>& keys) {
  std::string text;
  for (const std::string_view key : keys) {
    if (!text.empty()) text += ", ";
    text += key;
  }
  if (scene.kept) {
    return text +
           "; single entries are no parameters with system.modes, where system.K and "
           "system.C are factors on all modes";
  }
  return text + (scene.beam ? "; and beam.length, beam.mass_per_length"
                            : "; and entries such as system.K.1.1, contact.1.direction.1");
}

}  // namespace

Parameter parameter_of(const Scene& scene, std::string_view key) {
  std::vector<Parameter> unknowns = parameters_of(scene);
  for (Parameter& common : common_parameters(scene)) unknowns.push_back(std::move(common));
  for (Parameter& of_clock : clock_parameters(scene)) unknowns.push_back(std::move(of_clock));
  for (const Parameter& unknown : unknowns) {
    if (unknown.key == key) return unknown;
  }
  if (const auto number = number_of(scene, std::string(key))) return *number;
  std::vector<std::string_view> keys;
  keys.reserve(unknowns.size());
  for (const Parameter& unknown : unknowns) keys.push_back(unknown.key);
  std::string text = std::string(key) + " is no parameter of this scene";
  if (const auto nearest = nearest_word(key, keys)) {
    text += "; did you mean " + std::string(*nearest) + "? It has ";
  } else {
    text += ", which has ";
  }
  throw std::invalid_argument(text + listed(scene, keys));
}

std::vector<Parameter> parameters_named(const Scene& scene, const std::vector<std::string>& keys) {
  std::vector<Parameter> unknowns;
  unknowns.reserve(keys.size());
  for (const std::string& key : keys) unknowns.push_back(parameter_of(scene, key));
  return unknowns;
}

}  // namespace sprag
