#include <algorithm>
#include <string_view>

#include "sprag/analysis/assessment.h"

namespace sprag {
namespace {

constexpr std::size_t columns = 100;
constexpr std::size_t margin = 18;

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
      text += '\n';
      text.append(margin, ' ');
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

}  // namespace

std::string to_text(const Assessment& a) {
  std::string text = a.scene + ": " + a.verdict() + "\n\n";
  for (const Finding& finding : a.findings) append_finding(finding, text);
  if (!a.M.definite()) return text;
  const std::string head = "     pace";
  text += head + std::string(margin - head.size(), ' ');
  append_wrapped(pace(a), margin, text);
  return text;
}

}  // namespace sprag
