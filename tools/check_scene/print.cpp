#include "tools/check_scene/print.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

namespace sprag {
namespace {

constexpr std::size_t columns = 100;
constexpr std::size_t margin = 18;

const char* verdict(const Assessment& a) {
  return a.synchronizes() ? "will synchronize" : "may not synchronize";
}

const char* mark(const Finding& finding) {
  if (!finding.required) return finding.holds ? "    " : "note";
  return finding.holds ? "yes " : "NO  ";
}

/// Appends words, broken into lines that start at the margin; the first has `used` characters.
void append_wrapped(std::string_view words, std::size_t used, std::string& text) {
  bool fresh = true;
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(' '));
    words.remove_prefix(std::min(word.size() + 1, words.size()));
    if (!fresh && used + 1 + word.size() > columns) {
      text += '\n' + std::string(margin, ' ');
      used = margin;
      fresh = true;
    }
    if (!fresh) text += ' ';
    text += word;
    used += word.size() + (fresh ? 0 : 1);
    fresh = false;
  }
  text += '\n';
}

void append_finding(const Finding& finding, std::string& text) {
  std::string head = std::string(mark(finding)) + ' ' + finding.id;
  head.resize(std::max(margin, head.size() + 1), ' ');
  text += head;
  append_wrapped(finding.what, head.size(), text);
  if (finding.change.empty()) return;
  text += std::string(margin, ' ');
  append_wrapped("-> " + finding.change, margin, text);
}

std::string pace(const Assessment& a) {
  std::string text = "without impacts V falls by " + readable(a.decades) +
                     " decades per unit of time in the end, as its slowest mode does";
  if (a.decades == 0.0) text = "without impacts some part of the error never decays";
  return text + "; exact flow by the " + name(a.path) + " path";
}

nlohmann::ordered_json modes_json(const std::vector<Mode>& modes) {
  auto list = nlohmann::ordered_json::array();
  for (const Mode& mode : modes) {
    nlohmann::ordered_json entry{{"omega", mode.omega}, {"decades", mode.decades}};
    if (mode.contact >= 0) {
      entry["contact"] = mode.contact + 1;
      entry["projection"] = mode.projection;
    }
    entry["seen"] = mode.seen;
    entry["barely_seen"] = mode.barely_seen();
    list.push_back(std::move(entry));
  }
  return list;
}

nlohmann::ordered_json trial_json(const Trial& trial) {
  nlohmann::ordered_json object{{"planned", trial.planned},
                                {"duration", trial.duration},
                                {"error", trial.error},
                                {"closings", trial.closings},
                                {"closings_per_time", trial.closings_per_time()},
                                {"growth", trial.growth}};
  object["contacts"] = nlohmann::ordered_json::array();
  for (const ContactUse& use : trial.contacts) {
    object["contacts"].push_back({{"closings", use.closings},
                                  {"sustained_share", use.share},
                                  {"sustained_share_last_quarter", use.last_share}});
  }
  return object;
}

}  // namespace

std::string to_text(const Assessment& a) {
  std::string text = a.scene + ": " + verdict(a) + "\n\n";
  for (const Finding& finding : a.findings) append_finding(finding, text);
  if (!a.M.definite()) return text;
  const std::string head = "     pace";
  text += head + std::string(margin - head.size(), ' ');
  append_wrapped(pace(a), margin, text);
  return text;
}

void to_json(const Assessment& a, nlohmann::ordered_json& object) {
  object["scene"] = a.scene;
  object["verdict"] = verdict(a);
  object["synchronizes"] = a.synchronizes();
  object["coordinates"] = a.coordinates;
  object["smallest_eigenvalue"] = {{"M", a.M.smallest}, {"C", a.C.smallest}, {"K", a.K.smallest}};
  if (a.M.definite()) {
    object["W"] = {{"rank", a.W.rank}, {"condition", a.W.condition}};
    object["impact"] = {{"law", a.law == ImpactLaw::newton ? "newton" : "poisson"},
                        {"monotone", a.monotonicity.holds()},
                        {"common_restitution", a.monotonicity.common}};
    if (!a.monotonicity.common) object["impact"]["margin"] = a.monotonicity.margin;
    object["path"] = name(a.path);
    object["slow_root"] = a.slow_root;
    object["decades"] = a.decades;
    object["omega_max"] = a.omega_max;
    object["moreau_tick"] = a.moreau_tick;
    object["modes"] = modes_json(a.modes);
    object["trial"] = trial_json(a.trial);
  }
  if (a.accuracy) {
    auto changes = nlohmann::ordered_json::array();
    for (const Accuracy::Change& change : a.accuracy->changes) {
      changes.push_back({{"modes", change.modes}, {"change", change.change}});
    }
    object["accuracy"] = {{"tolerance", a.accuracy->tolerance},
                          {"duration", a.accuracy->duration},
                          {"modes", a.accuracy->modes},
                          {"changes", std::move(changes)}};
  }
  object["findings"] = nlohmann::ordered_json::array();
  for (const Finding& finding : a.findings) {
    object["findings"].push_back({{"id", finding.id},
                                  {"required", finding.required},
                                  {"holds", finding.holds},
                                  {"what", finding.what},
                                  {"change", finding.change}});
  }
}

}  // namespace sprag
