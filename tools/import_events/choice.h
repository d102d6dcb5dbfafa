// Assigns columns of a file to contacts by the options of the command line.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/import/import.h"

namespace sprag {

enum class ColumnRole { impacts, on, off, level };

/// One --impacts, --on, --off or --level: NAME or CONTACT=NAME.
struct ColumnOption {
  ColumnRole role;
  std::string text;
};

/// The columns of each named contact, contacts ascending. Either all options have a contact (from
/// 1) or none. Without numbers every --impacts, --on and --level is the next contact, and the k-th
/// --off belongs to the k-th --on. Without options the only column of a file is the impacts of a
/// scene's only contact. Throws UsageError, InputError; `file` is the name in errors.
std::vector<ContactColumns> choose_columns(const std::vector<ColumnOption>& options,
                                           const ColumnFile& columns, int contacts,
                                           const std::string& file);

}  // namespace sprag
