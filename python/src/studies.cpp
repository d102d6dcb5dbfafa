#include "python/src/studies.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <vector>

#include "python/src/arrays.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/study/quantities.h"
#include "sprag/detail/study/study_file.h"

namespace sprag::python {
namespace {

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
    std::int64_t runs = 0, failures = 0;
    {
      const StopScope scope(stop_.get_token());
      const py::gil_scoped_release released;
      study::Measurement measurement(study_);
      try {
        while (first < end && !interrupted()) {
          if (!measurement.append_rows(first, text)) ++failures;
          ++first;
          ++runs;
        }
      } catch (const Interrupted&) {  // the text ends with the last complete run
      }
    }
    return py::make_tuple(text, runs, failures);
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
}

}  // namespace sprag::python
