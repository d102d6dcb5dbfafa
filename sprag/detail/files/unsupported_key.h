// Keys that request mechanics outside of the model. The message explains the limit of the model
// instead of suggesting another spelling.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sprag {

/// The limit that a key of the table `path` ("contact[1]", "system", ...; empty: the root) exceeds,
/// as the end of a sentence that begins with the key; nullopt for any other key.
std::optional<std::string> unsupported_key(std::string_view path, std::string_view key);

}  // namespace sprag
