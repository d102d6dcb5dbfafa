#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "python/src/members.h"
#include "python/src/settings.h"
#include "sprag/beam.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/detail/text/confidence_choices.h"
#include "sprag/energy.h"
#include "sprag/reduction.h"
#include "sprag/scene.h"
#include "sprag/scene_file.h"

namespace sprag::python {
namespace {

struct Record {
  std::string of;
  bool displacement = false;
  Eigen::VectorXd t, values;
};
SPRAG_MEMBERS(Record, of, displacement, t, values)

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

double required_positive(const char* name, double value) {
  require(value > 0.0 && std::isfinite(value),
          std::string(name) + " is " + std::to_string(value) + "; must be > 0");
  return value;
}

double required_not_negative(const char* name, double value) {
  require(value >= 0.0 && std::isfinite(value),
          std::string(name) + " is " + std::to_string(value) + "; must be >= 0");
  return value;
}

double required_finite(const char* name, double value) {
  require(std::isfinite(value), std::string(name) + " must be a finite number");
  return value;
}

using NumberOrVector = std::variant<double, Eigen::VectorXd>;

// One number for all, or n.
Eigen::VectorXd one_or_each(const char* name, const NumberOrVector& given, Eigen::Index n) {
  if (const auto* one = std::get_if<double>(&given)) return Eigen::VectorXd::Constant(n, *one);
  const auto& each = std::get<Eigen::VectorXd>(given);
  require(each.size() == n, std::string(name) + " has " + std::to_string(each.size()) +
                                " entries; must be one number or " + std::to_string(n));
  return each;
}

Eigen::VectorXd required_ratios(const NumberOrVector& given, Eigen::Index n) {
  Eigen::VectorXd ratios = one_or_each("damping_ratio", given, n);
  require(ratios.allFinite() && ratios.minCoeff() >= 0.0, "damping_ratio must be >= 0");
  return ratios;
}

Beam make_beam(int modes, double length, double bending_stiffness, double mass_per_length,
               double damping, const std::optional<NumberOrVector>& damping_ratio) {
  require(modes >= 1 && modes <= 200,
          "modes is " + std::to_string(modes) + "; must be from 1 to 200");
  require(!damping_ratio || damping == 0.0, "damping and damping_ratio exclude each other");
  return {modes,
          required_positive("length", length),
          required_positive("bending_stiffness", bending_stiffness),
          required_positive("mass_per_length", mass_per_length),
          required_not_negative("damping", damping),
          damping_ratio ? required_ratios(*damping_ratio, modes) : Eigen::VectorXd()};
}

Harmonic make_harmonic(double amplitude, double frequency, double phase) {
  return {required_finite("amplitude", amplitude), required_not_negative("frequency", frequency),
          required_finite("phase", phase)};
}

double required_restitution(double restitution) {
  require(restitution >= 0.0 && restitution <= 1.0,
          "restitution is " + std::to_string(restitution) + "; must be in [0, 1]");
  return restitution;
}

void require_restitution(const Contact& contact) {
  required_restitution(largest_restitution(contact));
  require(contact.curve.slope <= 0.0, "restitution: slope must be <= 0");
  const double change = largest_change(contact);
  require(change <= 1.0 + 1e-12, "restitution: |d(restitution * speed)/d(speed)| is up to " +
                                     std::to_string(change) + "; must be at most 1");
}

// A number, or one of the two tables of scene files.
void set_restitution(const py::object& restitution, Contact& contact) {
  if (!py::isinstance<py::dict>(restitution)) {
    contact.restitution = required_restitution(restitution.cast<double>());
    return;
  }
  const auto table = restitution.cast<std::map<std::string, py::object>>();
  RestitutionCurve& curve = contact.curve;
  const bool by_points = table.contains("at");
  require(table.size() == 2 && table.contains("value") && (by_points || table.contains("slope")),
          "restitution must be a number, {value, slope} or {at, value}");
  if (by_points) {
    curve.at = table.at("at").cast<std::vector<double>>();
    curve.value = table.at("value").cast<std::vector<double>>();
    require(curve.at.size() >= 2 && curve.at.size() == curve.value.size(),
            "restitution: at and value must have as many entries as the other, at least 2");
    require(curve.at.front() >= 0.0 &&
                std::is_sorted(curve.at.begin(), curve.at.end(), std::less_equal<double>()),
            "restitution: at must be >= 0 and ascend");
    require(curve.value.front() > 0.0 &&
                *std::min_element(curve.value.begin(), curve.value.end()) >= 0.0,
            "restitution: value must be >= 0, and its first entry > 0");
    contact.restitution = curve.value.front();
  } else {
    contact.restitution = required_restitution(table.at("value").cast<double>());
    curve.slope = required_finite("slope", table.at("slope").cast<double>());
  }
  require_restitution(contact);
}

Contact make_contact(Eigen::VectorXd w, const py::object& restitution, double clearance,
                     const Harmonic& motion) {
  require(w.allFinite() && !w.isZero(0.0), "w must be finite and not zero");
  Contact contact{std::move(w), required_finite("clearance", clearance), motion};
  set_restitution(restitution, contact);
  return contact;
}

// As in a scene file; None if the restitution is the same at all speeds.
py::object restitution_by_speed(const Contact& contact) {
  const RestitutionCurve& curve = contact.curve;
  if (curve.is_constant()) return py::none();
  py::dict table;
  if (curve.at.empty()) {
    table["value"] = contact.restitution;
    table["slope"] = curve.slope;
    return table;
  }
  const Eigen::VectorXd values = restitutions_at_points(contact);
  table["at"] = curve.at;
  table["value"] = std::vector<double>(values.begin(), values.end());
  return table;
}

Force make_force(Eigen::VectorXd direction, double constant, const Harmonic& harmonic) {
  require(direction.allFinite(), "direction must be finite");
  return {std::move(direction), required_finite("constant", constant), harmonic};
}

Output make_output(std::string name, Eigen::VectorXd direction, bool velocity, std::string unit) {
  require(direction.allFinite(), "direction must be finite");
  return {std::move(name), std::move(direction), velocity, std::move(unit)};
}

Rows gaps_of(const Scene& scene, const Eigen::VectorXd& t, const Rows& q) {
  const Model& model = scene.model;
  require(q.rows() == t.size() && q.cols() == model.coordinates(),
          "q must have a row of " + std::to_string(model.coordinates()) + " for each entry of t");
  Rows gaps(t.size(), std::ssize(model.contacts));
  for (Eigen::Index k = 0; k < t.size(); ++k) {
    for (Eigen::Index i = 0; i < gaps.cols(); ++i) {
      gaps(k, i) = gap(model.contacts[static_cast<std::size_t>(i)], q.row(k), t[k]);
    }
  }
  return gaps;
}

void require_symmetric(const char* name, const Eigen::MatrixXd& matrix, Eigen::Index f) {
  const std::string is(name);
  require(matrix.rows() == f && matrix.cols() == f && f > 0,
          is + " must be square and of M's size, not empty");
  require(matrix.allFinite() && matrix == matrix.transpose(),
          is + " must be finite and exactly symmetric");
}

bool is_semidefinite(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd all = eigenvalues(matrix);
  return all.allFinite() && all.minCoeff() >= -1e-12 * all.cwiseAbs().maxCoeff();
}

std::shared_ptr<Model> finished(Model model, std::vector<Contact> contacts,
                                const std::string& law) {
  const Eigen::Index f = model.coordinates();
  for (const Contact& contact : contacts) {
    require(contact.w.size() == f, "a contact's w must have as many entries as M has rows");
  }
  for (const Force& force : model.forces) {
    require(force.direction.size() == f,
            "a force's direction must have as many entries as M has rows");
  }
  for (const Output& output : model.outputs) {
    require(output.direction.size() == f,
            "an output's direction must have as many entries as M has rows");
  }
  require(!contacts.empty() && contacts.size() <= max_contacts,
          "a machine has from 1 to " + std::to_string(max_contacts) + " contacts");
  model.contacts = std::move(contacts);
  model.law = chosen<ImpactLaw>("law", law,
                                {{"poisson", ImpactLaw::poisson}, {"newton", ImpactLaw::newton}});
  return std::make_shared<Model>(std::move(model));
}

std::shared_ptr<Model> make_model(Eigen::MatrixXd M, std::optional<Eigen::MatrixXd> C,
                                  Eigen::MatrixXd K, std::vector<Contact> contacts,
                                  std::vector<Force> forces, const std::string& law,
                                  std::vector<Output> outputs,
                                  const std::optional<NumberOrVector>& damping_ratio,
                                  const std::optional<std::pair<double, double>>& rayleigh) {
  Model model;
  require((C ? 1 : 0) + (damping_ratio ? 1 : 0) + (rayleigh ? 1 : 0) == 1,
          "C, damping_ratio and rayleigh exclude each other; must be one of them");
  require_symmetric("M", M, M.rows());
  require_symmetric("K", K, M.rows());
  require(CholeskyFactor(M).exists(), "M must be positive definite");
  require(is_semidefinite(K), "K must be positive semidefinite");
  model.M = std::move(M);
  model.K = std::move(K);
  if (damping_ratio) {
    model.C = damping_of_ratios(model, required_ratios(*damping_ratio, model.M.rows()));
  } else if (rayleigh) {
    model.C = required_not_negative("alpha", rayleigh->first) * model.M +
              required_not_negative("beta", rayleigh->second) * model.K;
  } else {
    require_symmetric("C", *C, model.M.rows());
    require(is_semidefinite(*C), "C must be positive semidefinite");
    model.C = std::move(*C);
  }
  model.forces = std::move(forces);
  model.outputs = std::move(outputs);
  return finished(std::move(model), std::move(contacts), law);
}

Contact make_beam_contact(const Beam& beam, double position, double restitution,
                          const std::string& side, double clearance, const Harmonic& motion) {
  require(position > 0.0 && position <= beam.length,
          "position is " + std::to_string(position) + "; must be in (0, length]");
  const auto at = chosen<Side>("side", side, {{"below", Side::below}, {"above", Side::above}});
  return beam_contact(beam, position, at, required_finite("clearance", clearance),
                      required_restitution(restitution), motion);
}

Eigen::VectorXd padded(const char* name, const Eigen::VectorXd& given, Eigen::Index f) {
  require(given.size() <= f && given.allFinite(),
          std::string(name) + " must be finite, with at most " + std::to_string(f) + " entries");
  Eigen::VectorXd result = Eigen::VectorXd::Zero(f);
  result.head(given.size()) = given;
  return result;
}

State padded(const std::string& name, const State& state, Eigen::Index f) {
  return {padded((name + ".q").c_str(), state.q, f), padded((name + ".u").c_str(), state.u, f)};
}

void require_sigmas(const State& sigma, Eigen::Index f) {
  for (const Eigen::VectorXd* of : {&sigma.q, &sigma.u}) {
    require(of->size() == f && of->allFinite() && of->minCoeff() > 0.0,
            "sigma must have " + std::to_string(f) + " entries > 0 in q and in u");
  }
}

void require_outside(const Scene& scene) {
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    const Contact& contact = scene.model.contacts[i];
    const double scale = contact.w.cwiseAbs().dot(scene.truth.start.q.cwiseAbs()) +
                         std::abs(contact.clearance) + std::abs(support_motion(contact, 0.0));
    require(gap(contact, scene.truth.start.q, 0.0) >= -1e-12 * scale,
            "master starts inside the support of contact " + std::to_string(i + 1));
  }
}

Tolerance make_tolerance(double time, double restitution, double stiffness, double damping,
                         double force, double clearance) {
  const auto at_most = [](const char* name, double value, double most) {
    require(value <= most,
            std::string(name) + " must be in [0, " + (most == 1.0 ? "1" : "0.5") + "]");
    return required_not_negative(name, value);
  };
  return {.time = required_not_negative("time", time),
          .restitution = at_most("restitution", restitution, Tolerance::largest_restitution),
          .stiffness = at_most("stiffness", stiffness, Tolerance::largest_share),
          .damping = at_most("damping", damping, Tolerance::largest_share),
          .force = required_not_negative("force", force),
          .clearance = required_not_negative("clearance", clearance)};
}

// Adds a shaken frame: its force, and the motion of the supports on the ground.
void shake(const Harmonic& motion, const NumberOrVector& influence,
           const std::optional<std::vector<std::string>>& mount, Scene& scene) {
  Model& model = scene.model;
  ShakenFrame frame{.influence = one_or_each("influence", influence, model.coordinates()),
                    .motion = motion,
                    .force = model.forces.size(),
                    .on_ground = {}};
  require(frame.influence.allFinite(), "influence must be finite");
  require(!mount || mount->size() == model.contacts.size(),
          "mount must have one entry for each contact");
  model.forces.push_back(frame_force(model.M, frame));
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const std::string on = mount ? (*mount)[i] : "ground";
    if (chosen<bool>("mount", on, {{"ground", false}, {"frame", true}})) continue;
    require(model.contacts[i].motion.amplitude == 0.0,
            "contact " + std::to_string(i + 1) +
                " has a motion of its own; must be mounted on the frame");
    model.contacts[i].motion = ground_motion(model.contacts[i].w, frame);
    frame.on_ground.push_back(static_cast<int>(i));
  }
  scene.frame = std::move(frame);
}

// Projects model and starts to the first modes.
void keep_modes(int modes, const std::vector<int>& static_vectors, Scene& scene) {
  const auto N = static_cast<int>(scene.model.coordinates());
  require(modes >= 1 && modes <= N,
          "modes is " + std::to_string(modes) + "; must be from 1 to " + std::to_string(N));
  for (std::size_t i = 0; i < static_vectors.size(); ++i) {
    require(static_vectors[i] >= (i > 0 ? static_vectors[i - 1] + 1 : 0) && static_vectors[i] <= 3,
            "static_vectors must be whole numbers from 0 to 3, ascending");
  }
  auto kept = std::make_shared<KeptModes>(kept_modes(scene.model, modes, {static_vectors, 0.0}));
  scene.model = projected(scene.model, *kept);
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    require(scene.model.contacts[i].w.norm() > 1e-12 * kept->given_w[i].norm(),
            "contact " + std::to_string(i + 1) + " does not see the modes that are kept");
  }
  scene.truth.start = projected(scene.truth.start, *kept);
  scene.prior.start = projected(scene.prior.start, *kept);
  if (scene.frame) {
    scene.frame->influence = kept->to_kept * scene.frame->influence;
    scene.model.forces[scene.frame->force] = frame_force(scene.model.M, *scene.frame);
  }
  scene.kept = std::move(kept);
}

// The scene with other values of parameters, by their keys in scene files.
std::shared_ptr<Scene> with_values(const Scene& scene,
                                   const std::map<std::string, double>& values) {
  std::vector<std::string> keys;
  Eigen::VectorXd numbers(static_cast<Eigen::Index>(values.size()));
  for (const auto& [key, number] : values) {
    numbers[static_cast<Eigen::Index>(keys.size())] = required_finite(key.c_str(), number);
    keys.push_back(key);
  }
  auto changed = std::make_shared<Scene>(with(scene, parameters_named(scene, keys), numbers));
  for (const Contact& contact : changed->model.contacts) {
    require_restitution(contact);
    require(!contact.w.isZero(0.0), "the direction of a contact must not be zero");
  }
  require(definiteness(changed->model.M).definite(), "M must stay positive definite");
  require(is_semidefinite(changed->model.C) && is_semidefinite(changed->model.K),
          "C and K must stay positive semidefinite");
  for (std::size_t i = 0; i < changed->positions.size(); ++i) {
    const double x = changed->positions[i];
    require(x > 0.0 && x <= changed->beam->length,
            "contact." + std::to_string(i + 1) + ".position must be in (0, length]");
  }
  return changed;
}

// Standard deviations of parameters by key, without correlation.
ParameterUncertainty uncertain(const Scene& scene, const std::map<std::string, double>& sigmas) {
  ParameterUncertainty parameters;
  const auto P = static_cast<Eigen::Index>(sigmas.size());
  parameters.sigma.resize(P);
  for (const auto& [key, sigma] : sigmas) {
    require(can_be_filtered(parameter_of(scene, key)), key + " cannot be a parameter of a filter");
    parameters.sigma[std::ssize(parameters.keys)] = required_positive(key.c_str(), sigma);
    parameters.keys.push_back(key);
  }
  parameters.correlation.setIdentity(P, P);
  parameters.consider.assign(sigmas.size(), false);
  return parameters;
}

std::shared_ptr<Scene> replaced(const Scene& scene, const std::optional<State>& master,
                                const std::optional<State>& replica,
                                const std::optional<NumberOrVector>& uncertainty,
                                const std::optional<State>& sigma, std::optional<double> drift,
                                std::optional<double> jitter,
                                const std::optional<std::string>& name,
                                const std::optional<Tolerance>& tolerance,
                                const std::optional<std::map<std::string, double>>& parameters,
                                const std::optional<std::string>& confidence) {
  const Eigen::Index f = scene.model.coordinates();
  auto changed = std::make_shared<Scene>(scene);
  Prior& prior = changed->prior;
  if (master) {
    changed->truth.start = padded("master", *master, f);
    changed->truth.given = true;
    if (!changed->truth.release_penetration) require_outside(*changed);
  }
  if (replica) prior.start = padded("replica", *replica, f);
  require(!uncertainty || !sigma, "uncertainty and sigma exclude each other");
  if (uncertainty) {
    prior.uncertainty = one_or_each("uncertainty", *uncertainty, f);
    if (std::holds_alternative<double>(*uncertainty)) prior.uncertainty /= static_cast<double>(f);
    require(prior.uncertainty.allFinite() && prior.uncertainty.minCoeff() > 0.0,
            "uncertainty must be > 0");
    prior.sigma.reset();
  }
  if (sigma) {
    require_sigmas(*sigma, f);
    prior.sigma = sigma;
    prior.uncertainty.resize(0);
  }
  if (drift) prior.drift = required_not_negative("drift", *drift);
  if (jitter) prior.jitter = required_not_negative("jitter", *jitter);
  if (name) changed->name = *name;
  if (tolerance) prior.tolerance = *tolerance;
  if (parameters) prior.parameters = uncertain(scene, *parameters);
  if (confidence) {
    prior.confidence = chosen("confidence", *confidence, confidence_choices<ConfidenceLevel>());
  }
  return changed;
}

std::shared_ptr<Scene> make_scene(const Model& model, const State& master, const State& replica,
                                  const std::optional<NumberOrVector>& uncertainty, double drift,
                                  double jitter, std::optional<double> chatter_time,
                                  std::string name, const std::optional<State>& sigma,
                                  const std::optional<Tolerance>& tolerance,
                                  const std::optional<Harmonic>& excitation,
                                  const std::optional<NumberOrVector>& influence,
                                  const std::optional<std::vector<std::string>>& mount,
                                  std::optional<int> modes,
                                  const std::vector<int>& static_vectors) {
  Scene scene;
  scene.name = std::move(name);
  scene.model = model;
  require(excitation.has_value() == influence.has_value() && (excitation || !mount),
          "excitation and influence belong together, and mount to them");
  if (excitation) shake(*excitation, *influence, mount, scene);
  scene.truth.start = padded("master", master, model.coordinates());
  scene.prior.start = padded("replica", replica, model.coordinates());
  require(modes || static_vectors.empty(), "static_vectors needs modes");
  if (modes) keep_modes(*modes, static_vectors, scene);
  require_outside(scene);
  if (chatter_time) {
    scene.model.chatter_time = required_positive("chatter_time", *chatter_time);
  } else {
    set_chatter_time(scene.model, scene.truth.start);
  }
  return replaced(scene, {}, {}, uncertainty, sigma, drift, jitter, {}, tolerance, {}, {});
}

std::shared_ptr<Scene> with_warnings(Scene scene) {
  for (const std::string& remark : scene.remarks) warn(remark);
  return std::make_shared<Scene>(std::move(scene));
}

void bind_beam(py::module_& module) {
  value_class<Harmonic>(module, "Harmonic",
                        "amplitude cos(frequency t + phase); frequency >= 0 [rad/s].")
      .def(py::init(&make_harmonic), "amplitude"_a = 0.0, "frequency"_a = 0.0, "phase"_a = 0.0)
      .get("amplitude", "In the unit of the quantity.", &Harmonic::amplitude)
      .get("frequency", "[rad/s], >= 0.", &Harmonic::frequency)
      .get("phase", "[rad].", &Harmonic::phase);

  value_class<Beam>(module, "Beam",
                    "Clamped-free Euler-Bernoulli beam by its first modes: length [m], "
                    "bending_stiffness EI [N m^2], mass_per_length [kg/m], damping [N s/m^2] or in "
                    "its place damping_ratio, one number or one each mode.")
      .def(py::init(&make_beam), "modes"_a, "length"_a = 1.0, "bending_stiffness"_a = 1.0,
           "mass_per_length"_a = 1.0, "damping"_a = 0.0, "damping_ratio"_a = py::none())
      .get("modes", "Number n of modes.", &Beam::modes)
      .get("length", "l [m].", &Beam::length)
      .get("bending_stiffness", "EI [N m^2].", &Beam::bending_stiffness)
      .get("mass_per_length", "rho A [kg/m].", &Beam::mass_per_length)
      .get("damping", "d [N s/m^2]; 0 where damping_ratio is used.", &Beam::damping)
      .get(
          "damping_ratio", "Damping ratio of each mode, n entries; None where damping is used.",
          [](const Beam& beam, py::handle self) { return view_or_none(beam.damping_ratio, self); });
}

void bind_model(py::module_& module) {
  value_class<Contact>(
      module, "Contact",
      "One unilateral contact, gap w^T q + motion(t) + clearance [m], with a "
      "restitution in [0, 1]; w has f entries. restitution: a number, or a dict "
      "as that of restitution_by_speed. Raises ValueError if an impact could "
      "bring two motions apart: d(restitution * speed)/d(speed) must be in [-1, 1].")
      .def(py::init(&make_contact), "w"_a, "restitution"_a, "clearance"_a = 0.0,
           "motion"_a = Harmonic{})
      .get("w", "Direction, f entries.", &Contact::w)
      .get("restitution", "In [0, 1]; of the slowest impacts if it depends on the speed.",
           &Contact::restitution)
      .get("restitution_by_speed",
           "{'value': number, 'slope': number [s/m]} or {'at': speeds [m/s], 'value': numbers}, as "
           "in scene files; None if the restitution is the same at all speeds.",
           &restitution_by_speed)
      .get("clearance", "c [m].", &Contact::clearance)
      .get("motion", "Harmonic motion of the support [m].", &Contact::motion)
      .get("recorded", "Whether a recorded input moves the support, too.",
           [](const Contact& contact) { return contact.input != nullptr; });

  value_class<Force>(module, "Force",
                     "f(t) += direction (constant + harmonic(t)); direction has f entries.")
      .def(py::init(&make_force), "direction"_a, "constant"_a = 0.0, "harmonic"_a = Harmonic{})
      .get("direction", "f entries.", &Force::direction)
      .get("constant", "Constant part.", &Force::constant)
      .get("harmonic", "Harmonic part.", &Force::harmonic)
      .get("recorded", "Whether a recorded input is a part of the force, too.",
           [](const Force& force) { return force.input != nullptr; });

  value_class<Output>(module, "Output",
                      "A quantity with a name: direction^T q, or with velocity direction^T u; "
                      "direction has f entries.")
      .def(py::init(&make_output), "name"_a, "direction"_a, "velocity"_a = false, "unit"_a = "")
      .get("name", "Name of the column.", &Output::name)
      .get("direction", "f entries.", &Output::direction)
      .get("velocity", "Whether it is direction^T u, not direction^T q.", &Output::velocity)
      .get("unit", "As in the scene file; empty where not given.", &Output::unit);

  value_class<Model, std::shared_ptr<Model>>(
      module, "Model",
      "M u' + C u + K q = W lambda + f(t), q' = u, f coordinates and at least one contact. M, C "
      "and K are f x f and exactly symmetric, M positive definite, C and K semidefinite. Where C "
      "is None, damping_ratio gives C by one number or one each natural mode, by frequency, or "
      "rayleigh = (alpha, beta) gives C = alpha M + beta K. For a shaken frame see Scene.")
      .def(py::init(&make_model), "M"_a, "C"_a, "K"_a, "contacts"_a,
           "forces"_a = std::vector<Force>{}, "law"_a = "poisson",
           "outputs"_a = std::vector<Output>{}, py::kw_only(), "damping_ratio"_a = py::none(),
           "rayleigh"_a = py::none())
      .get("f", "Number of coordinates.", &Model::coordinates)
      .get("M", "Mass matrix, f x f.", &Model::M)
      .get("C", "Damping matrix, f x f.", &Model::C)
      .get("K", "Stiffness matrix, f x f.", &Model::K)
      .get("contacts", "Contacts, m entries.", &Model::contacts)
      .get("forces", "Forces; that of a shaken frame is one of them.", &Model::forces)
      .get("outputs", "Quantities that have a name.", &Model::outputs)
      .get("law", "Impact law, 'poisson' or 'newton'.",
           [](const Model& model) { return model.law == ImpactLaw::newton ? "newton" : "poisson"; })
      .get("chatter_time", "Rest of a bounce sequence below which it is completed [s].",
           &Model::chatter_time);

  module.def(
      "beam_model",
      [](const Beam& beam, std::vector<Contact> contacts, const Harmonic& excitation,
         const std::string& law, std::vector<Output> outputs) {
        Model model = beam_model(beam, excitation);
        model.outputs = std::move(outputs);
        return finished(std::move(model), std::move(contacts), law);
      },
      "beam"_a, "contacts"_a, "excitation"_a = Harmonic{}, "law"_a = "poisson",
      "outputs"_a = std::vector<Output>{},
      "The model of a beam with contacts, as of beam_contact(). excitation: motion of its frame "
      "[m].");
  module.def(
      "beam_contact", &make_beam_contact, "beam"_a, "position"_a, "restitution"_a,
      "side"_a = "below", "clearance"_a = 0.0, "motion"_a = Harmonic{},
      "A support at position in (0, length] [m], \"below\" the beam or \"above\". motion: that of "
      "the frame where the support stands on the ground; none where it moves with the frame.");
}

void bind_scene_parts(py::module_& module) {
  value_class<State>(module, "State", "Coordinates q and velocities u, f entries each.")
      .def(py::init([](Eigen::VectorXd q, Eigen::VectorXd u) {
             return State{std::move(q), std::move(u)};
           }),
           "q"_a = Eigen::VectorXd{}, "u"_a = Eigen::VectorXd{})
      .get("q", "Coordinates, f entries.", &State::q)
      .get("u", "Velocities, f entries.", &State::u);

  value_class<Record>(
      module, "Record",
      "A recorded input: of is \"excitation\" or the key of its force, as \"force.2\"; n sample "
      "times t [s] and values, with the delay and the gain of the sensor: the frame's acceleration "
      "[m/s^2], or where displacement is true its motion [m], or the force.")
      .get("of", "'excitation', or the key of a force.", &Record::of)
      .get("displacement", "Whether the values are motions [m], not accelerations or forces.",
           &Record::displacement)
      .get("t", "Times of the samples [s], n entries.", &Record::t)
      .get("values", "The samples, n entries.", &Record::values);

  value_class<ParameterUncertainty>(
      module, "ParameterUncertainty",
      "How uncertain parameters of a machine are, [parameters] of its scene: P standard "
      "deviations, in the units of the parameters' values, and their correlation, P x P.")
      .get("keys", "Keys of the parameters, P entries.", &ParameterUncertainty::keys)
      .get("sigma", "Standard deviations, P entries.", &ParameterUncertainty::sigma)
      .get("correlation", "P x P.", &ParameterUncertainty::correlation)
      .get("consider", "Whether a filter only considers each, and never corrects it.",
           &ParameterUncertainty::consider);

  value_class<Tolerance>(
      module, "Tolerance",
      "Hard limits of deviations, [tolerance] of a scene, for which the bound on V is proven: time "
      "[s], of each event; restitution, absolute; stiffness and damping, as shares of K and C, at "
      "most 0.5; force, in the norm of the inverse of M; clearance [m].")
      .def(py::init(&make_tolerance), py::kw_only(), "time"_a = 0.0, "restitution"_a = 0.0,
           "stiffness"_a = 0.0, "damping"_a = 0.0, "force"_a = 0.0, "clearance"_a = 0.0)
      .get("time", "Of each event [s].", &Tolerance::time)
      .get("restitution", "Absolute.", &Tolerance::restitution)
      .get("stiffness", "Share of K.", &Tolerance::stiffness)
      .get("damping", "Share of C.", &Tolerance::damping)
      .get("force", "In the norm of the inverse of M.", &Tolerance::force)
      .get("clearance", "[m].", &Tolerance::clearance);

  value_class<KeptModes, std::shared_ptr<KeptModes>>(
      module, "KeptModes",
      "Coordinates of a scene that keeps some modes of N coordinates: q_given = Phi q, q = to_kept "
      "q_given.")
      .get("modes", "Number of modes; the rest are static vectors.", &KeptModes::modes)
      .get("Phi", "N x f.", &KeptModes::Phi)
      .get("to_kept", "Phi^T M, f x N.", &KeptModes::to_kept);
}

using SceneClass = ValueClass<Scene, std::shared_ptr<Scene>>;

// A beam has no forces but that of its excitation.
bool is_of_excitation(const Scene& scene, std::size_t force) {
  return scene.beam.has_value() || (scene.frame && scene.frame->force == force);
}

std::vector<Record> records_of(const Scene& scene) {
  std::vector<Record> records;
  for (std::size_t i = 0; i < scene.model.forces.size(); ++i) {
    const SampledInputPointer& input = scene.model.forces[i].input;
    if (!input) continue;
    const SampledInput::Settings& settings = input->settings();
    const auto& t = input->sample_times();
    const auto& values = input->sample_values();
    const auto n = static_cast<Eigen::Index>(t.size());
    records.push_back({is_of_excitation(scene, i) ? "excitation" : "force." + std::to_string(i + 1),
                       settings.displacement,
                       Eigen::Map<const Eigen::VectorXd>(t.data(), n).array() + settings.delay,
                       settings.gain * Eigen::Map<const Eigen::VectorXd>(values.data(), n)});
  }
  return records;
}

void bind_scene_values(SceneClass& of_scene) {
  of_scene.get("f", "Number of coordinates.", &Scene::model, &Model::coordinates)
      .get("m", "Number of contacts.",
           [](const Scene& scene) { return scene.model.contacts.size(); })
      .get("model", "The Model.", &Scene::model)
      .get("beam", "None where the scene is not of a beam.", &Scene::beam)
      .get("positions",
           "x_c of a beam's contacts [m], m entries; empty where the scene is not of a beam.",
           [](const Scene& scene) { return std::vector(scene.positions); })
      .get("excitation",
           "Harmonic motion e(t) of the frame of a [system] [m]; None where it has no excitation.",
           [](const Scene& scene) {
             return scene.frame ? std::optional(scene.frame->motion) : std::nullopt;
           })
      .get("is_shaken", "Whether the coordinates are measured against a shaken frame.",
           [](const Scene& scene) {
             return scene.frame.has_value() || (scene.beam && !scene.model.forces.empty());
           })
      .get("records", "Records of the excitation and of forces, in the order of forces.",
           &records_of)
      .get("master", "Start of the machine.", &Scene::truth, &Truth::start)
      .get("replica", "Start of the replica.", &Scene::prior, &Prior::start)
      .get("uncertainty", "Energies of the replica's start, f entries; None where not given.",
           [](const Scene& scene, py::handle self) {
             return view_or_none(scene.prior.uncertainty, self);
           })
      .get("sigma", "Standard deviations of the replica's start; None where not given.",
           &Scene::prior, &Prior::sigma)
      .get("drift", "Energy of the model's process noise per unit of time.", &Scene::prior,
           &Prior::drift)
      .get("parameters", "Uncertainty of the machine's parameters; None where not given.",
           [](const Scene& scene) -> const ParameterUncertainty* {
             return scene.prior.parameters.empty() ? nullptr : &scene.prior.parameters;
           })
      .get("jitter", "Standard deviation of event times [s].", &Scene::prior, &Prior::jitter)
      .get("confidence",
           "How sure the filter must be before it is shown: \"low\", \"medium\" or \"high\".",
           [](const Scene& scene) { return name(scene.prior.confidence); })
      .def(
          "machine_time", [](const Scene& scene, double t) { return machine_time(scene.clock, t); },
          "t"_a,
          "The machine's time at a reading of the contact clock [s], by the scene's [clock].")
      .def("gaps", &gaps_of, "t"_a, "q"_a,
           "Gaps g(q, t) of all contacts [m], n x m, for times t, n entries, and q, n x f.")
      .get("tolerance", "Hard limits of the deviations of machine and event times.", &Scene::prior,
           &Prior::tolerance);
}

void bind_scene(py::module_& module) {
  SceneClass of_scene = value_class<Scene, std::shared_ptr<Scene>>(
      module, "Scene",
      "A machine, the starts of its master and its replica, and their uncertainty. Starts may have "
      "fewer than f entries: the rest is 0. uncertainty: energy of the replica's start, or f of "
      "them, or in its place sigma: standard deviations of its q and u, as a State; drift: energy "
      "per unit of time; jitter: standard deviation of event times [s]; chatter_time [s]: from the "
      "machine's own time where it is not given; tolerance: hard limits of deviations, for the "
      "bound on V. excitation: motion e(t) of a shaken frame [m], against which the model's "
      "coordinates are measured, with influence r in its force -M r e''(t), one number or f; "
      "mount: \"ground\" (default) or \"frame\" for each contact. modes: number of lowest modes to "
      "keep, and static_vectors: orders of static vectors of the contacts; model and starts then "
      "have the N coordinates of the given model, all else those of kept.");
  of_scene
      .def(py::init(&make_scene), "model"_a, py::kw_only(), "master"_a = State{},
           "replica"_a = State{}, "uncertainty"_a = py::none(), "drift"_a = 0.0, "jitter"_a = 0.0,
           "chatter_time"_a = py::none(), "name"_a = "", "sigma"_a = py::none(),
           "tolerance"_a = py::none(), "excitation"_a = py::none(), "influence"_a = py::none(),
           "mount"_a = py::none(), "modes"_a = py::none(), "static_vectors"_a = std::vector<int>{})
      .def("with_values", &with_values, "values"_a,
           "The scene with other values of parameters: a dict by their keys in scene files, such "
           "as 'impact.restitution' or 'system.K' (a factor). Raises ValueError.")
      .def(
          "replace", &replaced, py::kw_only(), "master"_a = py::none(), "replica"_a = py::none(),
          "uncertainty"_a = py::none(), "sigma"_a = py::none(), "drift"_a = py::none(),
          "jitter"_a = py::none(), "name"_a = py::none(), "tolerance"_a = py::none(),
          "parameters"_a = py::none(), "confidence"_a = py::none(),
          "The scene with other starts and uncertainties, in the scene's f coordinates; arguments "
          "as of Scene(); parameters: standard deviations of uncertain parameters, a dict by their "
          "keys in scene files; confidence: \"low\", \"medium\" or \"high\". Raises ValueError.")
      .get("name", "Name for people.", &Scene::name)
      .get("kept", "The KeptModes of a scene with system.modes; None: all coordinates are kept.",
           [](const Scene& scene) { return scene.kept.get(); });
  bind_scene_values(of_scene);
}

void bind_scene_files(py::module_& module) {
  module.def(
      "read_scene",
      [](const std::filesystem::path& file) {
        const py::module_ core = py::module_::import("sprag._core");
        const auto folder = shipped_scenes(core.attr("__file__").cast<std::string>());
        const std::filesystem::path found = find_scene(file, folder);
        if (const std::string why = scene_not_found(found, folder); !why.empty()) {
          throw SceneError(found.string(), "cannot be read: " + why);
        }
        return with_warnings(read_scene(found));
      },
      "file"_a,
      "Reads and checks a scene file, and the files that it names; or the scene of this name that "
      "comes with Sprag, as \"paper_beam\". Remarks on it are RuntimeWarnings. Raises SceneError.");
  module.def(
      "parse_scene",
      [](const std::string& text, const std::string& file) {
        return with_warnings(parse_scene(text, file));
      },
      "text"_a, "file"_a = "scene.toml",
      "The same from text; file is the name that errors carry. Raises SceneError.");
  module.def(
      "to_toml",
      [](const Scene& scene, const std::string& comment) { return to_toml(scene, comment); },
      "scene"_a, py::kw_only(), "comment"_a = "",
      "The text of a scene file of the same machine, starts and uncertainties, with all digits. "
      "parse_scene() reads it as an equal scene, but for two: a beam that its keys do not describe "
      "becomes a [system], and a [system] with the key `modes` one of the kept coordinates. "
      "Recorded inputs are written with their samples. Raises SceneError for streamed inputs, and "
      "in kept modes for supports that move with a record.");
  module.def("write_scene", &write_scene, "file"_a, "scene"_a, py::kw_only(), "comment"_a = "",
             "Writes to_toml() to a file. Raises sprag.Error if it cannot be written.");
}

}  // namespace

void bind_machines(py::module_& module) {
  bind_beam(module);
  bind_model(module);
  bind_scene_parts(module);
  bind_scene(module);
  bind_scene_files(module);
}

}  // namespace sprag::python
