#include "tools/study/manifest.h"

#include <algorithm>
#include <cstdio>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/detail/study/quantities.h"

namespace sprag::study {
namespace {

using Json = nlohmann::ordered_json;

#if defined(__clang__)
constexpr const char* compiler = "clang " __clang_version__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif

std::string hex(std::uint64_t number) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(number));
  return text;
}

Json axis_object(const Axis& axis) {
  Json object{{"path", axis.path}};
  if (axis.values.empty()) {
    object["random"] = {axis.low, axis.high};
    object["logarithmic"] = axis.logarithmic;
  } else {
    object["values"] = axis.values;
  }
  if (axis.relative) object["relative"] = true;
  object["group"] = axis.group;
  return object;
}

}  // namespace

Json manifest(const Study& study, const Origin& origin) {
  Json axes = Json::array();
  for (const Axis& axis : study.axes) axes.push_back(axis_object(axis));
  return {{"name", study.name},
          {"version", origin.version},
          {"compiler", compiler},
          {"hash", hex(study.hash)},
          {"study", {{"file", study.file}, {"text", study.text}}},
          {"scene", {{"file", study.scene_file.string()}, {"text", study.scene_text}}},
          {"points", study.points},
          {"runs", study.runs},
          {"shard", {origin.shard, origin.shards}},
          {"indices", {origin.indices.first, origin.indices.end}},
          {"columns", columns(study)},
          {"axes", axes},
          {"group_size", study.group_size},
          {"workers", origin.workers},
          {"hosts", origin.hosts},
          {"chunk", origin.chunk},
          {"finished", false}};
}

void write_manifest(const std::filesystem::path& file, const Json& manifest) {
  const std::filesystem::path partly = file.string() + ".part";
  OutputFile output(partly);
  output.write(manifest.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  if (!output.close()) {
    std::error_code ignored;
    std::filesystem::remove(partly, ignored);
    throw std::runtime_error(output.error());
  }
  std::filesystem::rename(partly, file);
}

void check_manifest(const std::filesystem::path& file, const Json& manifest) {
  if (!std::filesystem::exists(file)) return;
  const Json there = Json::parse(read_whole(file), nullptr, false);
  const auto refuse = [&](const std::string& what) {
    throw InputError(file.string() + ": " + what +
                     "; move the folder away, or use another --output");
  };
  if (!there.is_object()) refuse("is no manifest of a study");
  const auto member = [](const Json& object, const char* key) {
    return object.contains(key) ? object.at(key) : Json();
  };
  for (const char* key : {"hash", "version", "compiler", "shard", "indices"}) {
    const Json was = member(there, key);
    const Json is = member(manifest, key);
    if (was == is) continue;
    const std::string named = std::string(key) == "hash" ? "study, scene or files" : key;
    refuse("belongs to another study: its " + named + " differs (" + was.dump() + ", now " +
           is.dump() + ")");
  }
}

}  // namespace sprag::study
