// Keys that ask for mechanics outside of the model: the answer is the limit, not a spelling.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sprag {

/// The limit that a key of the table `path` ("contact[1]", "system", ...; empty: the root) runs
/// into, as the end of a sentence that begins with the key; nothing for a key that names none.
std::optional<std::string> unsupported_key(std::string_view path, std::string_view key);

}  // namespace sprag
