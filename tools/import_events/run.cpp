#include "tools/import_events/run.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "lcmtypes/contact_log.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/import/unit.h"
#include "sprag/events_file.h"
#include "tools/import_events/hints.h"

namespace sprag {

namespace {

constexpr std::size_t most_problems_shown = 20;
constexpr double hardly_a_run = 1e7;  // s; later times are those of a clock, as since 1970

void check_output(const ImportRun& run) {
  const auto extension = run.output.extension();
  if (run.output.empty()) return;
  if (extension != ".csv" && extension != ".lcmlog")
    throw UsageError("--output is " + run.output.string() + "; must end in .csv or .lcmlog");
}

void print_problems(const std::string& file, const std::vector<RowProblem>& problems) {
  const std::size_t shown = std::min(problems.size(), most_problems_shown);
  for (std::size_t i = 0; i < shown; ++i)
    std::cerr << file << ':' << to_text(problems[i]) << "; left out\n";
  if (shown < problems.size())
    std::cerr << file << ": " << problems.size() - shown << " more bad rows left out\n";
}

void print_summary(const Import& import) {
  for (const ContactFigures& figures : import.figures) {
    if (figures.pulses + figures.sustained == 0) {
      std::cerr << "contact " << figures.contact + 1 << " has no events\n";
      continue;
    }
    std::cerr << "contact " << figures.contact + 1 << ": " << figures.pulses << " pulses, "
              << figures.sustained << " sustained, " << figures.merged << " bounces merged\n";
  }
  std::cerr << import.events.size() << " events";
  if (!import.events.empty())
    std::cerr << " from t = " << import.events.front().t << " to " << import.events.back().t;
  std::cerr << "; left out: " << import.problems.size() << " bad rows, " << import.before_start
            << " events before t = 0, " << import.after_duration << " after the duration\n";
}

// Instruments print ascending times, unless a counter wraps or the instrument restarts.
void print_falls(const std::string& file, const Import& import) {
  for (const RowProblem& fall : import.falls) {
    std::cerr
        << file << ':' << to_text(fall)
        << "; the rows are sorted by time. Wrong if a counter has wrapped, the instrument was "
           "restarted, or digits are missing: correct the times, or import each part alone\n";
  }
}

// A row of units, as '(ms),(V)', below the header: its unit would be ignored.
void refuse_row_of_units(const ImportRun& run, const ColumnFile& columns, const std::string& file) {
  if (run.unit) return;
  for (const Column& column : columns.columns) {
    if (column.cells.empty()) return;
    const std::string_view text = column.cells.front().text;
    const bool brackets = (text.starts_with('(') && text.ends_with(')')) ||
                          (text.starts_with('[') && text.ends_with(']'));
    if (!brackets) return;
  }
  const Cell& first = columns.columns.front().cells.front();
  throw InputError(file + ":" + std::to_string(first.line) + ": is a row of units, '" +
                   std::string(first.text) +
                   "', that is not read; say the unit of the times with --unit");
}

void fill(const Import& import, nlohmann::ordered_json& report) {
  report["events"] = import.events.size();
  if (!import.events.empty()) {
    report["first_t"] = import.events.front().t;
    report["last_t"] = import.events.back().t;
  }
  report["contacts"] = nlohmann::ordered_json::array();
  for (const ContactFigures& figures : import.figures) {
    report["contacts"].push_back({{"contact", figures.contact + 1},
                                  {"pulses", figures.pulses},
                                  {"sustained", figures.sustained},
                                  {"merged", figures.merged}});
  }
  report["bad_rows"] = import.problems.size();
  report["before_start"] = import.before_start;
  report["after_duration"] = import.after_duration;
}

void print_hints(const Import& import, nlohmann::ordered_json& report) {
  std::vector<std::string> hints = hints_at_bounces(import);
  if (const std::optional<Batches> batches = find_batches(import.closings)) {
    hints.push_back(to_text(*batches, import.closings.size()));
    report["batches"] = {{"period", batches->period}, {"events", batches->events}};
  }
  for (const std::string& hint : hints) std::cerr << hint << '\n';
  report["hints"] = hints;
}

void write_csv(const ImportRun& run, const std::vector<ContactEvent>& events) {
  EventsWriter writer(run.output.empty() ? OutputFile::standard_output() : OutputFile(run.output));
  for (const ContactEvent& event : events) writer.write(event);
  writer.finish();
}

void check_levels(const ImportRun& run, const std::vector<ContactColumns>& chosen) {
  const LevelOptions& levels = run.levels;
  const bool given =
      !levels.time.empty() || levels.threshold || levels.inverted || levels.impacts != Edge::closed;
  const bool any = std::ranges::any_of(chosen, [](const auto& of) { return of.level.has_value(); });
  if (given && !any)
    throw UsageError("--time, --threshold, --inverted and --impacts-at are for --level");
}

void warn_of_unfed(const std::vector<ContactColumns>& chosen, int contacts) {
  for (int contact = 0; contact < contacts; ++contact) {
    const auto feeds = [contact](const ContactColumns& of) { return of.contact == contact; };
    if (std::ranges::any_of(chosen, feeds)) continue;
    std::cerr << "contact " << contact + 1
              << " of the scene has no column: it will seem open throughout\n";
  }
}

}  // namespace

int run_import(const ImportRun& run, int contacts, const CommonOptions& common,
               nlohmann::ordered_json& report) {
  check_output(run);
  const std::optional<Key> key = key_of(common);
  const std::string file = run.file.string();
  const std::string text = read_whole(run.file, largest_capture);
  ColumnFile columns = parse_columns(text, file, run.separator, run.names);
  refuse_row_of_units(run, columns, file);
  auto chosen = choose_columns(run.columns, columns, contacts, file);
  check_levels(run, chosen);
  warn_of_unfed(chosen, contacts);
  if (const auto column = alternating_column(columns, chosen)) {
    std::cerr << file << ": column '" << *column
              << "' alternates between 0 and 1: these are the times of both its edges, and each is "
                 "taken as an impact; --level distinguishes closings from openings\n";
  }
  for (const std::string& line : expand_levels(run.levels, file, columns, chosen)) {
    std::cerr << line << '\n';
  }
  const ChosenUnit unit = choose_unit(run.unit, columns, chosen, file);
  if (!unit.remark.empty()) std::cerr << unit.remark << '\n';
  ImportOptions options = run.import;
  options.unit = unit.seconds;
  const Import import = import_events(columns, chosen, options);
  print_problems(file, import.problems);
  print_falls(file, import);
  print_summary(import);
  fill(import, report);
  print_hints(import, report);
  if (import.events.empty()) throw std::runtime_error(file + ": no event is left");
  const bool from_another_start = import.of_clock || import.events.front().t > hardly_a_run;
  if (run.import.offset.mantissa == 0 && from_another_start)
    std::cerr << "the first event comes late; --offset gives the time of the file at t = 0\n";

  if (run.output.extension() == ".lcmlog") {
    const double end = std::isinf(run.import.duration) ? 0.0 : run.import.duration;
    report["messages"] = write_contact_log(run.output, import.events, contacts, end, key);
  } else {
    write_csv(run, import.events);
  }
  return exit_done;
}

}  // namespace sprag
