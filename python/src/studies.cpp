#include "python/src/studies.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "python/src/long_call.h"
#include "python/src/random.h"
#include "python/src/settings.h"
#include "python/src/trial.h"
#include "sprag/detail/analysis/recurrence.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/reduction.h"
#include "sprag/sampled_input.h"
#include "sprag/scene_file.h"

namespace sprag::python {

namespace py = pybind11;

namespace {

#if defined(__clang__)
constexpr const char* compiler = "clang " __clang_version__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

// Quantities of the machine alone: period, transient, periods, longest cycle, Lyapunov exponent.
using Stroboscope = std::tuple<double, int, int, int, bool>;

// Computes the runs of a study. Several threads may call run() at once, which stop() ends.
class StudyRuns {
 public:
  // The result: figures of each estimator in the order of Figures, number of closings, and what the
  // stroboscope shows.
  py::tuple run(const Scene& of_machine, const Scene& of_observer, std::uint64_t seed,
                std::uint64_t stream, double start_machine,
                const std::optional<double>& start_replica, double duration, double tick,
                int samples, double threshold, const Disturbance& disturbance,
                const std::vector<std::string>& estimators, bool impacts,
                const std::optional<Stroboscope>& stroboscope) const {
    std::vector<EstimatorKind> kinds;
    for (const std::string& name : estimators) kinds.push_back(to_estimator(name));
    std::vector<Figures> figures;
    std::vector<ContactEvent> events;
    Recurrence found;
    try {
      const StopScope scope(stop_.get_token());
      const py::gil_scoped_release released;
      Scene machine = of_machine, observer = of_observer;
      draw_starts(seed, stream, start_machine, start_replica, machine, observer);
      if (!kinds.empty()) {
        const Truth truth = run_machine(machine, duration, tick, samples);
        const auto contacts = static_cast<int>(machine.model.contacts.size());
        const auto arrived = disturb(truth.events, disturbance, contacts, duration, seed, stream);
        for (const EstimatorKind kind : kinds) {
          figures.push_back(follow(kind, observer, arrived, truth, threshold));
        }
        add_worse(kinds, figures);
        events = truth.events;
      } else if (impacts) {
        Master(machine.model, machine.truth.start).advance(at(duration), events);
      }
      if (stroboscope) {
        const auto& [period, transient, periods, longest, lyapunov] = *stroboscope;
        found = recurrence(machine.model, machine.truth.start,
                           {.period = period,
                            .transient = transient,
                            .periods = periods,
                            .longest = longest,
                            .lyapunov = lyapunov});
      }
    } catch (const Interrupted&) {
      raise_interrupt();
    }
    py::list of_estimators;
    for (const Figures& of : figures) {
      of_estimators.append(py::make_tuple(of.V_floor, of.V_max, of.rate, of.time_below, of.nees,
                                          of.beyond_3_sigma, of.trusted, of.worse));
    }
    const auto closings = std::count_if(
        events.begin(), events.end(),
        [](const ContactEvent& event) { return event.kind != ContactEventKind::opens; });
    return py::make_tuple(of_estimators, closings, found.impacts_per_period, found.lyapunov,
                          found.attractor_period, found.attractor, found.points);
  }

  void stop() { stop_.request_stop(); }

 private:
  std::stop_source stop_;
};

// A node as _study_file.Node has it.
py::tuple to_python(const toml::node& node, const toml::source_position& key) {
  py::object value;
  bool is_inline = false;
  if (const toml::table* table = node.as_table()) {
    py::dict entries;
    for (const auto& [name, entry] : *table) {
      entries[py::str(std::string(name.str()))] = to_python(entry, name.source().begin);
    }
    value = entries;
    is_inline = table->is_inline();
  } else if (const toml::array* array = node.as_array()) {
    py::list entries;
    for (const toml::node& entry : *array) entries.append(to_python(entry, entry.source().begin));
    value = entries;
  } else if (node.is_string()) {
    value = py::str(node.as_string()->get());
  } else if (node.is_boolean()) {
    value = py::bool_(node.as_boolean()->get());
  } else if (node.is_integer()) {
    value = py::int_(node.as_integer()->get());
  } else if (node.is_floating_point()) {
    value = py::float_(node.as_floating_point()->get());
  } else {
    value = py::none();  // a date or a time
  }
  const toml::source_position& at = node.source().begin;
  return py::make_tuple(value, at.line, at.column, key.line, key.column, is_inline);
}

py::tuple parse_toml(const std::string& text, const std::string& file) {
  const TomlDocument document(text, {file});
  return to_python(document.table(), document.table().source().begin);
}

py::tuple read_study_scene(const std::filesystem::path& file) {
  std::vector<std::filesystem::path> inputs;
  Scene scene =
      read_scene(file, [&](const std::filesystem::path& named) { inputs.push_back(named); });
  std::vector<std::string> remarks = scene.remarks;
  return py::make_tuple(std::move(scene), remarks, inputs);
}

std::string with_numbers(const std::string& text, const std::map<std::string, double>& numbers,
                         const std::string& file) {
  std::vector<SceneValue> values;
  for (const auto& [path, number] : numbers) values.push_back({path, {number}});
  return with_values(text, values, file);
}

std::string why_not_adaptive(const Scene& scene) {
  try {
    const TrackingEstimator possible(scene, 1.0, EstimatorKind::adaptive);
  } catch (const ModelError& error) {
    return error.what();
  }
  return "";
}

std::string csv_fields(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) {
    if (std::isnan(value)) {
      text += "nan";  // without a sign
    } else {
      append_number(text, value);
    }
    text += ',';
  }
  return text;
}

}  // namespace

void bind_studies(py::module_& module) {
  module.attr("_compiler") = compiler;
  module.def("_parse_toml", &parse_toml, py::arg("text"), py::arg("file"),
             "A text as nodes: value, line, column, line and column of the key, whether it is an "
             "inline table.");
  module.def(
      "_read_whole", [](const std::filesystem::path& file) { return py::bytes(read_whole(file)); },
      py::arg("file"));
  module.def("_read_study_scene", &read_study_scene, py::arg("file"),
             "A scene, its remarks, and the files that it names.");
  module.def(
      "_parse_study_scene",
      [](const std::string& text, const std::string& file) { return parse_scene(text, file); },
      py::arg("text"), py::arg("file"), "The scene without warnings.");
  module.def("_with_numbers", &with_numbers, py::arg("text"), py::arg("numbers"), py::arg("file"),
             "The text of a scene with these numbers, by their paths.");
  module.def(
      "_number_of",
      [](const std::string& text, const std::string& path, const std::string& file) {
        return number_of(text, path, no_number, file);
      },
      py::arg("text"), py::arg("path"), py::arg("file"),
      "The number of a path in the text of a scene; nan without it.");
  module.def("_in_modes", &in_modes, py::arg("scene"), py::arg("modes"));
  module.def(
      "_end_of_inputs", [](const Scene& scene) { return end_of_inputs(scene.model); },
      py::arg("scene"));
  module.def(
      "_only_frequency", [](const Scene& scene) { return only_frequency(scene.model); },
      py::arg("scene"));
  module.def("_why_not_adaptive", &why_not_adaptive, py::arg("scene"));
  module.def(
      "_has_master", [](const Scene& scene) { return scene.truth.given; }, py::arg("scene"));
  module.def(
      "_uniforms",
      [](std::uint64_t seed, std::uint64_t stream, int count) {
        Random random(seed, stream, Purpose::axes);
        std::vector<double> values(static_cast<std::size_t>(count));
        for (double& value : values) value = random.uniform();
        return values;
      },
      py::arg("seed"), py::arg("stream"), py::arg("count"),
      "Random numbers in [0, 1) for the axes.");
  module.def("_csv_fields", &csv_fields, py::arg("values"), "Each with a comma after it.");

  py::class_<StudyRuns>(module, "_StudyRuns", "Computes the runs of a study.")
      .def(py::init<>())
      .def(
          "run",
          [](const StudyRuns& runs, const Scene& machine, const Scene& observer, std::uint64_t seed,
             std::uint64_t stream, double start_machine, const std::optional<double>& start_replica,
             double duration, double tick, int samples, double threshold,
             const std::array<double, 4>& disturbance, const std::vector<std::string>& estimators,
             bool impacts, const std::optional<Stroboscope>& stroboscope) {
            const auto& [jitter, offset, lost, spurious] = disturbance;
            return runs.run(machine, observer, seed, stream, start_machine, start_replica, duration,
                            tick, samples, threshold, {jitter, offset, lost, spurious}, estimators,
                            impacts, stroboscope);
          },
          py::arg("machine"), py::arg("observer"), py::arg("seed"), py::arg("stream"),
          py::arg("start_machine"), py::arg("start_replica"), py::arg("duration"), py::arg("tick"),
          py::arg("samples"), py::arg("threshold"), py::arg("disturbance"), py::arg("estimators"),
          py::arg("impacts"), py::arg("stroboscope"),
          "disturbance: jitter, offset, lost, spurious; stroboscope: period, transient, periods, "
          "longest cycle, whether Lyapunov exponents. Returns figures of the estimators, closings, "
          "impacts_per_period, lyapunov, attractor.period, attractor and points.")
      .def("stop", &StudyRuns::stop, "Ends all calls.");
}

}  // namespace sprag::python
