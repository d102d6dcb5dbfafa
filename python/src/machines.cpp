#include "python/src/machines.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "python/src/arrays.h"
#include "sprag/beam.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene.h"
#include "sprag/scene_file.h"

namespace sprag::python {
namespace {

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

Beam make_beam(int modes, double length, double bending_stiffness, double mass_per_length,
               double damping) {
  require(modes >= 1 && modes <= 200,
          "modes is " + std::to_string(modes) + "; must be from 1 to 200");
  return {modes, required_positive("length", length),
          required_positive("bending_stiffness", bending_stiffness),
          required_positive("mass_per_length", mass_per_length),
          required_not_negative("damping", damping)};
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

Contact make_contact(Eigen::VectorXd w, double restitution, double clearance,
                     const Harmonic& motion) {
  require(w.allFinite() && !w.isZero(0.0), "w must be finite and not zero");
  return {std::move(w), required_finite("clearance", clearance), motion,
          required_restitution(restitution)};
}

Force make_force(Eigen::VectorXd direction, double constant, const Harmonic& harmonic) {
  require(direction.allFinite(), "direction must be finite");
  return {std::move(direction), required_finite("constant", constant), harmonic};
}

Output make_output(std::string name, Eigen::VectorXd direction, bool velocity) {
  require(direction.allFinite(), "direction must be finite");
  return {std::move(name), std::move(direction), velocity};
}

ImpactLaw to_law(const std::string& law) {
  if (law == "poisson") return ImpactLaw::poisson;
  require(law == "newton", "law is \"" + law + "\"; must be \"poisson\" or \"newton\"");
  return ImpactLaw::newton;
}

void require_symmetric(const char* name, const Eigen::MatrixXd& matrix, Eigen::Index f) {
  const std::string is(name);
  require(matrix.rows() == f && matrix.cols() == f && f > 0,
          is + " must be square and of M's size, not empty");
  require(matrix.allFinite() && matrix == matrix.transpose(),
          is + " must be finite and exactly symmetric");
}

void require_semidefinite(const char* name, const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd values = eigenvalues(matrix);
  require(values.minCoeff() >= -1e-12 * values.cwiseAbs().maxCoeff(),
          std::string(name) + " must be positive semidefinite");
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
  model.law = to_law(law);
  return std::make_shared<Model>(std::move(model));
}

std::shared_ptr<Model> make_model(Eigen::MatrixXd M, Eigen::MatrixXd C, Eigen::MatrixXd K,
                                  std::vector<Contact> contacts, std::vector<Force> forces,
                                  const std::string& law, std::vector<Output> outputs) {
  Model model;
  require_symmetric("M", M, M.rows());
  require_symmetric("C", C, M.rows());
  require_symmetric("K", K, M.rows());
  require(CholeskyFactor(M).exists(), "M must be positive definite");
  require_semidefinite("C", C);
  require_semidefinite("K", K);
  model.M = std::move(M);
  model.C = std::move(C);
  model.K = std::move(K);
  model.forces = std::move(forces);
  model.outputs = std::move(outputs);
  return finished(std::move(model), std::move(contacts), law);
}

Side to_side(const std::string& side) {
  if (side == "below") return Side::below;
  require(side == "above", "side is \"" + side + "\"; must be \"below\" or \"above\"");
  return Side::above;
}

Contact make_beam_contact(const Beam& beam, double position, double restitution,
                          const std::string& side, double clearance, const Harmonic& motion) {
  require(position > 0.0 && position <= beam.length,
          "position is " + std::to_string(position) + "; must be in (0, length]");
  return beam_contact(beam, position, to_side(side), required_finite("clearance", clearance),
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

std::shared_ptr<Scene> make_scene(const Model& model, const State& master, const State& replica,
                                  const std::optional<Eigen::VectorXd>& uncertainty, double drift,
                                  double jitter, std::optional<double> chatter_time,
                                  std::string name, const std::optional<State>& sigma,
                                  const std::optional<Tolerance>& tolerance) {
  const Eigen::Index f = model.coordinates();
  auto scene = std::make_shared<Scene>();
  scene->name = std::move(name);
  scene->model = model;
  scene->truth.start = padded("master", master, f);
  scene->prior.start = padded("replica", replica, f);
  require_outside(*scene);
  if (uncertainty) {
    require(uncertainty->size() == f && uncertainty->allFinite() && uncertainty->minCoeff() > 0.0,
            "uncertainty must have " + std::to_string(f) + " energies > 0");
    scene->prior.uncertainty = *uncertainty;
  }
  if (sigma) {
    const auto usable = [f](const Eigen::VectorXd& of) {
      return of.size() == f && of.allFinite() && of.minCoeff() > 0.0;
    };
    require(!uncertainty, "uncertainty and sigma exclude each other");
    require(usable(sigma->q) && usable(sigma->u),
            "sigma must have " + std::to_string(f) + " entries > 0 in q and in u");
    scene->prior.sigma = sigma;
  }
  scene->prior.drift = required_not_negative("drift", drift);
  scene->prior.jitter = required_not_negative("jitter", jitter);
  if (tolerance) scene->prior.tolerance = *tolerance;
  if (chatter_time) {
    scene->model.chatter_time = required_positive("chatter_time", *chatter_time);
  } else {
    set_chatter_time(scene->model, scene->truth.start);
  }
  return scene;
}

std::shared_ptr<Scene> with_warnings(Scene scene) {
  for (const std::string& remark : scene.remarks) {
    if (PyErr_WarnEx(PyExc_RuntimeWarning, remark.c_str(), 1) != 0) throw py::error_already_set();
  }
  return std::make_shared<Scene>(std::move(scene));
}

template <typename Class>
auto vector_property(Eigen::VectorXd Class::*member) {
  return [member](const py::object& self) { return view(self.cast<const Class&>().*member, self); };
}

template <typename Class>
auto matrix_property(Eigen::MatrixXd Class::*member) {
  return [member](const py::object& self) { return view(self.cast<const Class&>().*member, self); };
}

void bind_beam(py::module_& module) {
  py::class_<Harmonic>(module, "Harmonic",
                       "amplitude cos(frequency t + phase); frequency >= 0 [rad/s].")
      .def(py::init(&make_harmonic), py::arg("amplitude") = 0.0, py::arg("frequency") = 0.0,
           py::arg("phase") = 0.0)
      .def_readonly("amplitude", &Harmonic::amplitude)
      .def_readonly("frequency", &Harmonic::frequency)
      .def_readonly("phase", &Harmonic::phase);

  py::class_<Beam>(module, "Beam",
                   "Clamped-free Euler-Bernoulli beam by its first modes: length [m], "
                   "bending_stiffness EI [N m^2], mass_per_length [kg/m], damping [N s/m^2].")
      .def(py::init(&make_beam), py::arg("modes"), py::arg("length") = 1.0,
           py::arg("bending_stiffness") = 1.0, py::arg("mass_per_length") = 1.0,
           py::arg("damping") = 0.0)
      .def_readonly("modes", &Beam::modes)
      .def_readonly("length", &Beam::length)
      .def_readonly("bending_stiffness", &Beam::bending_stiffness)
      .def_readonly("mass_per_length", &Beam::mass_per_length)
      .def_readonly("damping", &Beam::damping);
}

void bind_model(py::module_& module) {
  py::class_<Contact>(module, "Contact",
                      "One unilateral contact, gap w^T q + motion(t) + clearance [m], with a "
                      "restitution in [0, 1]; w has f entries.")
      .def(py::init(&make_contact), py::arg("w"), py::arg("restitution"),
           py::arg("clearance") = 0.0, py::arg("motion") = Harmonic{})
      .def_property_readonly("w", vector_property(&Contact::w))
      .def_readonly("restitution", &Contact::restitution)
      .def_readonly("clearance", &Contact::clearance)
      .def_readonly("motion", &Contact::motion);

  py::class_<Force>(module, "Force",
                    "f(t) += direction (constant + harmonic(t)); direction has f entries.")
      .def(py::init(&make_force), py::arg("direction"), py::arg("constant") = 0.0,
           py::arg("harmonic") = Harmonic{})
      .def_property_readonly("direction", vector_property(&Force::direction))
      .def_readonly("constant", &Force::constant)
      .def_readonly("harmonic", &Force::harmonic);

  py::class_<Output>(module, "Output",
                     "A quantity with a name: direction^T q, or with velocity direction^T u; "
                     "direction has f entries.")
      .def(py::init(&make_output), py::arg("name"), py::arg("direction"),
           py::arg("velocity") = false)
      .def_readonly("name", &Output::name)
      .def_property_readonly("direction", vector_property(&Output::direction))
      .def_readonly("velocity", &Output::velocity);

  py::class_<Model, std::shared_ptr<Model>>(
      module, "Model",
      "M u' + C u + K q = W lambda + f(t), q' = u, f coordinates and at least one contact. M, C "
      "and "
      "K are f x f and exactly symmetric, M positive definite, C and K semidefinite.")
      .def(py::init(&make_model), py::arg("M"), py::arg("C"), py::arg("K"), py::arg("contacts"),
           py::arg("forces") = std::vector<Force>{}, py::arg("law") = "poisson",
           py::arg("outputs") = std::vector<Output>{})
      .def_property_readonly("f", &Model::coordinates, "Number of coordinates.")
      .def_property_readonly("M", matrix_property(&Model::M))
      .def_property_readonly("C", matrix_property(&Model::C))
      .def_property_readonly("K", matrix_property(&Model::K))
      .def_readonly("contacts", &Model::contacts)
      .def_readonly("forces", &Model::forces)
      .def_readonly("outputs", &Model::outputs, "Quantities that have a name.")
      .def_property_readonly(
          "law",
          [](const Model& model) { return model.law == ImpactLaw::newton ? "newton" : "poisson"; })
      .def_readonly("chatter_time", &Model::chatter_time,
                    "Rest of a bounce sequence below which it is completed [s].");

  module.def(
      "beam_model",
      [](const Beam& beam, std::vector<Contact> contacts, const Harmonic& excitation,
         const std::string& law, std::vector<Output> outputs) {
        Model model = beam_model(beam, excitation);
        model.outputs = std::move(outputs);
        return finished(std::move(model), std::move(contacts), law);
      },
      py::arg("beam"), py::arg("contacts"), py::arg("excitation") = Harmonic{},
      py::arg("law") = "poisson", py::arg("outputs") = std::vector<Output>{},
      "The model of a beam with contacts, as of beam_contact(). excitation: motion of its frame "
      "[m].");
  module.def(
      "beam_contact", &make_beam_contact, py::arg("beam"), py::arg("position"),
      py::arg("restitution"), py::arg("side") = "below", py::arg("clearance") = 0.0,
      py::arg("motion") = Harmonic{},
      "A support at position in (0, length] [m], \"below\" the beam or \"above\". motion: that of "
      "the frame where the support stands on the ground; none where it moves with the frame.");
}

void bind_scene(py::module_& module) {
  py::class_<State>(module, "State", "Coordinates q and velocities u, f entries each.")
      .def(py::init([](Eigen::VectorXd q, Eigen::VectorXd u) {
             return State{std::move(q), std::move(u)};
           }),
           py::arg("q") = Eigen::VectorXd{}, py::arg("u") = Eigen::VectorXd{})
      .def_property_readonly("q", vector_property(&State::q))
      .def_property_readonly("u", vector_property(&State::u));

  py::class_<ParameterUncertainty>(
      module, "ParameterUncertainty",
      "How uncertain parameters of a machine are, [parameters] of its scene: P standard "
      "deviations, "
      "in the units of the parameters' values, and their correlation, P x P.")
      .def_readonly("keys", &ParameterUncertainty::keys)
      .def_property_readonly("sigma", vector_property(&ParameterUncertainty::sigma))
      .def_property_readonly("correlation", matrix_property(&ParameterUncertainty::correlation))
      .def_readonly("consider", &ParameterUncertainty::consider,
                    "Whether a filter only considers each, and never corrects it.");

  py::class_<Tolerance>(
      module, "Tolerance",
      "Hard limits of deviations, [tolerance] of a scene, for which the bound on V is proven: "
      "time [s], of each event; restitution, absolute; stiffness and damping, as shares of K and "
      "C, at most 0.5; force, in the norm of the inverse of M; clearance [m].")
      .def(py::init(&make_tolerance), py::kw_only(), py::arg("time") = 0.0,
           py::arg("restitution") = 0.0, py::arg("stiffness") = 0.0, py::arg("damping") = 0.0,
           py::arg("force") = 0.0, py::arg("clearance") = 0.0)
      .def_readonly("time", &Tolerance::time)
      .def_readonly("restitution", &Tolerance::restitution)
      .def_readonly("stiffness", &Tolerance::stiffness)
      .def_readonly("damping", &Tolerance::damping)
      .def_readonly("force", &Tolerance::force)
      .def_readonly("clearance", &Tolerance::clearance);

  py::class_<Scene, std::shared_ptr<Scene>>(
      module, "Scene",
      "A machine, the starts of its master and its replica, and their uncertainty. Starts may "
      "have fewer than f entries: the rest is 0. uncertainty: f energies of the replica's "
      "start, or in its place sigma: standard deviations of its q and u, as a State; "
      "drift: energy per unit of time; jitter: standard deviation of event times [s]; chatter_time "
      "[s]: from the machine's own time where it is not given; tolerance: hard limits of "
      "deviations, for the bound on V.")
      .def(py::init(&make_scene), py::arg("model"), py::kw_only(), py::arg("master") = State{},
           py::arg("replica") = State{}, py::arg("uncertainty") = py::none(),
           py::arg("drift") = 0.0, py::arg("jitter") = 0.0, py::arg("chatter_time") = py::none(),
           py::arg("name") = "", py::arg("sigma") = py::none(), py::arg("tolerance") = py::none())
      .def_readonly("name", &Scene::name)
      .def_property_readonly(
          "f", [](const Scene& scene) { return scene.model.coordinates(); },
          "Number of coordinates.")
      .def_property_readonly(
          "m", [](const Scene& scene) { return scene.model.contacts.size(); },
          "Number of contacts.")
      .def_readonly("model", &Scene::model)
      .def_readonly("beam", &Scene::beam, "None where the scene is not of a beam.")
      .def_property_readonly(
          "master", [](const Scene& scene) -> const State& { return scene.truth.start; },
          py::return_value_policy::reference_internal, "Start of the machine.")
      .def_property_readonly(
          "replica", [](const Scene& scene) -> const State& { return scene.prior.start; },
          py::return_value_policy::reference_internal, "Start of the replica.")
      .def_property_readonly(
          "uncertainty",
          [](const py::object& self) -> py::object {
            const auto& scene = self.cast<const Scene&>();
            if (scene.prior.uncertainty.size() == 0) return py::none();
            return view(scene.prior.uncertainty, self);
          },
          "Energies of the replica's start, f entries; None where not given.")
      .def_property_readonly(
          "sigma",
          [](const Scene& scene) -> const std::optional<State>& { return scene.prior.sigma; },
          py::return_value_policy::reference_internal,
          "Standard deviations of the replica's start; None where not given.")
      .def_property_readonly(
          "drift", [](const Scene& scene) { return scene.prior.drift; },
          "Energy of the model's process noise per unit of time.")
      .def_property_readonly(
          "parameters",
          [](const Scene& scene) -> const ParameterUncertainty* {
            return scene.prior.parameters.empty() ? nullptr : &scene.prior.parameters;
          },
          py::return_value_policy::reference_internal,
          "Uncertainty of the machine's parameters; None where not given.")
      .def_property_readonly(
          "jitter", [](const Scene& scene) { return scene.prior.jitter; },
          "Standard deviation of event times [s].")
      .def(
          "machine_time", [](const Scene& scene, double t) { return machine_time(scene.clock, t); },
          py::arg("t"),
          "The machine's time at a reading of the contact clock [s], by the scene's [clock].")
      .def_property_readonly(
          "tolerance", [](const Scene& scene) -> const Tolerance& { return scene.prior.tolerance; },
          py::return_value_policy::reference_internal,
          "Hard limits of the deviations of machine and event times.")
      .def("__repr__", [](const Scene& scene) {
        return "<sprag.Scene " + scene.name + ": f = " + std::to_string(scene.model.coordinates()) +
               ", m = " + std::to_string(scene.model.contacts.size()) + ">";
      });

  module.def(
      "read_scene",
      [](const std::filesystem::path& file) {
        const py::module_ package = py::module_::import("sprag");
        const auto folder = shipped_scenes(package.attr("__file__").cast<std::string>());
        const std::filesystem::path found = find_scene(file, folder);
        if (const std::string why = scene_not_found(found, folder); !why.empty()) {
          throw SceneError(found.string(), "cannot be read: " + why);
        }
        return with_warnings(read_scene(found));
      },
      py::arg("file"),
      "Reads and checks a scene file, and the files that it names; or the scene of this name that "
      "comes with Sprag, as \"paper_beam\". Remarks on it are RuntimeWarnings. Raises SceneError.");
  module.def(
      "parse_scene",
      [](const std::string& text, const std::string& file) {
        return with_warnings(parse_scene(text, file));
      },
      py::arg("text"), py::arg("file") = "scene.toml",
      "The same from text; file is the name that errors carry. Raises SceneError.");
}

}  // namespace

void bind_machines(py::module_& module) {
  bind_beam(module);
  bind_model(module);
  bind_scene(module);
}

}  // namespace sprag::python
