// Levels in place of times: rows of a time and the level of a channel then, as logic analysers and
// oscilloscopes write them, become columns of the times at which it rises and falls.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/import_events/choice.h"
#include "tools/import_events/column_file.h"

namespace sprag {

enum class Edge { closed, rising, falling, both };

struct LevelOptions {
  std::string time = {};                 ///< the column of times; empty: recognized
  std::optional<double> threshold = {};  ///< none: 0.5, for levels that are 0 and 1 alone
  bool inverted = false;                 ///< the contact is closed while the level is low
  Edge impacts = Edge::closed;           ///< which edges are impacts; closed: none of them
};

/// Adds columns of times to `columns` for the contacts that have a level, and points these contacts
/// at them. Rows are in the order of time. A level that is high is above the threshold; an edge is
/// at the first row behind it. Returns what is to be said, a line each. Throws UsageError where
/// levels are not 0 and 1 and no threshold is given, InputError where there is no column of times.
std::vector<std::string> expand_levels(const LevelOptions& options, const std::string& file,
                                       ColumnFile& columns, std::vector<ContactColumns>& chosen);

/// Whether a file of impacts looks like one of levels: a column of which the rows alternate between
/// 0 and 1. Its name, or nothing.
std::optional<std::string> alternating_column(const ColumnFile& columns,
                                              const std::vector<ContactColumns>& chosen);

}  // namespace sprag
