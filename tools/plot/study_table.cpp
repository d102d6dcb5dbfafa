#include "tools/plot/study_table.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "sprag/detail/files/input_file.h"

namespace sprag::plot {
namespace {

constexpr std::string_view study_header = "index,point,run";

double number_or_nan(std::string_view field) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  const bool whole = error == std::errc{} && end == field.data() + field.size();
  return whole ? value : std::numeric_limits<double>::quiet_NaN();
}

void read_manifest(const std::filesystem::path& file, StudyTable& table) {
  std::ifstream stream(file);
  if (!stream) return;
  try {
    const nlohmann::json manifest = nlohmann::json::parse(stream);
    table.name = manifest.at("name").get<std::string>();
    std::set<nlohmann::json> groups;
    for (const auto& axis : manifest.at("axes")) {
      const bool alone = !axis.contains("group");
      if (alone || groups.insert(axis.at("group")).second) {
        table.axes.push_back(axis.at("path").get<std::string>());
      }
    }
  } catch (const nlohmann::json::exception& error) {
    throw InputError(file.string() + ": no manifest of a study: " + error.what());
  }
}

void read_rows(const std::filesystem::path& file, StudyTable& table) {
  LineReader reader(file);
  std::string_view line;
  std::vector<std::string_view> fields;
  std::vector<std::string> names;
  if (reader.next(line) == LineReader::Result::line) {
    split_fields(line, fields);
    names.assign(fields.begin(), fields.end());
  }
  if (table.names.empty()) {
    table.names = names;
    table.columns.resize(names.size());
  } else if (names != table.names) {
    throw InputError(file.string() + ":1: the header is not that of the first file");
  }
  for (;;) {
    const LineReader::Result result = reader.next(line);
    if (result == LineReader::Result::end) return;
    if (result != LineReader::Result::line) {
      table.damage = {reader.number(), describe(result)};
      return;
    }
    split_fields(line, fields);
    if (fields.size() != table.names.size()) {
      table.damage = {reader.number(), std::to_string(fields.size()) + " fields; the header has " +
                                           std::to_string(table.names.size())};
      return;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
      table.columns[i].push_back(number_or_nan(fields[i]));
    }
  }
}

}  // namespace

const std::vector<double>* StudyTable::column(std::string_view of) const {
  const auto found = std::find(names.begin(), names.end(), of);
  return found == names.end() ? nullptr : &columns[static_cast<std::size_t>(found - names.begin())];
}

std::filesystem::path manifest_of(const std::filesystem::path& rows) {
  std::filesystem::path manifest = rows;
  if (rows.stem().string().starts_with("rows")) return manifest.replace_filename("manifest.json");
  return manifest.replace_extension(".json");
}

bool is_study(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string header(study_header.size(), '\0');
  return stream.read(header.data(), static_cast<std::streamsize>(header.size())) &&
         header == study_header;
}

StudyTable read_study_table(const std::vector<std::filesystem::path>& files) {
  StudyTable table;
  table.name = std::filesystem::absolute(files.front()).parent_path().filename().string();
  for (const std::filesystem::path& file : files) {
    if (table.axes.empty()) read_manifest(manifest_of(file), table);
    read_rows(file, table);
  }
  return table;
}

}  // namespace sprag::plot
