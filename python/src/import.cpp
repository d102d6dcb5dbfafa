#include "python/src/import.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "python/src/arrays.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/import/clock_time.h"
#include "sprag/detail/import/import.h"
#include "sprag/detail/import/levels.h"
#include "sprag/detail/import/unit.h"
#include "sprag/scene.h"

namespace sprag::python {
namespace {

using ColumnsByContact = std::map<int, std::string>;
using NumberOrText = std::variant<double, std::string>;

// Arguments of import_events() in Python, which describes them.
struct Arguments {
  ColumnsByContact impacts, on, off, level;
  std::string time;
  std::optional<double> threshold;
  bool inverted;
  std::optional<std::string> impacts_at;
  std::optional<NumberOrText> unit;
  NumberOrText offset;
  double rate, debounce, pulse_shorter_than, duration;
  std::optional<std::vector<std::string>> columns;
  std::optional<std::string> separator;
};

std::string as_text(const NumberOrText& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  char digits[40];
  std::snprintf(digits, sizeof digits, "%.17g", std::get<double>(value));
  return digits;
}

Edge to_edge(const std::optional<std::string>& impacts_at) {
  if (!impacts_at) return Edge::closed;
  if (*impacts_at == "rising") return Edge::rising;
  if (*impacts_at == "falling") return Edge::falling;
  if (*impacts_at == "both") return Edge::both;
  throw std::invalid_argument("impacts_at is \"" + *impacts_at +
                              "\"; must be \"rising\", \"falling\" or \"both\"");
}

std::optional<char> to_separator(const std::optional<std::string>& name) {
  if (!name) return std::nullopt;
  const std::optional<char> separator = parse_separator(*name);
  if (!separator) {
    throw std::invalid_argument("separator is \"" + *name +
                                "\"; must be \"comma\", \"semicolon\" or \"tab\"");
  }
  return separator;
}

std::optional<Decimal> to_unit(const std::optional<NumberOrText>& given) {
  if (!given) return std::nullopt;
  const std::optional<Decimal> unit = parse_unit(as_text(*given));
  if (!unit) {
    throw std::invalid_argument("unit is " + as_text(*given) +
                                "; must be \"s\", \"ms\", \"us\", \"ns\" or a number > 0");
  }
  return unit;
}

ImportOptions to_options(const Scene& scene, const Arguments& given) {
  if (!(given.debounce >= 0.0 && given.pulse_shorter_than >= 0.0)) {
    throw std::invalid_argument("debounce and pulse_shorter_than must be >= 0");
  }
  if (!(given.rate > 0.0 && std::isfinite(given.rate))) {
    throw std::invalid_argument("rate must be > 0");
  }
  if (given.rate != 1.0 && scene.clock.rate != 1.0) {
    throw std::invalid_argument(
        "rate and the scene's clock.rate would correct the same clock twice");
  }
  const auto offset = parse_clock_time(as_text(given.offset), DecimalMark::point);
  if (!offset) throw std::invalid_argument("offset must be a finite number or a time");
  return {.unit = {1, 0},
          .offset = offset->value,
          .rate = given.rate,
          .debounce = given.debounce,
          .pulse_shorter_than = given.pulse_shorter_than,
          .duration = given.duration};
}

void check_complete(const ContactColumns& of) {
  const bool pair = of.on && of.off && !of.impacts && !of.level;
  const bool one = !of.on && !of.off && of.impacts.has_value() != of.level.has_value();
  if (pair || one) return;
  throw std::invalid_argument(
      "contact " + std::to_string(of.contact + 1) +
      " needs a column of impacts, or columns on and off, or a column of levels");
}

std::vector<ContactColumns> chosen_columns(const ColumnFile& columns, const std::string& file,
                                           int contacts, const Arguments& given) {
  std::map<int, ContactColumns> chosen;
  const auto add = [&](const ColumnsByContact& names,
                       std::optional<std::size_t> ContactColumns::*role) {
    for (const auto& [contact, name] : names) {
      if (contact < 1 || contact > contacts) {
        throw std::invalid_argument("contact is " + std::to_string(contact) +
                                    "; must be from 1 to " + std::to_string(contacts));
      }
      chosen[contact].contact = contact - 1;
      chosen[contact].*role = columns.find(name, file);
    }
  };
  add(given.impacts, &ContactColumns::impacts);
  add(given.on, &ContactColumns::on);
  add(given.off, &ContactColumns::off);
  add(given.level, &ContactColumns::level);
  std::vector<ContactColumns> list;
  for (const auto& [contact, of] : chosen) {
    check_complete(of);
    list.push_back(of);
  }
  if (list.empty() && columns.columns.size() == 1 && contacts == 1) list.push_back({0, 0, {}, {}});
  if (list.empty()) {
    throw std::invalid_argument("no column is named; give impacts, or on and off, or level");
  }
  const LevelOptions none;
  if (given.level.empty() &&
      (given.time != none.time || given.threshold || given.inverted || given.impacts_at)) {
    throw std::invalid_argument("time, threshold, inverted and impacts_at are for level");
  }
  return list;
}

void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_RuntimeWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

py::array run_import(const std::filesystem::path& file, const Scene& scene,
                     const Arguments& given) {
  ImportOptions options = to_options(scene, given);
  const std::optional<Decimal> given_unit = to_unit(given.unit);
  const std::string name = file.string();
  const std::string text = read_whole(file, largest_capture);
  ColumnFile columns = parse_columns(text, name, to_separator(given.separator),
                                     given.columns.value_or(std::vector<std::string>{}));
  std::vector<ContactColumns> chosen =
      chosen_columns(columns, name, static_cast<int>(scene.model.contacts.size()), given);
  if (const auto column = alternating_column(columns, chosen)) {
    warn(name + ": column '" + *column +
         "' alternates between 0 and 1: these are the times of both edges of a level, and each is "
         "taken as an impact; level distinguishes closings from openings");
  }
  const LevelOptions levels{given.time, given.threshold, given.inverted, to_edge(given.impacts_at)};
  for (const std::string& line : expand_levels(levels, name, columns, chosen)) warn(line);
  const ChosenUnit unit = choose_unit(given_unit, columns, chosen, name);
  // Without a given unit the remark only repeats the column's name.
  if (given_unit && !unit.remark.empty()) warn(unit.remark);
  options.unit = unit.seconds;
  Import import = import_events(columns, chosen, options);
  for (const RowProblem& problem : import.problems) {
    warn(name + ":" + to_text(problem) + "; left out");
  }
  return owned(std::move(import.events));
}

}  // namespace

void bind_import(py::module_& module) {
  module.def(
      "_import_events",
      [](const std::filesystem::path& file, const Scene& scene, ColumnsByContact impacts,
         ColumnsByContact on, ColumnsByContact off, ColumnsByContact level, std::string time,
         std::optional<double> threshold, bool inverted, std::optional<std::string> impacts_at,
         std::optional<NumberOrText> unit, NumberOrText offset, double rate, double debounce,
         double pulse_shorter_than, double duration,
         std::optional<std::vector<std::string>> columns, std::optional<std::string> separator) {
        return run_import(
            file, scene,
            {std::move(impacts), std::move(on), std::move(off), std::move(level), std::move(time),
             threshold, inverted, std::move(impacts_at), std::move(unit), std::move(offset), rate,
             debounce, pulse_shorter_than, duration, std::move(columns), std::move(separator)});
      },
      py::arg("file"), py::arg("scene"), py::kw_only(), py::arg("impacts"), py::arg("on"),
      py::arg("off"), py::arg("level"), py::arg("time"), py::arg("threshold"), py::arg("inverted"),
      py::arg("impacts_at"), py::arg("unit"), py::arg("offset"), py::arg("rate"),
      py::arg("debounce"), py::arg("pulse_shorter_than"), py::arg("duration"), py::arg("columns"),
      py::arg("separator"), "See import_events().");
}

}  // namespace sprag::python
