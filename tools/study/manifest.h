// The manifest of a folder of results: study, scene, version, compiler. A study is continued only
// if all of these are the same.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sprag/detail/study/study_file.h"
#include "tools/study/schedule.h"

namespace sprag::study {

struct Origin {
  std::string version;  ///< of the program
  int workers = 1, hosts = 1;
  int chunk = 0;  ///< 0: chosen by computing time
  int shard = 1, shards = 1;
  Range indices;
};

nlohmann::ordered_json manifest(const Study& study, const Origin& origin);

/// Writes the manifest completely or not at all. Throws std::runtime_error.
void write_manifest(const std::filesystem::path& file, const nlohmann::ordered_json& manifest);

/// Throws InputError if the file exists and belongs to another study, version, compiler or shard.
void check_manifest(const std::filesystem::path& file, const nlohmann::ordered_json& manifest);

}  // namespace sprag::study
