#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "lcmtypes/contact_log.h"
#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "python/src/bus.h"
#include "sprag/detail/import/level_edges.h"
#include "sprag/detail/import/recorded_edges.h"

namespace sprag::python {
namespace {

using Times = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::span<const double> values_of(const Times& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

py::array level_changes(const Times& levels, double threshold, bool inverted) {
  LevelEdges edges(threshold, inverted);
  py::array_t<std::int8_t> changes(levels.size());
  auto change = changes.mutable_unchecked<1>();
  py::ssize_t i = 0;
  for (const double level : values_of(levels)) {
    const bool first = !edges.high();
    const LevelChange found = edges.take(level);
    change(i++) = found == LevelChange::rises   ? std::int8_t{1}
                  : found == LevelChange::falls ? std::int8_t{-1}
                  : first && *edges.high()      ? std::int8_t{2}
                                                : std::int8_t{0};
  }
  return changes;
}

py::tuple contact_events(int contact, const Times& closings, const Times& openings,
                         const Times& impacts, double debounce, double pulse_shorter_than,
                         double duration) {
  RecordedEvents found =
      events_of(contact - 1, {values_of(closings), values_of(openings), values_of(impacts)},
                {debounce, pulse_shorter_than, duration});
  py::list refused;
  for (const RefusedEdge& edge : found.refused) {
    refused.append(py::make_tuple(static_cast<int>(edge.kind), edge.index, edge.what));
  }
  py::dict counts;
  counts["pulses"] = found.counts.pulses;
  counts["sustained"] = found.counts.sustained;
  counts["merged"] = found.counts.merged;
  counts["before_start"] = found.counts.before_start;
  counts["after_duration"] = found.counts.after_duration;
  return py::make_tuple(owned(std::move(found.events)), counts, refused);
}

std::int64_t write_log(const std::filesystem::path& file, const py::object& events, int contacts,
                       double end, const std::optional<std::filesystem::path>& key) {
  const std::vector<ContactEvent> list = to_events(events, static_cast<std::size_t>(contacts));
  return write_contact_log(file, list, contacts, end, to_key(key));
}

}  // namespace

void bind_import(py::module_& module) {
  module.def("_level_changes", &level_changes, "levels"_a, "threshold"_a, "inverted"_a,
             "Of each level: 1 it rises, -1 it falls, 2 it is the first one and high, else 0.");
  module.def("_contact_events", &contact_events, "contact"_a, "closings"_a, "openings"_a,
             "impacts"_a, py::kw_only(), "debounce"_a, "pulse_shorter_than"_a, "duration"_a,
             "Events of one contact, counts of them, and refused edges (list, index, why), from "
             "ascending times of its edges.");
  module.def("_write_contact_log", &write_log, "file"_a, "events"_a, "contacts"_a, "end"_a, "key"_a,
             "Writes events as an LCM log and returns the number of messages.");
}

}  // namespace sprag::python
