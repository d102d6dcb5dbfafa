// The figures of a sync_logger run as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "tools/sync_logger/logger.h"

namespace sprag {

/// Rows, sessions, t, V and unpaired samples. Samples that still wait count as unpaired.
nlohmann::ordered_json to_json(const Pairing& pairing);

}  // namespace sprag
