#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "python/src/bindings.h"
#include "python/src/long_call.h"
#include "python/src/random.h"
#include "python/src/settings.h"
#include "python/src/trial.h"
#include "python/src/values.h"
#include "sprag/detail/analysis/recurrence.h"
#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/certified_floor.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/reduction.h"
#include "sprag/sampled_input.h"
#include "sprag/scene_file.h"

namespace sprag::python {

namespace {

#if defined(__clang__)
constexpr const char* compiler = "clang " __clang_version__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

// Runs of machines and of observers that follow them. Several threads may call its methods at once,
// which stop() ends.
class Trials {
  template <typename Compute>
  auto stoppable(const Compute& compute) const {
    return stoppable_call(stop_.get_token(), compute);
  }

 public:
  // Machine and observer with starts of these energies; see draw_starts().
  std::pair<Scene, Scene> drawn(Scene machine, Scene observer, std::uint64_t seed,
                                std::uint64_t stream, double of_machine,
                                const std::optional<double>& of_replica) const {
    return stoppable([&] {
      draw_starts(seed, stream, of_machine, of_replica, machine, observer);
      return std::pair(std::move(machine), std::move(observer));
    });
  }

  Truth run(const Scene& machine, double duration, double tick, int samples) const {
    return stoppable([&] { return run_machine(machine, duration, tick, samples); });
  }

  // Figures of each estimator. One that does not exist raises ModelError, or, with `or_none`, has
  // an infinite V.
  std::vector<Figures> follow(const std::vector<std::string>& estimators, const Scene& observer,
                              const Truth& truth, std::uint64_t seed, std::uint64_t stream,
                              double jitter, double offset, double lost, double spurious,
                              bool or_none) const {
    std::vector<EstimatorKind> kinds;
    for (const std::string& name : estimators) kinds.push_back(to_estimator(name));
    return stoppable([&] {
      const auto contacts = static_cast<int>(truth.model.contacts.size());
      const std::vector<ContactEvent> events = disturb(
          truth.events, {jitter, offset, lost, spurious}, contacts, truth.end, seed, stream);
      std::vector<Figures> figures;
      for (const EstimatorKind kind : kinds) {
        try {
          figures.push_back(python::follow(kind, observer, events, truth));
        } catch (const ModelError&) {
          if (!or_none) throw;
          figures.push_back({std::vector(static_cast<std::size_t>(truth.q.cols()), infinity)});
        }
      }
      return figures;
    });
  }

  // Median of the replica's bound in the second half of a run, under a tolerance; infinite if there
  // is none. `uncertainty`: of a scene without one.
  double bound(Scene scene, const Tolerance& tolerance, const Eigen::VectorXd& uncertainty,
               const Truth& truth) const {
    return stoppable([&] {
      scene.prior.tolerance = tolerance;
      if (scene.prior.uncertainty.size() == 0) scene.prior.uncertainty = uncertainty;
      if (!why_no_bound(scene).empty()) return infinity;
      return certified_floor(scene, truth.events, truth.end).median;
    });
  }

  Recurrence recurrence(const Scene& machine, double period, int transient, int periods,
                        int longest, bool lyapunov) const {
    const RecurrenceSettings settings{.period = period,
                                      .transient = transient,
                                      .periods = periods,
                                      .longest = longest,
                                      .lyapunov = lyapunov};
    return stoppable(
        [&] { return sprag::recurrence(machine.model, machine.truth.start, settings); });
  }

  void stop() { stop_.request_stop(); }

 private:
  std::stop_source stop_;
};

std::int64_t closings(const Truth& truth) {
  return std::count_if(truth.events.begin(), truth.events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::opens;
  });
}

// The scene with a wrong parameter: by a share of its value, or where `logarithmic` is not set by
// an amount. Throws ModelError if the parameter cannot have this value.
Scene with_wrong(const Scene& scene, const std::string& key, double amount) {
  const Parameter unknown = parameter_of(scene, key);
  const double value =
      unknown.logarithmic ? unknown.nominal * (1.0 + amount) : unknown.nominal + amount;
  if (value < unknown.lower_limit || value > unknown.upper_limit) {
    throw ModelError(key + " cannot be off by so much");
  }
  return with(scene, unknown, value);
}

py::list list_parameters(const Scene& scene) {
  py::list parameters;
  for (const Parameter& unknown : parameters_of(scene)) {
    const bool factor = unknown.unit.empty() && unknown.nominal == 1.0;
    const std::string_view covered = tolerance_of(unknown);
    py::dict of;
    of["key"] = unknown.key;
    of["unit"] = unknown.logarithmic || factor ? "" : unknown.unit.empty() ? "1" : unknown.unit;
    of["nominal"] = unknown.nominal;
    of["most"] = unknown.logarithmic ? 0.5 : unknown.unit_step;
    of["frequency"] = quantity(unknown.key) == "frequency";
    of["bounded"] = covered == "clearance" ? "" : covered;
    parameters.append(of);
  }
  return parameters;
}

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
  module.def("_parse_toml", &parse_toml, "text"_a, "file"_a,
             "A text as nodes: value, line, column, line and column of the key, whether it is an "
             "inline table.");
  module.def(
      "_read_whole",
      [](const std::filesystem::path& file, std::size_t most) {
        return py::bytes(read_whole(file, most));
      },
      "file"_a, "most"_a = largest_text);
  module.def("_read_study_scene", &read_study_scene, "file"_a,
             "A scene, its remarks, and the files that it names.");
  module.def("_parse_study_scene", &parse_scene, "text"_a, "file"_a, "The scene without warnings.");
  module.def("_with_numbers", &with_numbers, "text"_a, "numbers"_a, "file"_a,
             "The text of a scene with these numbers, by their paths.");
  module.def(
      "_number_of",
      [](const std::string& text, const std::string& path, const std::string& file) {
        return number_of(text, path, no_number, file);
      },
      "text"_a, "path"_a, "file"_a, "The number of a path in the text of a scene; nan without it.");
  module.def("_in_modes", &in_modes, "scene"_a, "modes"_a);
  module.def(
      "_end_of_inputs", [](const Scene& scene) { return end_of_inputs(scene.model); }, "scene"_a);
  module.def(
      "_only_frequency", [](const Scene& scene) { return only_frequency(scene.model); }, "scene"_a);
  module.def("_why_not_adaptive", &why_not_adaptive, "scene"_a);
  module.def(
      "_has_master", [](const Scene& scene) { return scene.truth.given; }, "scene"_a);
  module.def(
      "_uniforms",
      [](std::uint64_t seed, std::uint64_t stream, int count) {
        Random random(seed, stream, Purpose::axes);
        std::vector<double> values(static_cast<std::size_t>(count));
        for (double& value : values) value = random.uniform();
        return values;
      },
      "seed"_a, "stream"_a, "count"_a, "Random numbers in [0, 1) for the axes.");
  module.def("_csv_fields", &csv_fields, "values"_a, "Each with a comma after it.");

  module.def("_parameters_of", &list_parameters, "scene"_a);
  module.def("_with_wrong", &with_wrong, "scene"_a, "key"_a, "amount"_a,
             "The scene with a parameter off by a share of its value, or by an amount.");

  const auto rows = [](Eigen::MatrixXd Truth::*member) {
    return [member](const Truth& truth) { return Eigen::MatrixXd((truth.*member).transpose()); };
  };
  ValueClass<Truth>(module, "_Truth", "A run of a machine.")
      .get("closings", "Number of events that close a contact.", &closings)
      .get("interval", "Of the samples [s].", &Truth::interval)
      .get("q", "Coordinates at the samples, n x f.", rows(&Truth::q))
      .get("u", "Velocities at the samples, n x f.", rows(&Truth::u));
  ValueClass<Figures>(module, "_Figures", "One estimator in one run.")
      .get("V", "At the samples.", &Figures::V)
      .get("nees", "Mean of (error / sigma)^2, settled.", &Figures::nees)
      .get("beyond_3_sigma", "Share of the errors beyond 3 sigma.", &Figures::beyond_3_sigma)
      .get("trusted", "Share of samples from the filter.", &Figures::trusted);
  ValueClass<Recurrence>(module, "_Recurrence", "What a stroboscope shows of a machine.")
      .get("impacts_per_period", "Impacts per period.", &Recurrence::impacts_per_period)
      .get("lyapunov", "Largest Lyapunov exponent.", &Recurrence::lyapunov)
      .get("attractor_period", "In periods; 0: none.", &Recurrence::attractor_period)
      .get("attractor", "A point of it, 2 f entries.", &Recurrence::attractor)
      .get("points", "State at each period, n x 2 f.", &Recurrence::points);
  ValueClass<Trials>(module, "_Trials", "Runs of machines and of observers that follow them.")
      .def(py::init<>())
      .def("drawn", &Trials::drawn, "machine"_a, "observer"_a, "seed"_a, "stream"_a,
           "of_machine"_a = 0.0, "of_replica"_a = py::none(),
           "Machine and observer with random starts of these energies.")
      .def("run", &Trials::run, "machine"_a, "duration"_a, "tick"_a, "samples"_a)
      .def("follow", &Trials::follow, "estimators"_a, "observer"_a, "truth"_a, "seed"_a, "stream"_a,
           py::kw_only(), "jitter"_a = 0.0, "offset"_a = 0.0, "lost"_a = 0.0, "spurious"_a = 0.0,
           "or_none"_a = false, "Figures of each estimator.")
      .def("bound", &Trials::bound, "scene"_a, "tolerance"_a, "uncertainty"_a, "truth"_a,
           "Median of the replica's bound in the second half; infinite if there is none.")
      .def("recurrence", &Trials::recurrence, "machine"_a, "period"_a, "transient"_a, "periods"_a,
           "longest"_a, "lyapunov"_a)
      .def("stop", &Trials::stop, "Ends all calls.");
}

}  // namespace sprag::python
