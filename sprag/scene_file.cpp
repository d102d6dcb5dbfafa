#include "sprag/scene_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "sprag/detail/files/confidence_columns.h"
#include "sprag/detail/files/parameters_table.h"
#include "sprag/detail/files/sampled_input_table.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/detail/mechanics/definiteness.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/text/confidence_choices.h"
#include "sprag/energy.h"
#include "sprag/reduction.h"

namespace sprag {
namespace {

constexpr std::size_t max_outputs = 200;
constexpr int largest_order = 3;                               // of static vectors
constexpr std::size_t largest_scene = std::size_t{64} << 20U;  // [bytes]

// amplitude and frequency are required, phase is optional.
Harmonic read_harmonic(const TomlTable& table) {
  return {.amplitude = table.number("amplitude", any_number),
          .frequency = table.number("frequency", not_negative),
          .phase = table.number_or("phase", 0.0, any_number)};
}

// The motion e(t) of a frame.
struct FrameMotion {
  Harmonic harmonic;
  SampledInputPointer input;
};

FrameMotion read_frame_motion(const TomlTable& table) {
  FrameMotion motion;
  if (has_record(table)) motion.input = read_frame_input(table);
  if (!motion.input) refuse_record_keys(table);
  if (motion.input && !has_harmonic_keys(table)) return motion;
  motion.harmonic = read_harmonic(table);
  const Harmonic& excitation = motion.harmonic;
  if (!std::isfinite(second_derivative(excitation).amplitude)) {
    table.fail("frequency", "is " + to_text(excitation.frequency) +
                                "; must be smaller (amplitude frequency^2 overflows)");
  }
  return motion;
}

std::vector<TomlTable> read_contact_tables(const TomlTable& root, TomlKeys keys) {
  std::vector<TomlTable> tables = root.tables("contact", keys);
  if (tables.empty()) root.fail_here("missing table [[contact]]");
  if (tables.size() > max_contacts) {
    tables[max_contacts].fail_here("contact has " + std::to_string(tables.size()) +
                                   " tables; must have at most " + std::to_string(max_contacts));
  }
  return tables;
}

Eigen::VectorXd read_direction(const TomlTable& table, Eigen::Index f) {
  Eigen::VectorXd direction = table.vector("direction");
  if (direction.size() != f) {
    table.fail("direction", "has size " + std::to_string(direction.size()) + "; must be " +
                                std::to_string(f) + ", as many as coordinates");
  }
  return direction;
}

// Below this ||w||^2 the impact law's division by w^T M^-1 w is meaningless.
bool sees_nothing(const Eigen::VectorXd& w) {
  return w.squaredNorm() < std::numeric_limits<double>::min();
}

// Reads n numbers: one for all, or one each.
Eigen::VectorXd one_or_each(const TomlTable& table, const char* key, Eigen::Index n) {
  const Eigen::VectorXd given = table.numbers(key);
  if (given.size() != 1 && given.size() != n) {
    table.fail(key, "has " + std::to_string(given.size()) + " numbers; must be one or " +
                        std::to_string(n));
  }
  return given.size() == n ? given : Eigen::VectorXd::Constant(n, given[0]);
}

// Refuses a second key for the same quantity.
void refuse_other(const TomlTable& table, const char* key, TomlKeys others) {
  for (const std::string_view other : others) {
    if (!table.has(other)) continue;
    table.fail(key, "and " + table.path_of(other) + " exclude each other; must be one of them");
  }
}

// Name of the key for zeta that the table has; null: none.
const char* damping_ratio_key(const TomlTable& table) {
  if (!table.has("modal_damping")) return table.has("damping_ratio") ? "damping_ratio" : nullptr;
  refuse_other(table, "modal_damping", {"damping_ratio"});
  return "modal_damping";
}

// Reads zeta_i of n modes: one number for all, or one each. `others` are other keys for damping.
Eigen::VectorXd read_damping_ratio(const TomlTable& table, const char* key, TomlKeys others,
                                   Eigen::Index n) {
  refuse_other(table, key, others);
  Eigen::VectorXd zeta = one_or_each(table, key, n);
  if (!(zeta.minCoeff() >= 0.0)) {
    table.fail(key, "has " + to_text(zeta.minCoeff()) + "; must be >= 0");
  }
  return zeta;
}

Beam read_beam_table(const TomlTable& table) {
  Beam beam{.modes = table.integer("modes", 1, 200),
            .length = table.number("length", positive),
            .bending_stiffness = table.number("bending_stiffness", positive),
            .mass_per_length = table.number("mass_per_length", positive)};
  if (const char* key = damping_ratio_key(table)) {
    beam.damping_ratio = read_damping_ratio(table, key, {"damping"}, beam.modes);
  } else {
    beam.damping = table.number("damping", not_negative);
  }
  const auto usable = [](const Eigen::VectorXd& diagonal) {
    return diagonal.allFinite() && diagonal.minCoeff() > 0;
  };
  if (!usable(mass(beam)) || !usable(stiffness(beam)) || !damping(beam).allFinite()) {
    table.fail_here("beam has M, C or K beyond the range of doubles; must be in other units");
  }
  return beam;
}

Contact read_beam_contact(const TomlTable& table, const Beam& beam, const FrameMotion& excitation) {
  const double x_c = table.number("position", {0.0, beam.length, true});
  const Side side = table.choice("side", {"below", "above"}) == "below" ? Side::below : Side::above;
  const bool on_ground = table.choice("mount", {"ground", "frame"}) == "ground";
  // read_impact() reads the restitution.
  Contact contact = beam_contact(beam, x_c, side, table.number_or("clearance", 0.0, any_number),
                                 0.0, on_ground ? excitation.harmonic : Harmonic{});
  if (on_ground && excitation.input) {
    contact.input = excitation.input;
    contact.input_share = side == Side::below ? 1.0 : -1.0;
  }
  if (sees_nothing(contact.w)) {
    table.fail("position", "is " + to_text(x_c) + "; must be where the beam moves (all v_i are 0)");
  }
  return contact;
}

std::vector<TomlTable> read_beam(const TomlTable& root, const TomlTable& table, Scene& scene) {
  if (root.has("force")) root.fail("force", "is for a [system]; a [beam] has [excitation]");
  const Beam beam = read_beam_table(table);
  const auto frame = root.table(
      "excitation", {"amplitude", "frequency", "phase", "file", "record", "time", "acceleration",
                     "displacement", "quantity", "unit", "interpolation", "outside", "uncertainty",
                     "gain", "delay", "stream", "stream_duration"});
  const FrameMotion excitation = frame ? read_frame_motion(*frame) : FrameMotion{};
  scene.beam = beam;
  scene.model = beam_model(beam, excitation.harmonic);
  if (excitation.input) {
    scene.model.forces.push_back({inertia_direction(beam), 0.0, {}, excitation.input});
  }
  std::vector<TomlTable> contacts =
      read_contact_tables(root, {"position", "clearance", "side", "mount", "restitution"});
  for (const TomlTable& contact : contacts) {
    scene.model.contacts.push_back(read_beam_contact(contact, beam, excitation));
    scene.positions.push_back(contact.number("position", any_number));
  }
  if (frame) check_ground_supports(*frame, scene.model);
  return contacts;
}

Eigen::MatrixXd read_semidefinite(const TomlTable& table, std::string_view key, Eigen::Index f) {
  Eigen::MatrixXd matrix = table.symmetric_matrix(key);
  if (matrix.rows() != f) {
    const std::string given = std::to_string(matrix.rows());
    const std::string wanted = std::to_string(f);
    table.fail(key, "is " + given + " x " + given + "; must be " + wanted + " x " + wanted +
                        ", as system.M");
  }
  const Definiteness signs = definiteness(matrix);
  if (!signs.semidefinite) {
    const std::string limit =
        key == "K" ? "negative stiffness, as of an inverted pendulum or a buckled beam, is not "
                     "supported: between impacts the motion would grow without bound"
                   : "negative damping, as of flutter or self-excitation, is not supported: "
                     "between impacts the motion would grow without bound";
    table.fail(key, "has the eigenvalue " + rounded(signs.smallest) +
                        "; must be positive semidefinite (" + limit + ")");
  }
  return matrix;
}

Force read_force(const TomlTable& table, Eigen::Index f) {
  Force force{.direction = read_direction(table, f),
              .constant = table.number_or("constant", 0.0, any_number),
              .harmonic = {}};
  const bool oscillates = has_harmonic_keys(table);
  if (oscillates) force.harmonic = read_harmonic(table);
  if (has_record(table)) force.input = read_force_input(table);
  if (!force.input) refuse_record_keys(table);
  if (!oscillates && !force.input && !table.has("constant")) {
    table.fail_here("missing key " + table.path_of("constant") + " or " +
                    table.path_of("amplitude"));
  }
  return force;
}

void read_system_frame(const TomlTable& root, Scene& scene) {
  const auto table = root.table(
      "excitation", {"influence", "amplitude", "frequency", "phase", "file", "record", "time",
                     "acceleration", "displacement", "quantity", "unit", "interpolation", "outside",
                     "uncertainty", "gain", "delay", "stream", "stream_duration"});
  if (!table) return;
  Model& model = scene.model;
  Eigen::VectorXd influence = one_or_each(*table, "influence", model.coordinates());
  const FrameMotion motion = read_frame_motion(*table);
  ShakenFrame frame{.influence = std::move(influence),
                    .motion = motion.harmonic,
                    .force = model.forces.size(),
                    .on_ground = {},
                    .input = motion.input};
  model.forces.push_back(frame_force(model.M, frame));
  scene.frame = std::move(frame);
}

Contact read_system_contact(const TomlTable& table, int number, Eigen::Index f,
                            std::optional<ShakenFrame>& frame) {
  Contact contact{.w = read_direction(table, f),
                  .clearance = table.number_or("clearance", 0.0, any_number),
                  .motion = {}};
  if (sees_nothing(contact.w)) {
    table.fail("direction", "is zero; must have an entry that is not (the contact sees nothing)");
  }
  const auto motion = table.table("motion", {"amplitude", "frequency", "phase"});
  if (motion) contact.motion = read_harmonic(*motion);
  const bool mounted = table.has("mount");
  const bool on_ground = table.choice("mount", {"ground", "frame"}) == "ground";
  if (mounted && motion) {
    table.fail("mount", "and " + table.path_of("motion") +
                            " exclude each other; must be one of them (motion is all of s_i(t))");
  }
  if (mounted && !frame) {
    table.fail("mount", "needs a frame that is shaken; must go, or there must be [excitation]");
  }
  if (frame && on_ground && !motion) {
    contact.motion = ground_motion(contact.w, *frame);
    if (frame->input) {
      contact.input = frame->input;
      contact.input_share = contact.w.dot(frame->influence);
    }
    frame->on_ground.push_back(number);
  }
  return contact;
}

// Damping ratios of the kept modes alone do not determine C of all coordinates, which stays 0 until
// keep_modes(). Empty: C is given.
Eigen::VectorXd read_system_damping(const TomlTable& table, Model& model) {
  const Eigen::Index f = model.M.rows();
  if (const char* key = damping_ratio_key(table)) {
    if (table.has("modes") && !table.has("static_vectors")) {
      const auto modes = table.integer("modes", 1, static_cast<int>(f));
      if (table.numbers(key).size() == modes && modes < f) {
        model.C = Eigen::MatrixXd::Zero(f, f);
        return read_damping_ratio(table, key, {"C", "rayleigh"}, modes);
      }
    }
    model.C = damping_of_ratios(model, read_damping_ratio(table, key, {"C", "rayleigh"}, f));
  } else if (const auto rayleigh = table.table("rayleigh", {"alpha", "beta"})) {
    refuse_other(table, "rayleigh", {"C"});
    model.C = rayleigh->number("alpha", not_negative) * model.M +
              rayleigh->number("beta", not_negative) * model.K;
  } else {
    model.C = read_semidefinite(table, "C", f);
  }
  return {};
}

// Orders of static vectors, ascending.
StaticVectors read_static_vectors(const TomlTable& table) {
  StaticVectors vectors;
  for (const char* key : {"static_vectors", "static_damping_ratio"}) {
    if (table.has(key) && !table.has("modes")) {
      table.fail(key, "needs system.modes; must go, or there must be system.modes");
    }
  }
  if (!table.has("static_vectors")) {
    if (table.has("static_damping_ratio")) {
      table.fail("static_damping_ratio", "needs system.static_vectors; must go");
    }
    return vectors;
  }
  const Eigen::VectorXd orders = table.numbers("static_vectors");
  for (Eigen::Index i = 0; i < orders.size(); ++i) {
    if (orders[i] != std::floor(orders[i]) || orders[i] < 0.0 || orders[i] > largest_order ||
        (i > 0 && orders[i] <= orders[i - 1])) {
      table.fail("static_vectors", "has " + to_text(orders[i]) +
                                       "; must be whole numbers from 0 to " +
                                       std::to_string(largest_order) + ", ascending");
    }
    vectors.orders.push_back(static_cast<int>(orders[i]));
  }
  vectors.least_zeta = table.number_or("static_damping_ratio", 0.0, not_negative);
  return vectors;
}

// Projects a [system] with the key `modes` to its kept modes. `ratios`: damping ratios of the kept
// modes; empty: C is projected.
void keep_modes(const TomlTable& table, const Eigen::VectorXd& ratios,
                const std::vector<TomlTable>& contacts, Scene& scene) {
  const StaticVectors vectors = read_static_vectors(table);
  if (!table.has("modes")) return;
  const auto N = static_cast<int>(scene.model.coordinates());
  const int modes = table.integer("modes", 1, N);
  auto kept = std::make_shared<KeptModes>();
  try {
    *kept = kept_modes(scene.model, modes, vectors);
  } catch (const ModelError& error) {
    table.fail(vectors.orders.empty() ? "modes" : "static_vectors",
               std::string("is not possible: ") + error.what());
  }
  Model part = projected(scene.model, *kept, vectors.least_zeta);
  if (ratios.size() > 0) {
    part.C = Eigen::VectorXd(2.0 * ratios.cwiseProduct(kept->stiffness.cwiseSqrt())).asDiagonal();
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    // Rounding of the projection.
    const double limit = 1e-13 * kept->Phi.cwiseAbs().maxCoeff() * kept->given_w[i].lpNorm<1>();
    if (part.contacts[i].w.cwiseAbs().maxCoeff() > limit) continue;
    contacts[i].fail("direction", "is zero in the first " + std::to_string(modes) +
                                      " modes; must not be (keep more with system.modes, or set "
                                      "system.static_vectors = [0])");
  }
  if (scene.frame) {
    scene.frame->influence = kept->to_kept * scene.frame->influence;
    part.forces[scene.frame->force] = frame_force(part.M, *scene.frame);
  }
  scene.model = std::move(part);
  scene.kept = std::move(kept);
}

std::vector<TomlTable> read_system(const TomlTable& root, const TomlTable& table, Scene& scene,
                                   Eigen::VectorXd& ratios) {
  Model& model = scene.model;
  model.M = table.symmetric_matrix("M");
  const Definiteness signs = definiteness(model.M);
  if (!signs.definite()) {
    table.fail("M",
               "has the eigenvalue " + rounded(signs.smallest) + "; must be positive definite");
  }
  const Eigen::Index f = model.M.rows();
  model.K = read_semidefinite(table, "K", f);
  ratios = read_system_damping(table, model);
  for (const TomlTable& force :
       root.tables("force", {"direction", "constant", "amplitude", "frequency", "phase", "file",
                             "record", "time", "force", "unit", "interpolation", "outside",
                             "uncertainty", "gain", "delay"})) {
    model.forces.push_back(read_force(force, f));
  }
  read_system_frame(root, scene);
  std::vector<TomlTable> contacts =
      read_contact_tables(root, {"direction", "clearance", "motion", "mount", "restitution"});
  for (const TomlTable& contact : contacts) {
    const auto number = static_cast<int>(model.contacts.size());
    model.contacts.push_back(read_system_contact(contact, number, f, scene.frame));
  }
  if (const auto frame = root.open_table("excitation")) check_ground_supports(*frame, model);
  return contacts;
}

std::string read_output_name(const TomlTable& table, const std::vector<Output>& before) {
  const std::string name = table.required_string("name");
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto allowed = [&](char c) { return letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  constexpr std::size_t longest = 40;
  if (name.empty() || name.size() > longest || !letter(name[0]) ||
      !std::all_of(name.begin(), name.end(), allowed)) {
    table.fail("name", "is \"" + name + "\"; must be a letter and letters, digits or _, at most " +
                           std::to_string(longest));
  }
  if (is_column_of_states(name)) {
    table.fail("name", "is \"" + name + "\", which is a column of states already; must be another");
  }
  if (std::any_of(before.begin(), before.end(), [&](const Output& o) { return o.name == name; })) {
    table.fail("name", "is \"" + name + "\" again; must be another one");
  }
  return name;
}

void read_outputs(const TomlTable& root, Scene& scene) {
  std::vector<Output>& outputs = scene.model.outputs;
  const std::vector<TomlTable> tables =
      scene.beam ? root.tables("output", {"name", "position", "direction", "quantity", "unit"})
                 : root.tables("output", {"name", "direction", "quantity", "unit"});
  if (tables.size() > max_outputs) {
    tables[max_outputs].fail_here("output has " + std::to_string(tables.size()) +
                                  " tables; must have at most " + std::to_string(max_outputs));
  }
  for (const TomlTable& table : tables) {
    Output output{.name = read_output_name(table, outputs), .direction = {}};
    if (table.has("direction")) refuse_other(table, "direction", {"position"});
    output.direction =
        scene.beam && !table.has("direction")
            ? mode_shapes(*scene.beam, table.number("position", {0.0, scene.beam->length, true}))
            : read_direction(table, scene.model.coordinates());
    output.velocity = table.choice("quantity", {"displacement", "velocity"}) == "velocity";
    output.unit = table.string_or("unit", "");
    constexpr std::size_t longest_unit = 20;
    if (output.unit.size() > longest_unit) {
      table.fail("unit", "has " + std::to_string(output.unit.size()) +
                             " bytes; must have at most " + std::to_string(longest_unit));
    }
    outputs.push_back(std::move(output));
  }
}

struct Restitution {
  double slowest = 0.0;
  RestitutionCurve curve = {};
};

// Piecewise linear: { at = [0.1, 1.0], value = [0.9, 0.8] }.
Restitution read_restitution_points(const TomlTable& table) {
  const Eigen::VectorXd at = table.vector("at"), value = table.vector("value");
  if (at.size() < 2) table.fail("at", "must have at least 2 speeds");
  if (value.size() != at.size()) {
    table.fail("value", "has " + std::to_string(value.size()) + " entries; must have " +
                            std::to_string(at.size()) + ", one for each entry of at");
  }
  Restitution read{value[0], {}};
  for (Eigen::Index k = 0; k < at.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (!(at[k] >= 0.0)) table.fail("at", i, " is " + to_text(at[k]) + "; must be >= 0");
    if (k > 0 && !(at[k] > at[k - 1])) {
      table.fail(
          "at", i,
          " is " + to_text(at[k]) + "; must be > " + to_text(at[k - 1]) + ", the speed before it");
    }
    if (!(value[k] >= 0.0 && value[k] <= 1.0)) {
      table.fail("value", i, " is " + to_text(value[k]) + "; must be in [0, 1]");
    }
    if (!(value[0] > 0.0)) table.fail("value", 0, " is 0; must be > 0");
    read.curve.at.push_back(at[k]);
    read.curve.value.push_back(value[k]);
  }
  return read;
}

// A number, { value = 0.9, slope = -0.05 }, or points.
Restitution read_restitution(const TomlTable& table) {
  const Limits limits{0.0, 1.0};
  const toml::node* node = table.contents().get("restitution");
  if (node == nullptr || !node->is_table()) return {table.number("restitution", limits), {}};
  const TomlTable by_speed = *table.table("restitution", {"value", "slope", "at"});
  if (!by_speed.has("at")) {
    Restitution read{by_speed.number("value", limits), {}};
    read.curve.slope = by_speed.number("slope", any_number);
    if (read.curve.slope > 0.0) {
      by_speed.fail("slope", "is " + to_text(read.curve.slope) + "; must be <= 0");
    }
    return read;
  }
  if (by_speed.has("slope")) by_speed.fail("slope", "is given beside at; give one of both");
  const Restitution read = read_restitution_points(by_speed);
  Contact contact;
  contact.restitution = read.slowest;
  contact.curve = read.curve;
  constexpr double rounding = 1e-12;
  const double change = largest_change(contact);
  if (change > 1.0 + rounding) {
    by_speed.fail("value", "changes too fast: d(restitution * speed)/d(speed) is up to " +
                               rounded(change) +
                               " in size; must be at most 1, since an impact would bring two "
                               "motions apart");
  }
  return read;
}

// Reads [impact] and the restitutions. Returns whether the scene gives chatter_time.
bool read_impact(const TomlTable& root, const std::vector<TomlTable>& contacts, Model& model) {
  const auto impact = root.table("impact", {"law", "restitution", "chatter_time"});
  std::optional<Restitution> common;
  if (impact) {
    model.law = impact->choice("law", {"poisson", "newton"}) == "newton" ? ImpactLaw::newton
                                                                         : ImpactLaw::poisson;
    if (impact->has("chatter_time")) model.chatter_time = impact->number("chatter_time", positive);
    if (impact->has("restitution")) common = read_restitution(*impact);
  }
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (!common && !contacts[i].has("restitution")) {
      (impact ? *impact : contacts[i])
          .fail_here("missing key impact.restitution or " + contacts[i].path_of("restitution"));
    }
    const Restitution of = contacts[i].has("restitution") ? read_restitution(contacts[i]) : *common;
    model.contacts[i].restitution = of.slowest;
    model.contacts[i].curve = of.curve;
  }
  return impact && impact->has("chatter_time");
}

Eigen::VectorXd read_padded(const TomlTable& table, std::string_view key, Eigen::Index f) {
  Eigen::VectorXd padded = Eigen::VectorXd::Zero(f);
  if (!table.has(key)) return padded;
  const Eigen::VectorXd given = table.vector(key);
  if (given.size() > f) {
    table.fail(key, "has size " + std::to_string(given.size()) + "; must be at most " +
                        std::to_string(f) + ", the number of coordinates");
  }
  padded.head(given.size()) = given;
  return padded;
}

// The start of the file's coordinates, projected if the scene keeps some modes only.
State read_state(const TomlTable& table, const Scene& scene) {
  const Eigen::Index given = scene.kept ? scene.kept->given() : scene.model.coordinates();
  const State state{read_padded(table, "q", given), read_padded(table, "u", given)};
  return scene.kept ? projected(state, *scene.kept) : state;
}

// Admits the rounding of q and c of a start on the support.
bool starts_inside(const Contact& contact, const Eigen::VectorXd& q) {
  const double scale = contact.w.cwiseAbs().dot(q.cwiseAbs()) + std::abs(contact.clearance) +
                       std::abs(support_motion(contact, 0.0));
  return gap(contact, q, 0.0) < -1e-12 * scale;
}

// Whether master.q, in the file's coordinates, lies inside the support of contact i.
bool starts_inside_as_given(const TomlTable& master, const Scene& scene, std::size_t i) {
  Contact contact = scene.model.contacts[i];
  contact.w = scene.kept->given_w[i];
  return starts_inside(contact, read_padded(master, "q", scene.kept->given()));
}

void read_master(const TomlTable& root, Scene& scene) {
  const Model& model = scene.model;
  const auto table = root.table("master", {"q", "u", "penetration"});
  scene.truth.start = table ? read_state(*table, scene)
                            : State{Eigen::VectorXd::Zero(model.coordinates()),
                                    Eigen::VectorXd::Zero(model.coordinates())};
  scene.truth.given = table.has_value();
  scene.truth.release_penetration =
      table && table->choice("penetration", {"refuse", "release"}) == "release";
  if (scene.truth.release_penetration || !scene.truth.given) return;
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    if (!starts_inside(model.contacts[i], scene.truth.start.q)) continue;
    if (scene.kept && !starts_inside_as_given(*table, scene, i)) {
      scene.truth.release_penetration = true;
      table->remark("q", "starts inside the support of contact " + std::to_string(i + 1) +
                             " because modes are left out; the contact counts as closed until its "
                             "gap rises through 0, as with master.penetration = \"release\"");
      return;
    }
    const std::string number = std::to_string(i + 1);
    std::string message = "starts inside the support of contact " + number + ": its gap is ";
    message += rounded(gap(model.contacts[i], scene.truth.start.q, 0.0));
    message += "; must be >= 0 (move master.q or contact[" + number;
    message += "].clearance), or set master.penetration = \"release\"";
    table->fail("q", message);
  }
}

void read_replica_restitution(const TomlTable& table, std::vector<Contact>& contacts) {
  const Eigen::VectorXd epsilon =
      one_or_each(table, "restitution", static_cast<Eigen::Index>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const double value = epsilon[static_cast<Eigen::Index>(i)];
    if (!(std::abs(value) <= 1.0)) {
      table.fail("restitution", "has " + to_text(value) + "; must be in [-1, 1]");
    }
    contacts[i].replica_restitution = value;
  }
}

// With kept modes one number is the deviation of every coordinate of the file. The deviations of
// the kept coordinates follow from it, their correlations are omitted.
Eigen::VectorXd read_sigma(const TomlTable& table, const char* key, const Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd sigma = one_or_each(table, key, f);
  if (scene.kept && !table.contents().get(key)->is_array() && table.numbers(key).size() == 1) {
    sigma = sigma[0] * scene.kept->to_kept.rowwise().norm();
  }
  if (!(sigma.minCoeff() > 0.0)) {
    table.fail(key, "has " + to_text(sigma.minCoeff()) + "; must be > 0");
  }
  return sigma;
}

ConfidenceLevel read_confidence(const TomlTable& table) {
  const std::string given = table.string_or("confidence", name(ConfidenceLevel::high));
  for (const auto& [name, level] : confidence_choices<ConfidenceLevel>()) {
    if (given == name) return level;
  }
  table.fail("confidence", "is \"" + given + "\"; must be \"low\", \"medium\" or \"high\"");
}

void read_replica(const TomlTable& root, Scene& scene) {
  const Eigen::Index f = scene.model.coordinates();
  const auto table = root.table("replica", {"q", "u", "restitution", "uncertainty", "sigma_q",
                                            "sigma_u", "drift", "confidence"});
  scene.prior.start =
      table ? read_state(*table, scene) : State{Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)};
  if (table) {
    scene.prior.drift = table->number_or("drift", 0.0, not_negative);
    scene.prior.confidence = read_confidence(*table);
  }
  if (table && table->has("restitution")) read_replica_restitution(*table, scene.model.contacts);
  if (table && (table->has("sigma_q") || table->has("sigma_u"))) {
    refuse_other(*table, table->has("sigma_q") ? "sigma_q" : "sigma_u", {"uncertainty"});
    scene.prior.sigma =
        State{read_sigma(*table, "sigma_q", scene), read_sigma(*table, "sigma_u", scene)};
  }
  if (!table || !table->has("uncertainty")) return;
  const Eigen::VectorXd energies = table->numbers("uncertainty");
  if (energies.size() != 1 && energies.size() != f) {
    table->fail("uncertainty", "has " + std::to_string(energies.size()) +
                                   " numbers; must be one energy or " + std::to_string(f));
  }
  if (!(energies.minCoeff() > 0.0)) {
    table->fail("uncertainty", "has " + to_text(energies.minCoeff()) + "; must be > 0");
  }
  scene.prior.uncertainty =
      energies.size() == f ? energies
                           : Eigen::VectorXd::Constant(f, energies[0] / static_cast<double>(f));
}

void read_events(const TomlTable& root, Scene& scene) {
  const auto table = root.table("events", {"jitter"});
  if (table) scene.prior.jitter = table->number_or("jitter", 0.0, not_negative);
}

void read_clock(const TomlTable& root, Scene& scene) {
  const auto table = root.table("clock", {"rate", "offset"});
  if (!table) return;
  scene.clock = {.offset = table->number_or("offset", 0.0, any_number),
                 .rate = table->number_or("rate", 1.0, positive)};
}

void read_tolerance(const TomlTable& root, Scene& scene) {
  const auto table = root.table(
      "tolerance", {"time", "restitution", "stiffness", "damping", "force", "clearance"});
  if (!table) return;
  constexpr Limits share{.low = 0.0, .high = Tolerance::largest_share};
  constexpr Limits of_restitution{.low = 0.0, .high = Tolerance::largest_restitution};
  scene.prior.tolerance = {.time = table->number_or("time", 0.0, not_negative),
                           .restitution = table->number_or("restitution", 0.0, of_restitution),
                           .stiffness = table->number_or("stiffness", 0.0, share),
                           .damping = table->number_or("damping", 0.0, share),
                           .force = table->number_or("force", 0.0, not_negative),
                           .clearance = table->number_or("clearance", 0.0, not_negative)};
}

void read_adaptation(const TomlTable& root, Scene& scene) {
  const auto table = root.table("adapt", {"free", "within", "walk"});
  if (!table) return;
  Adaptation& adaptation = scene.prior.adaptation;
  if (table->has("free")) {
    adaptation.free = table->strings("free");
    if (adaptation.free.empty()) table->fail("free", "is empty; must name one parameter at least");
  }
  const std::vector<std::string>& keys = adaptation.free;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    try {
      parameter_of(scene, keys[i]);
    } catch (const std::invalid_argument& error) {
      table->fail("free", i, std::string(": ") + error.what());
    }
    if (std::find(keys.begin(), keys.begin() + static_cast<std::ptrdiff_t>(i), keys[i]) !=
        keys.begin() + static_cast<std::ptrdiff_t>(i)) {
      table->fail("free", i, " is " + keys[i] + " again; must be another one");
    }
  }
  const auto n = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(keys.size()));
  if (table->has("within")) {
    adaptation.within = one_or_each(*table, "within", n);
    if (!(adaptation.within.minCoeff() > 0.0 && adaptation.within.maxCoeff() <= 10.0)) {
      table->fail("within",
                  "has " +
                      to_text(adaptation.within.minCoeff() > 0.0 ? adaptation.within.maxCoeff()
                                                                 : adaptation.within.minCoeff()) +
                      "; must be in (0, 10]");
    }
  }
  if (table->has("walk")) {
    adaptation.walk = one_or_each(*table, "walk", n);
    if (!(adaptation.walk.minCoeff() >= 0.0)) {
      table->fail("walk", "has " + to_text(adaptation.walk.minCoeff()) + "; must be >= 0");
    }
  }
}

std::string contents(const std::filesystem::path& file) {
  errno = 0;
  std::ifstream in(file, std::ios::binary);
  std::string text;
  std::vector<char> buffer(65536);
  while (in.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) || in.gcount() > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(in.gcount()));
    if (text.size() <= largest_scene) continue;
    throw SceneError(file.string(), "is larger than " + std::to_string(largest_scene >> 20U) +
                                        " MiB, the most that is read (give large matrices as "
                                        "files of their own)");
  }
  if (!in.is_open() || in.bad()) {
    throw SceneError(file.string(), "cannot be read: " + std::generic_category().message(errno));
  }
  return text;
}

}  // namespace

SceneError::SceneError(std::string in_file, int at_line, int at_column, const std::string& problem)
    : Error(in_file + ":" + std::to_string(at_line) + ":" + std::to_string(at_column) + ": " +
            problem),
      file(std::move(in_file)),
      line(at_line),
      column(at_column),
      message(problem) {}

SceneError::SceneError(std::string in_file, const std::string& problem)
    : Error(in_file + ": " + problem), file(std::move(in_file)), message(problem) {}

SceneError::SceneError(const std::string& problem) : Error(problem), message(problem) {}

namespace {

Scene scene_of(TomlDocument& document, const std::string& file) {
  const TomlTable root =
      document.root({"name", "beam", "excitation", "system", "force", "impact", "contact", "output",
                     "master", "replica", "events", "clock", "tolerance", "adapt", "parameters"});
  Scene scene;
  scene.name = root.string_or("name", std::filesystem::path(file).stem().string());
  const auto beam = root.table("beam", {"modes", "length", "bending_stiffness", "mass_per_length",
                                        "damping", "damping_ratio", "modal_damping"});
  const auto system =
      root.table("system", {"M", "C", "K", "damping_ratio", "modal_damping", "rayleigh", "modes",
                            "static_vectors", "static_damping_ratio"});
  if (beam && system) system->fail_here("system and beam exclude each other; must be one of them");
  if (!beam && !system) root.fail_here("missing table [beam] or [system]");
  Eigen::VectorXd ratios;
  const std::vector<TomlTable> contacts =
      beam ? read_beam(root, *beam, scene) : read_system(root, *system, scene, ratios);
  read_outputs(root, scene);
  if (system) keep_modes(*system, ratios, contacts, scene);
  const bool chatter_time_given = read_impact(root, contacts, scene.model);
  read_master(root, scene);
  read_replica(root, scene);
  if (!chatter_time_given) {
    set_chatter_time(scene.model, scene.truth.given ? scene.truth.start : scene.prior.start);
  }
  read_events(root, scene);
  read_clock(root, scene);
  read_tolerance(root, scene);
  if (const auto excitation = root.open_table("excitation")) {
    scene.stream_duration = read_stream(*excitation, scene);
    if (scene.stream_duration > 0.0)
      scene.stream_unit = excitation->number_or("unit", 1.0, any_number);
  }
  read_adaptation(root, scene);
  scene.prior.parameters = read_parameters(root, scene);
  scene.remarks = document.remarks();
  return scene;
}

}  // namespace

Scene parse_scene(std::string_view text, const std::string& file) {
  TomlDocument document(text, {file, std::filesystem::path(file).parent_path()});
  return scene_of(document, file);
}

Scene read_scene(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path&)>& names) {
  const std::string text = contents(file);
  const bool piped = !std::filesystem::is_regular_file(file);
  TomlDocument document(text, {file.string(), piped ? "" : file.parent_path()});
  if (names) {
    for (const std::filesystem::path& named : document.files()) names(named);
  }
  return scene_of(document, file.string());
}

}  // namespace sprag
