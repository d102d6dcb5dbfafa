#include "sprag/detail/import/levels.h"

#include <algorithm>
#include <cctype>
#include <limits>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/import/decimal.h"
#include "sprag/detail/import/level_edges.h"

namespace sprag {

namespace {

bool begins_with_time(const std::string& name) {
  constexpr std::string_view word = "time";
  return name.size() >= word.size() &&
         std::equal(word.begin(), word.end(), name.begin(), [](char a, char b) {
           return a == std::tolower(static_cast<unsigned char>(b));
         });
}

std::size_t time_column(const LevelOptions& options, const std::string& file,
                        const ColumnFile& columns) {
  if (!options.time.empty()) return columns.find(options.time, file);
  std::vector<std::size_t> named;
  for (std::size_t i = 0; i < columns.columns.size(); ++i) {
    if (begins_with_time(columns.columns[i].name)) named.push_back(i);
  }
  if (named.size() == 1) return named[0];
  throw InputError(file +
                   (named.empty() ? ": no column's name begins with 'Time'"
                                  : ": more than one column's name begins with 'Time'") +
                   "; say which has the times: --time NAME");
}

struct Level {
  const Cell* time;
  double value;
};

// Time and level of the rows that have both.
std::vector<Level> levels_of(std::size_t times, std::size_t channel, ColumnFile& columns) {
  const auto mark = columns.separator == ',' ? DecimalMark::point : DecimalMark::point_or_comma;
  std::vector<Level> levels;
  const std::vector<Cell>& of_time = columns.columns[times].cells;
  auto time = of_time.begin();
  for (const Cell& cell : columns.columns[channel].cells) {
    while (time != of_time.end() && time->line < cell.line) ++time;
    if (time == of_time.end()) break;
    if (time->line != cell.line) continue;
    const auto number = parse_decimal(cell.text, mark);
    if (!number) {
      columns.problems.push_back({cell.line, columns.columns[channel].name,
                                  std::string(cell.text) + " is not a finite number"});
      continue;
    }
    levels.push_back({&*time, difference_in(*number, {}, {1, 0})});
  }
  return levels;
}

double threshold_of(const LevelOptions& options, const std::string& name,
                    const std::vector<Level>& levels) {
  if (options.threshold) return *options.threshold;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  bool digital = true;
  for (const Level& level : levels) {
    digital = digital && (level.value == 0.0 || level.value == 1.0);
    low = std::min(low, level.value);
    high = std::max(high, level.value);
  }
  if (!digital) {
    throw InputError("the levels of " + quoted(name) + " are not 0 and 1 (from " +
                     std::to_string(low) + " to " + std::to_string(high) +
                     "); say from where on it is high: --threshold X");
  }
  return 0.5;
}

}  // namespace

std::vector<std::string> expand_levels(const LevelOptions& options, const std::string& file,
                                       ColumnFile& columns, std::vector<ContactColumns>& chosen) {
  std::vector<std::string> said;
  for (ContactColumns& contact : chosen) {
    if (!contact.level) continue;
    const std::size_t times = time_column(options, file, columns);
    const std::string name = columns.columns[*contact.level].name;
    if (times == *contact.level) {
      throw InputError("column " + quoted(name) + " is the one of times and has no levels");
    }
    const std::vector<Level> levels = levels_of(times, *contact.level, columns);
    const double threshold = threshold_of(options, name, levels);
    // The time column's name at the end provides the unit.
    const std::string of = name + " at " + columns.columns[times].name;
    Column rises{of, {}}, falls{of, {}}, edges{of, {}};
    LevelEdges edges_of(threshold, options.inverted);
    for (const Level& level : levels) {
      const bool first = !edges_of.high();
      const LevelChange change = edges_of.take(level.value);
      if (first && *edges_of.high() && options.impacts == Edge::closed)
        rises.cells.push_back(*level.time);
      if (change == LevelChange::none) continue;
      (change == LevelChange::rises ? rises : falls).cells.push_back(*level.time);
      edges.cells.push_back(*level.time);
    }
    const auto add = [&](Column& column) {
      columns.columns.push_back(std::move(column));
      return columns.columns.size() - 1;
    };
    switch (options.impacts) {
      case Edge::closed:
        contact.on = add(rises);
        contact.off = add(falls);
        break;
      case Edge::rising:
        contact.impacts = add(rises);
        break;
      case Edge::falling:
        contact.impacts = add(falls);
        break;
      case Edge::both:
        contact.impacts = add(edges);
        said.push_back("both edges of " + quoted(name) +
                       " are taken as impacts: a contact that closes and opens counts twice; "
                       "--impacts-at rising or falling takes one of them");
        break;
    }
  }
  return said;
}

std::optional<std::string> alternating_column(const ColumnFile& columns,
                                              const std::vector<ContactColumns>& chosen) {
  constexpr std::size_t fewest = 4;
  if (std::none_of(chosen.begin(), chosen.end(),
                   [](const ContactColumns& of) { return of.impacts && !of.level; })) {
    return std::nullopt;
  }
  for (const Column& column : columns.columns) {
    if (column.cells.size() < fewest) continue;
    bool alternates = true;
    for (std::size_t i = 0; alternates && i < column.cells.size(); ++i) {
      const std::string_view text = column.cells[i].text;
      alternates = (text == "0" || text == "1") && (i == 0 || text != column.cells[i - 1].text);
    }
    if (alternates) return column.name;
  }
  return std::nullopt;
}

}  // namespace sprag
