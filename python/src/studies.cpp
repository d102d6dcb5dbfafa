#include "python/src/studies.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "python/src/arrays.h"
#include "python/src/long_call.h"
#include "python/src/settings.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/study/design.h"
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

template <typename Value>
py::array column_of(const std::vector<study::Row>& rows, const Value& value) {
  using Number = decltype(value(rows.front()));
  py::array_t<Number> column(static_cast<py::ssize_t>(rows.size()));
  Number* data = column.mutable_data();
  for (const study::Row& row : rows) *data++ = value(row);
  return read_only(column);
}

// The arrays of all columns but `failure`, which is a list of texts, by their names in a rows file.
py::dict columns_of(const study::Study& study, const std::vector<study::Row>& rows) {
  const std::vector<std::string> names = study::columns(study);
  py::dict columns;
  std::size_t next = 0;
  const auto add = [&](const auto& value) {
    columns[names[next++].c_str()] = column_of(rows, value);
  };
  add([](const study::Row& row) { return row.index; });
  add([&](const study::Row& row) { return study::point_of(study, row.index); });
  add([&](const study::Row& row) { return study::run_of(study, row.index); });
  for (std::size_t i = 0; i < study.axes.size(); ++i) {
    add([i](const study::Row& row) { return row.axes[i]; });
  }
  if (study.record.poincare) add([](const study::Row& row) { return row.n; });
  const std::size_t first = next;
  while (next + 1 < names.size()) {
    const std::size_t i = next - first;
    add([i](const study::Row& row) { return row.recorded[i]; });
  }
  py::list failures;
  for (const study::Row& row : rows) failures.append(row.failure);
  columns[names[next].c_str()] = failures;
  return columns;
}

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
  manifest["study"] = text_of(study.file, study.text);
  manifest["scene"] = text_of(study.scene_file.string(), study.scene_text);
  manifest["points"] = study.points;
  manifest["runs"] = study.runs;
  manifest["columns"] = study::columns(study);
  manifest["axes"] = axes;
  manifest["group_size"] = study.group_size;
  return manifest;
}

py::tuple run_study(const std::filesystem::path& file, std::optional<int> jobs) {
  const py::module_ core = py::module_::import("sprag._core");
  const auto scenes = shipped_scenes(core.attr("__file__").cast<std::string>());
  const std::filesystem::path found =
      find_scene(file, scenes.empty() ? scenes : scenes / "studies");
  const study::Study study = study::read_study(found, scenes);
  for (const std::string& remark : study.scene.remarks) {
    if (PyErr_WarnEx(PyExc_RuntimeWarning, remark.c_str(), 1) != 0) throw py::error_already_set();
  }
  const int threads = threads_of(jobs);
  const std::vector<study::Row> rows = long_call([&] { return study::all_rows(study, threads); });
  return py::make_tuple(columns_of(study, rows), manifest_of(study));
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
  module.def("_run_study", &run_study, py::arg("study"), py::arg("jobs"), "See run_study().");
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
