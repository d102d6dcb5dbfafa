#include "tools/identify/options.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/parameters/clock_ambiguity.h"

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

Unknown named(const Scene& scene, const std::string& key) {
  try {
    return unknown_of(scene, key);
  } catch (const std::invalid_argument& error) {
    throw UsageError(error.what());
  }
}

void set_within(const Scene& scene, const std::string& text, std::vector<Unknown>& unknowns) {
  for (const std::string& word : words(text)) {
    const std::size_t equals = word.find('=');
    const std::string number = equals == std::string::npos ? word : word.substr(equals + 1);
    const double within = parse_double(number).value_or(0.0);
    if (!(within > 0.0) || !(within <= 10.0)) {
      throw UsageError("--within: " + word + " must be a share in (0, 10], or NAME=SHARE");
    }
    const std::string key = equals == std::string::npos ? "" : word.substr(0, equals);
    if (!key.empty()) named(scene, key);
    for (Unknown& unknown : unknowns) {
      if (key.empty() || unknown.key == key) unknown.within = within;
    }
  }
}

}  // namespace

std::vector<Unknown> sought(const Scene& scene, const SoughtOptions& options) {
  const std::vector<std::string> known = words(options.known);
  for (const std::string& key : known) named(scene, key);
  const auto is_known = [&](const std::string& key) {
    return std::find(known.begin(), known.end(), key) != known.end();
  };
  std::vector<Unknown> unknowns;
  if (!options.free.empty() && options.free != "all") {
    for (const std::string& key : words(options.free)) {
      if (is_known(key)) throw UsageError("--free and --known both name " + key);
      const auto same = [&](const Unknown& unknown) { return unknown.key == key; };
      if (std::none_of(unknowns.begin(), unknowns.end(), same)) {
        unknowns.push_back(named(scene, key));
      }
    }
  } else {
    unknowns = all_but_the_scale(scene, known);
  }
  // Collects the value of --within for all unknowns and those for single names.
  std::string for_all, for_names;
  for (const std::string& word : words(options.within)) {
    (word.find('=') == std::string::npos ? for_all : for_names) += word + ',';
  }
  set_within(scene, for_all, unknowns);
  set_within(scene, for_names, unknowns);
  return unknowns;
}

std::string held_for_scale(const Scene& scene, const std::vector<Unknown>& sought) {
  const auto is_sought = [&](const Unknown& unknown) {
    return std::any_of(sought.begin(), sought.end(),
                       [&](const Unknown& other) { return other.key == unknown.key; });
  };
  std::string held;
  for (const Unknown& unknown : unknowns_of(scene)) {
    if (!carries_scale(unknown) || is_sought(unknown)) continue;
    if (!held.empty()) return "";  // two are known: the scene gives the scale
    held = unknown.key;
  }
  return held;
}

std::vector<Unknown> single_causes(const Scene& scene, const std::vector<Unknown>& sought) {
  std::vector<Unknown> causes = sought;
  const std::vector<Unknown> all = unknowns_of(scene);
  // An amplitude is identifiable only if something else fixes the scale.
  const auto scales = std::count_if(all.begin(), all.end(), carries_scale);
  for (const Unknown& unknown : all) {
    const bool is_there = std::any_of(causes.begin(), causes.end(), [&](const Unknown& other) {
      return other.key == unknown.key;
    });
    if (!is_there && (!carries_scale(unknown) || scales > 1)) causes.push_back(unknown);
  }
  const bool one_frequency = harmonic_groups(scene).size() < 2;
  for (const Unknown& unknown : clock_unknowns(scene)) {
    const bool is_phase = unknown.kind == Unknown::Kind::clock_offset && one_frequency;
    if (!is_phase && !clock_ambiguity(scene, {}, unknown)) causes.push_back(unknown);
  }
  return causes;
}

}  // namespace sprag
