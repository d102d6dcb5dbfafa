#include <algorithm>

#include "sprag/analysis/assessment.h"
#include "sprag/analysis/wrapped_text.h"

namespace sprag {
namespace {

constexpr std::size_t margin = 18;

const char* mark(const Finding& finding) {
  if (!finding.required) return finding.holds ? "    " : "note";
  return finding.holds ? "yes " : "NO  ";
}

void append_finding(const Finding& finding, std::string& text) {
  std::string head = std::string(mark(finding)) + ' ' + finding.id;
  head.resize(std::max(margin, head.size() + 1), ' ');
  text += head;
  append_wrapped(text, finding.what, margin);
  if (finding.change.empty()) return;
  text += std::string(margin, ' ');
  append_wrapped(text, "-> " + finding.change, margin);
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
  append_wrapped(text, pace(a), margin);
  return text;
}

}  // namespace sprag
