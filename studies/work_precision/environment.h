// What the figures were measured on and with.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace sprag::work_precision {

/// cpu, kernel, compiler, flags, date (UTC) and the versions of the libraries built in.
nlohmann::ordered_json environment();

}  // namespace sprag::work_precision
