#include "python/src/tolerances.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "python/src/long_call.h"
#include "python/src/settings.h"
#include "python/src/trial.h"
#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/certified_floor.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/sampled_input.h"

namespace sprag::python {

namespace py = pybind11;

namespace {

constexpr std::uint64_t seed = 1;

// Runs of a scene's machine, and observers that follow them. Several threads may call its methods
// at once, which stop() ends.
class Bench {
  template <typename Compute>
  auto stoppable(const Compute& compute) const {
    try {
      const StopScope scope(stop_.get_token());
      const py::gil_scoped_release released;
      return compute();
    } catch (const Interrupted&) {
      raise_interrupt();
    }
  }

 public:
  explicit Bench(Scene scene) : scene_(std::move(scene)) {
    if (!scene_.truth.given) scene_.truth.start = scene_.prior.start;
  }

  const Scene& scene() const { return scene_; }

  Truth run(double duration, int samples, double energy, std::uint64_t number) const {
    return stoppable([&] {
      Scene machine = scene_, observer = scene_;
      draw_starts(seed, number, energy, std::nullopt, machine, observer);
      return run_machine(machine, duration, 0.0, samples);
    });
  }

  // The scene with a wrong parameter: by a share of its value, or where `logarithmic` is not set by
  // an amount. Throws ModelError if the parameter cannot have this value.
  Scene wrong(const std::string& key, double amount) const {
    const Unknown unknown = unknown_of(scene_, key);
    const double value =
        unknown.logarithmic ? unknown.nominal * (1.0 + amount) : unknown.nominal + amount;
    const bool never_negative =
        unknown.kind == Unknown::Kind::restitution || unknown.kind == Unknown::Kind::damping;
    if ((unknown.upper_limit > 0.0 && value > unknown.upper_limit) ||
        (never_negative && value < 0.0)) {
      throw ModelError(key + " cannot be off by so much");
    }
    return with(scene_, unknown, value);
  }

  // Figures of each estimator, whose model is `given`, in a run with disturbed events.
  std::vector<Figures> follow(const std::vector<std::string>& estimators, const Scene& given,
                              const Truth& truth, std::uint64_t number, double threshold,
                              const Disturbance& disturbance) const {
    std::vector<EstimatorKind> kinds;
    for (const std::string& name : estimators) kinds.push_back(to_estimator(name));
    return stoppable([&] {
      const std::vector<ContactEvent> events =
          python::disturb(truth.events, disturbance, static_cast<int>(scene_.model.contacts.size()),
                          static_cast<double>(truth.samples()) * truth.interval(), seed, number);
      std::vector<Figures> figures;
      for (const EstimatorKind kind : kinds) {
        try {
          figures.push_back(python::follow(kind, given, events, truth, threshold));
        } catch (const ModelError&) {  // this observer does not exist
          figures.emplace_back();
          figures.back().V_floor = infinity;
          figures.back().V.assign(static_cast<std::size_t>(truth.q.cols()), infinity);
        }
      }
      add_worse(kinds, figures);
      return figures;
    });
  }

  // Median of the replica's bound in the second half of a run, under a tolerance.
  double bound(const Tolerance& tolerance, const Eigen::VectorXd& uncertainty, const Truth& truth,
               double duration) const {
    return stoppable([&] {
      Scene scene = scene_;
      scene.prior.tolerance = tolerance;
      if (scene.prior.uncertainty.size() == 0) scene.prior.uncertainty = uncertainty;
      if (!why_no_bound(scene).empty()) return infinity;
      return certified_floor(scene, truth.events, duration).median;
    });
  }

  void stop() { stop_.request_stop(); }

 private:
  Scene scene_;
  std::stop_source stop_;
};

std::int64_t closings(const Truth& truth) {
  return std::count_if(truth.events.begin(), truth.events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::opens;
  });
}

// The field of Tolerance that covers a parameter; empty: none.
std::string bounded_by(const Unknown& unknown) {
  switch (unknown.kind) {
    case Unknown::Kind::restitution:
      return "restitution";
    case Unknown::Kind::stiffness:
      return "stiffness";
    case Unknown::Kind::damping:
      return "damping";
    default:
      return "";
  }
}

py::list parameters_of(const Scene& scene) {
  py::list parameters;
  for (const Unknown& unknown : unknowns_of(scene)) {
    const bool factor = unknown.unit.empty() && unknown.nominal == 1.0;
    py::dict of;
    of["key"] = unknown.key;
    of["unit"] = unknown.logarithmic || factor ? "" : unknown.unit.empty() ? "1" : unknown.unit;
    of["nominal"] = unknown.nominal;
    of["most"] = unknown.logarithmic ? 0.5 : unknown.unit_step;
    of["frequency"] = unknown.kind == Unknown::Kind::frequency;
    of["bounded"] = bounded_by(unknown);
    parameters.append(of);
  }
  return parameters;
}

}  // namespace

void bind_tolerances(py::module_& module) {
  py::class_<Truth>(module, "_Truth", "A run of a machine.")
      .def_property_readonly("closings", &closings, "Number of events that close a contact.")
      .def_property_readonly(
          "q", [](const Truth& truth) { return Eigen::MatrixXd(truth.q.transpose()); },
          "Coordinates at the samples, n x f.")
      .def_property_readonly(
          "u", [](const Truth& truth) { return Eigen::MatrixXd(truth.u.transpose()); },
          "Velocities at the samples, n x f.");
  py::class_<Bench>(module, "_Bench", "Runs of a scene's machine, and observers that follow them.")
      .def(py::init<const Scene&>(), py::arg("scene"))
      .def_property_readonly(
          "scene", [](const Bench& bench) { return bench.scene(); }, "The scene.")
      .def_property_readonly(
          "parameters", [](const Bench& bench) { return parameters_of(bench.scene()); },
          "Parameters of the machine.")
      .def_property_readonly(
          "end", [](const Bench& bench) { return end_of_inputs(bench.scene().model); },
          "End of the recorded inputs, infinity if there are none.")
      .def("run", &Bench::run, py::arg("duration"), py::arg("samples"), py::arg("energy") = 0.0,
           py::arg("number") = 0,
           "A run of the machine from a start that differs from the scene's by this energy.")
      .def("wrong", &Bench::wrong, py::arg("key"), py::arg("amount"),
           "The scene with a parameter off by a share of its value, or by an amount.")
      .def(
          "follow",
          [](const Bench& bench, const std::vector<std::string>& estimators, const Scene& given,
             const Truth& truth, std::uint64_t number, double threshold, double jitter,
             double offset, double lost, double spurious) {
            py::list figures;
            for (const Figures& of : bench.follow(
                     estimators, given, truth, number, threshold,
                     {.jitter = jitter, .offset = offset, .lost = lost, .spurious = spurious})) {
              figures.append(py::make_tuple(of.V_floor, of.time_below, of.worse));
            }
            return figures;
          },
          py::arg("estimators"), py::arg("given"), py::arg("truth"), py::arg("number"),
          py::arg("threshold"), py::arg("jitter") = 0.0, py::arg("offset") = 0.0,
          py::arg("lost") = 0.0, py::arg("spurious") = 0.0,
          "Of each estimator, whose model is `given`, in a run with disturbed events: the median "
          "of "
          "V in the second half, the first time with V below the threshold, and the share of the "
          "second half in which V is far above that of the replica.")
      .def("bound", &Bench::bound, py::arg("tolerance"), py::arg("uncertainty"), py::arg("truth"),
           py::arg("duration"),
           "Median of the replica's bound in the second half; infinite if there is none.")
      .def("stop", &Bench::stop, "Ends all calls.");
}

}  // namespace sprag::python
