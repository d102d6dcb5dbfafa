// Hardware and software environment of the measurements.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace sprag::work_precision {

/// cpu, kernel, compiler, flags, date (UTC) and the versions of the linked libraries.
nlohmann::ordered_json environment();

}  // namespace sprag::work_precision
