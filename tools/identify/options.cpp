#include "tools/identify/options.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <vector>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"

namespace sprag {
namespace {

std::vector<std::string> words(const std::string& text) {
  std::vector<std::string> words;
  std::size_t at = 0;
  while (at <= text.size() && !text.empty()) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    if (comma > at) words.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  return words;
}

}  // namespace

IdentifyRequest request_of(const Scene& scene, const SoughtOptions& options) {
  IdentifyRequest request;
  if (!options.free.empty() && options.free != "all") request.free = words(options.free);
  request.known = words(options.known);
  request.causes = options.free.empty();
  for (const std::string& word : words(options.within)) {
    const std::size_t equals = word.find('=');
    const bool of_all = equals == std::string::npos;
    const std::optional<double> within = parse_double(of_all ? word : word.substr(equals + 1));
    if (!within) throw UsageError("--within: " + word + " must be a share, or NAME=SHARE");
    if (of_all) {
      request.within = within;
    } else {
      request.within_of[word.substr(0, equals)] = *within;
    }
  }
  try {
    sought(scene, request);
  } catch (const std::invalid_argument& error) {
    throw UsageError(error.what());
  }
  return request;
}

}  // namespace sprag
