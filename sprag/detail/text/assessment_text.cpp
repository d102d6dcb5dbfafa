#include <algorithm>

#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/text/table.h"

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

// Contacts that never closed, "contact 2" or "contacts 1 and 2"; empty: none.
std::string idle_contacts(const Trial& trial) {
  std::string numbers;
  int count = 0;
  for (std::size_t i = 0; i < trial.contacts.size(); ++i) {
    if (trial.contacts[i].closings > 0) continue;
    numbers += (count == 0 ? "" : ", ") + std::to_string(i + 1);
    ++count;
  }
  if (count == 0) return {};
  return (count == 1 ? "contact " : "contacts ") + numbers;
}

// Reason of the verdict on the default estimator.
std::string reason(const Assessment& a) {
  const bool filter = a.filter && a.filter->follows();
  const std::string known =
      filter ? "its filter knows the motion from t = " + readable(a.filter->known_from) +
                   " of a trial run on, by the contact times"
             : "its filter does not get to know all of the motion in a trial run";
  if (filter && a.synchronizes()) {
    return known + ", and its replica forgets any error (Theorem 1)";
  }
  if (filter) {
    return known +
           ". That needs a scene that is right, and contact times without gaps for long: "
           "its replica has no promise of Theorem 1";
  }
  if (a.synchronizes()) {
    return known + ", but its replica forgets any error (Theorem 1), without impacts by " +
           readable(a.decades) + " decades of V per unit of time";
  }
  return known +
         ", and its replica has no promise of Theorem 1. The lines with NO and note say why";
}

}  // namespace

std::string headline(const Assessment& a) {
  if (!a.M.definite()) return "may not synchronize: M is no mass matrix";
  std::string provided;
  for (const std::string& condition : a.conditions()) {
    provided += (provided.empty() ? ", provided that " : ", and that ") + condition;
  }
  std::string text = "may not synchronize";
  if (a.synchronizes()) {
    text = "will synchronize" + provided;
  } else if (a.both_follows()) {
    text = "will follow the machine, without the promise of Theorem 1";
  }
  text += a.both_follows() ? "\nyes" + (a.synchronizes() ? provided : "") : "\nno";
  text += ": the default estimator, both: " + reason(a);
  const std::string idle = idle_contacts(a.trial);
  if (!idle.empty()) text += ". Never closed in the trial: " + idle;
  return text;
}

std::string to_text(const Assessment& a) {
  const std::string head_line = headline(a);
  const std::size_t end = std::min(head_line.find('\n'), head_line.size());
  std::string text = a.scene + ": ";
  append_wrapped(text, head_line.substr(0, end), 0);
  if (end < head_line.size()) append_wrapped(text, head_line.substr(end + 1), 0);
  text += std::string("\nTheorem 1, for --estimator replica: ") + a.verdict() + "\n\n";
  for (const Finding& finding : a.findings) append_finding(finding, text);
  if (!a.M.definite()) return text;
  const std::string head = "     pace";
  text += head + std::string(margin - head.size(), ' ');
  append_wrapped(text, pace(a), margin);
  return text;
}

}  // namespace sprag
