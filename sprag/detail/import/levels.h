// Converts levels to times: rows of a time and the level of a channel, as written by logic
// analysers and oscilloscopes, become columns of the times at which the level rises and falls.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/import/column_file.h"
#include "sprag/detail/import/import.h"
#include "sprag/detail/import/level_edges.h"

namespace sprag {

struct LevelOptions {
  std::string time = {};                 ///< the column of times; empty: found by its name
  std::optional<double> threshold = {};  ///< none: 0.5, only for levels 0 and 1
  bool inverted = false;                 ///< the contact is closed while the level is low
  Edge impacts = Edge::closed;           ///< edges that are impacts; closed: sustained contacts
};

/// Adds columns of times to `columns` for the contacts that have a level, and assigns them to these
/// contacts. Rows must be in order of time. A level is high above the threshold; an edge is at the
/// first row after the change. Returns messages for the user, one line each. Throws InputError if
/// levels are not 0 and 1 and no threshold is specified, or without a column of times.
std::vector<std::string> expand_levels(const LevelOptions& options, const std::string& file,
                                       ColumnFile& columns, std::vector<ContactColumns>& chosen);

/// The name of a column whose rows alternate between 0 and 1, which suggests that a file of impacts
/// contains levels; nullopt if there is none.
std::optional<std::string> alternating_column(const ColumnFile& columns,
                                              const std::vector<ContactColumns>& chosen);

}  // namespace sprag
