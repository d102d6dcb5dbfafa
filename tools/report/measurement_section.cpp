#include <algorithm>
#include <cmath>
#include <map>

#include "tools/report/analysis.h"
#include "tools/report/sections.h"

namespace sprag::report {
namespace {

struct OfContact {
  std::size_t impacts = 0, closings = 0, openings = 0;
  double first = 0.0, last = 0.0, closed = 0.0, since = -1.0;
  bool any = false;
};

TextTable counts(const std::vector<ReportedEvent>& events, std::size_t contacts) {
  std::vector<OfContact> of(contacts);
  for (const ReportedEvent& event : events) {
    const auto i = static_cast<std::size_t>(event.contact - 1);
    if (i >= of.size()) of.resize(i + 1);
    OfContact& at = of[i];
    if (!at.any) at.first = event.t;
    at.any = true;
    at.last = event.t;
    if (event.kind == plot::impact_kind) {
      ++at.impacts;
    } else if (event.kind == plot::closes_kind) {
      ++at.closings;
      at.since = event.t;
    } else {
      ++at.openings;
      if (at.since >= 0.0) at.closed += event.t - at.since;
      at.since = -1.0;
    }
  }
  TextTable table{
      "Contact events",
      {"contact", "impacts", "sustained contacts", "time closed [s]", "first [s]", "last [s]"},
      {}};
  for (std::size_t i = 0; i < of.size(); ++i) {
    const OfContact& at = of[i];
    table.rows.push_back({std::to_string(i + 1), std::to_string(at.impacts),
                          std::to_string(at.closings), rounded(at.closed),
                          at.any ? rounded(at.first, 6) : "", at.any ? rounded(at.last, 6) : ""});
  }
  return table;
}

// What the observer's report says about the events.
void add_reception(const ObserverRun& run, Section& section) {
  if (run.figures == nullptr) return;
  TextTable table{"Events of the run " + run.label + ", by its report", {"quantity", "value"}, {}};
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) table.rows.push_back({name, value});
  };
  add("events taken", count_at(*run.figures, "/events"));
  add("events inferred after a gap", count_at(*run.figures, "/made_up_events"));
  add("records lost", count_at(*run.figures, "/lost_records"));
  if (const Json* skipped = at(*run.figures, "/skipped");
      skipped != nullptr && skipped->is_object()) {
    std::string causes;
    for (const auto& [cause, count] : skipped->items()) {
      if (!count.is_number_unsigned() || count == 0) continue;
      causes += (causes.empty() ? "" : ", ") + count.dump() + " " + cause;
    }
    add("events skipped", causes.empty() ? "0" : causes);
  }
  const Json degraded = list_at(*run.figures, "/degraded");
  add("intervals in which events may be missing", std::to_string(degraded.size()));
  if (const auto free = number_at(*run.figures, "/runs_free_from")) {
    add("no event after, so that the estimate runs free from there", rounded(*free, 8) + " s");
  }
  add("messages received", count_at(*run.figures, "/messages/received"));
  add("messages lost", count_at(*run.figures, "/messages/lost"));
  if (!table.rows.empty()) section.blocks.emplace_back(std::move(table));
}

}  // namespace

Section measurement_section(const Inputs& inputs) {
  Section section{"What was measured", {}};
  const plot::Table* source = inputs.first(plot::TableKind::events);
  if (source == nullptr) source = inputs.first(plot::TableKind::impacts);
  if (source == nullptr) {
    section.blocks.emplace_back(
        Paragraph{"The files contain no events: neither an events CSV nor an impacts CSV."});
  } else {
    const std::vector<ReportedEvent> events = reported_events(*source);
    std::string text =
        "The times at which contacts close and open; nothing else. The recording "
        "has " +
        std::to_string(events.size()) + " events";
    if (!events.empty()) {
      text += " from t = " + rounded(events.front().t, 6) + " s to " + rounded(events.back().t, 6) +
              " s";
    }
    text += ".";
    if (source->left_out > 0) {
      text += " " + std::to_string(source->left_out) +
              " rows are marked as spurious and not "
              "counted.";
    }
    section.blocks.emplace_back(Paragraph{text});
    section.blocks.emplace_back(counts(events, inputs.scene.model.contacts.size()));
  }
  for (const ObserverRun& run : inputs.runs()) add_reception(run, section);
  return section;
}

}  // namespace sprag::report
