#include "tools/plot/table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "command_line/program.h"
#include "sprag/detail/files/shipped_scenes.h"

namespace sprag::plot {
namespace {

// A file name may contain '='.
std::size_t label_end(const std::string& text) {
  const std::size_t equals = text.find('=');
  std::error_code no_such_name;  // the text may be too long for a name
  if (equals == std::string::npos || std::filesystem::exists(text, no_such_name)) {
    return std::string::npos;
  }
  return equals;
}

std::optional<TableKind> kind_of(const std::vector<std::string>& names) {
  const auto begins = [&](std::initializer_list<const char*> with) {
    return names.size() >= with.size() && std::equal(with.begin(), with.end(), names.begin());
  };
  if (begins({"t", "contact", "closed"})) return TableKind::events;
  if (begins({"t", "contact", "kind"})) return TableKind::impacts;
  if (begins({"made_at", "certain_until", "t", "contact"})) return TableKind::predictions;
  if (begins({"k", "t", "V"})) return TableKind::energy;
  if (begins({"k", "t", "q1"})) return TableKind::states;
  return std::nullopt;
}

// Machines have at most 60 contacts, numbered from 1. Larger numbers would waste memory.
constexpr double most_contacts = 60.0;

// Number of the column of contacts; 0: none.
std::size_t contact_column(TableKind kind) {
  if (kind == TableKind::events || kind == TableKind::impacts) return 1;
  return kind == TableKind::predictions ? 3 : 0;
}

// Accepts infinite values, unlike parse_double(), since a sigma may be infinite.
double number(std::string_view field) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  const bool whole = error == std::errc{} && end == field.data() + field.size();
  if (whole) return value;
  if (field == "impact") return impact_kind;
  if (field == "closes") return closes_kind;
  if (field == "opens") return opens_kind;
  return std::numeric_limits<double>::quiet_NaN();
}

// A prediction without an event has no contact.
bool is_contact(std::string_view field, TableKind kind) {
  if (kind == TableKind::predictions && field.empty()) return true;
  const double contact = number(field);
  return contact >= 1.0 && contact <= most_contacts && contact == std::floor(contact);
}

}  // namespace

const std::vector<double>* Table::column(std::string_view name) const {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? nullptr : &columns[static_cast<std::size_t>(at - names.begin())];
}

std::filesystem::path file_of(const std::string& text) {
  const std::size_t end = label_end(text);
  return find_scene(end == std::string::npos ? text : text.substr(end + 1), scenes_folder());
}

std::string label_of(const std::string& text) {
  const std::size_t end = label_end(text);
  return end == std::string::npos ? file_of(text).stem().string() : text.substr(0, end);
}

bool is_estimate(const Table& states) {
  return std::any_of(states.names.begin(), states.names.end(), [](const std::string& name) {
    return name == "B" || name.starts_with("sigma_") || name.starts_with("bound_");
  });
}

const char* name(TableKind kind) {
  switch (kind) {
    case TableKind::states:
      return "states";
    case TableKind::events:
      return "events";
    case TableKind::energy:
      return "V";
    case TableKind::impacts:
      return "impacts";
    case TableKind::predictions:
      return "predictions";
  }
  return "";
}

Table read_table(const std::string& text) {
  const std::filesystem::path file = file_of(text);
  Table table;
  table.label = label_of(text);
  LineReader reader(file);
  std::string_view line;
  std::vector<std::string_view> fields;
  if (reader.next(line) == LineReader::Result::line) {
    split_fields(line, fields);
    table.names.assign(fields.begin(), fields.end());
  }
  const std::optional<TableKind> kind = kind_of(table.names);
  if (!kind) {
    throw InputError(
        file.string() +
        ":1: the header begins neither with k,t,q1 (states), k,t,V (sync_logger), "
        "t,contact,closed (events), t,contact,kind (impacts) nor made_at,certain_until,t,contact "
        "(predictions)");
  }
  table.kind = *kind;
  table.columns.resize(table.names.size());
  for (;;) {
    const LineReader::Result result = reader.next(line);
    if (result == LineReader::Result::end) break;
    if (result != LineReader::Result::line) {
      table.damage = {reader.number(), describe(result)};
      break;
    }
    split_fields(line, fields);
    if (fields.size() != table.names.size()) {
      table.damage = {reader.number(), std::to_string(fields.size()) + " fields; the header has " +
                                           std::to_string(table.names.size())};
      break;
    }
    const std::size_t contact = contact_column(table.kind);
    if (contact > 0 && !is_contact(fields[contact], table.kind)) {
      table.damage = {reader.number(), "contact " + std::string(fields[contact]) +
                                           "; must be a whole number in 1 to 60"};
      break;
    }
    if (table.kind == TableKind::events && fields.size() > 3 && fields[3] == "spurious") {
      ++table.left_out;
      continue;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) table.columns[i].push_back(number(fields[i]));
  }
  return table;
}

}  // namespace sprag::plot
