// sync_logger with two states files.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "sprag/model.h"

namespace sprag {

struct OfflineOptions {
  std::filesystem::path truth, estimate, csv;
};

/// Pairs the rows of two states CSVs by t, writes the sync CSV, fills `report` and returns the exit
/// code: 1 if a file is damaged, which is reported on stderr; everything before the damage is used.
/// Throws InputError if a file does not exist, does not match the machine, or no instant is in
/// both; another exception if the CSV cannot be written.
int run_offline(const Model& model, const OfflineOptions& options, nlohmann::ordered_json& report);

}  // namespace sprag
