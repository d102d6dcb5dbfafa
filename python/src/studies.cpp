#include "python/src/studies.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "python/src/arrays.h"
#include "python/src/long_call.h"
#include "python/src/settings.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/study/quantities.h"
#include "sprag/detail/study/study_file.h"
#include "sprag/detail/tolerance/deviations.h"
#include "sprag/detail/tolerance/search.h"
#include "sprag/sampled_input.h"

namespace sprag::python {
namespace {

int threads_of(std::optional<int> jobs) {
  if (jobs && *jobs < 1) throw std::invalid_argument("jobs must be >= 1");
  return jobs.value_or(static_cast<int>(std::max(std::thread::hardware_concurrency(), 1U)));
}

// ---- studies

#if defined(__clang__)
constexpr const char* compiler = "clang " __clang_version__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif

std::string hex(std::uint64_t number) {
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(number));
  return text.data();
}

// A study that computes its rows. Several threads may call rows() at once.
class StudyRuns {
 public:
  explicit StudyRuns(const std::filesystem::path& file) {
    const py::module_ core = py::module_::import("sprag._core");
    const auto scenes = shipped_scenes(core.attr("__file__").cast<std::string>());
    study_ =
        study::read_study(find_scene(file, scenes.empty() ? scenes : scenes / "studies"), scenes);
  }

  const study::Study& study() const { return study_; }

  // Lines of a CSV file of the runs first, ..., end - 1, the number of these runs, and how many of
  // them failed. There are fewer runs only after stop().
  py::tuple rows(std::int64_t first, std::int64_t end) const {
    if (first < 0 || end < first || end > study_.indices()) {
      throw std::invalid_argument("the study has no such runs");
    }
    std::string text;
    study::Computed all;
    {
      const StopScope scope(stop_.get_token());
      const py::gil_scoped_release released;
      study::Measurement measurement(study_);
      try {
        while (first < end && !interrupted()) {
          const study::Computed computed = measurement.append_rows({first, end}, text);
          first += computed.runs;
          all.runs += computed.runs;
          all.failures += computed.failures;
        }
      } catch (const Interrupted&) {  // the text ends with the last complete run
      }
    }
    return py::make_tuple(text, all.runs, all.failures);
  }

  void stop() { stop_.request_stop(); }

 private:
  study::Study study_;
  std::stop_source stop_;
};

// What the manifest says of the study.
py::dict manifest_of(const study::Study& study) {
  py::list axes;
  for (const study::Axis& axis : study.axes) {
    py::dict of;
    of["path"] = axis.path;
    if (axis.values.empty()) {
      of["random"] = std::vector<double>{axis.low, axis.high};
      of["logarithmic"] = axis.logarithmic;
    } else {
      of["values"] = axis.values;
    }
    if (axis.relative) of["relative"] = true;
    of["group"] = axis.group;
    axes.append(of);
  }
  const auto text_of = [](const std::string& file, const std::string& text) {
    py::dict of;
    of["file"] = file;
    of["text"] = text;
    return of;
  };
  py::dict manifest;
  manifest["name"] = study.name;
  manifest["compiler"] = compiler;
  manifest["hash"] = hex(study.hash);
  manifest["study"] = text_of(study.file, study.text);
  manifest["scene"] = text_of(study.scene_file.string(), study.scene_text);
  manifest["points"] = study.points;
  manifest["runs"] = study.runs;
  manifest["columns"] = study::columns(study);
  manifest["axes"] = axes;
  manifest["group_size"] = study.group_size;
  return manifest;
}

// ---- tolerances

tolerance::Settings tolerance_settings(const Scene& scene, std::optional<double> target,
                                       std::optional<double> duration, std::optional<double> jitter,
                                       std::optional<double> drift, int runs,
                                       const std::vector<std::string>& estimators) {
  tolerance::Settings settings;
  const auto set = [](const char* name, const std::optional<double>& given, double& value) {
    if (!given) return;
    if (!(*given > 0.0 && *given < std::numeric_limits<double>::infinity())) {
      throw std::invalid_argument(std::string(name) + " must be > 0");
    }
    value = *given;
  };
  set("target", target, settings.target);
  set("duration", duration, settings.duration);
  set("jitter", jitter, settings.jitter);
  set("drift", drift, settings.drift);
  if (runs < 1) throw std::invalid_argument("runs must be >= 1");
  settings.runs = runs;
  const double end = end_of_inputs(scene.model);
  if (settings.duration > end) {
    throw std::invalid_argument("the recorded input ends at t = " + std::to_string(end) +
                                "; duration must be at most that");
  }
  if (!estimators.empty()) settings.estimators.clear();
  for (const std::string& name : estimators) settings.estimators.push_back(to_estimator(name));
  return settings;
}

struct FoundTolerances {
  tolerance::Bench bench;
  tolerance::Tolerances found;
};

FoundTolerances find_tolerances(const Scene& scene, const tolerance::Settings& settings,
                                int threads) {
  tolerance::Bench bench(scene, settings, threads);
  tolerance::Tolerances found =
      tolerance::search(bench, tolerance::deviations_of(bench.scene(), bench.closings_per_time()),
                        threads, [](int, double) {});
  return {std::move(bench), std::move(found)};
}

py::object amount_or_nan(const tolerance::Limit& limit) {
  const bool none = limit.kind == tolerance::Limit::Kind::never;
  return py::float_(none ? std::numeric_limits<double>::quiet_NaN() : limit.amount);
}

py::dict tables_of(const FoundTolerances& all) {
  const auto& estimators = all.bench.settings().estimators;
  py::list limits, guaranteed, points;
  const auto add_point = [&](const std::string& what, const tolerance::Point& point) {
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      const tolerance::Spread& V = point.V[e];
      points.append(py::make_tuple(what, study::name(estimators[e]), point.amount, V.median, V.low,
                                   V.high, point.worse[e]));
    }
  };
  add_point("nothing", all.found.undisturbed);
  for (const tolerance::Found& found : all.found.found) {
    const tolerance::Deviation& of = found.deviation;
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      const tolerance::Limit& limit = found.limits[e];
      limits.append(py::make_tuple(of.name, study::name(estimators[e]), amount_or_nan(limit),
                                   of.unit, tolerance::name(limit.kind)));
    }
    if (found.guaranteed) {
      guaranteed.append(py::make_tuple(of.name, amount_or_nan(*found.guaranteed), of.unit,
                                       tolerance::name(found.guaranteed->kind)));
    }
    for (const tolerance::Point& point : found.points) add_point(of.name, point);
  }
  py::dict tables;
  tables["target"] = all.bench.target();
  tables["motion_energy"] = all.bench.motion_energy();
  tables["duration"] = all.bench.duration();
  tables["closings_per_time"] = all.bench.closings_per_time();
  tables["limits"] = limits;
  tables["guaranteed"] = guaranteed;
  tables["points"] = points;
  return tables;
}

}  // namespace

void bind_studies(py::module_& module) {
  py::class_<StudyRuns>(module, "_StudyRuns", "A study, and the computation of its rows.")
      .def(py::init<const std::filesystem::path&>(), py::arg("file"))
      .def_property_readonly(
          "manifest", [](const StudyRuns& runs) { return manifest_of(runs.study()); },
          "What the manifest says of the study.")
      .def_property_readonly(
          "remarks", [](const StudyRuns& runs) { return runs.study().scene.remarks; },
          "Remarks about the scene.")
      .def_property_readonly(
          "inputs", [](const StudyRuns& runs) { return runs.study().inputs; },
          "The scene, and the files that it names.")
      .def_property_readonly(
          "rows_of_run", [](const StudyRuns& runs) { return study::rows_of_run(runs.study()); },
          "Rows of a run that does not fail.")
      .def("rows", &StudyRuns::rows, py::arg("first"), py::arg("end"),
           "Lines of the runs first, ..., end - 1, the number of these runs, and of those that "
           "failed.")
      .def("stop", &StudyRuns::stop, "Ends all calls of rows() after the runs that they complete.");
  module.def(
      "_tolerance",
      [](const Scene& scene, std::optional<double> target, std::optional<double> duration,
         std::optional<double> jitter, std::optional<double> drift, int runs,
         const std::vector<std::string>& estimators, std::optional<int> jobs) {
        const tolerance::Settings settings =
            tolerance_settings(scene, target, duration, jitter, drift, runs, estimators);
        const int threads = threads_of(jobs);
        return tables_of(long_call([&] { return find_tolerances(scene, settings, threads); }));
      },
      py::arg("scene"), py::arg("target"), py::arg("duration"), py::arg("jitter"), py::arg("drift"),
      py::arg("runs"), py::arg("estimators"), py::arg("jobs"), "See tolerance().");
}

}  // namespace sprag::python
