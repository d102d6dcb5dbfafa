#include "sprag/detail/study/quantities.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>

#include "sprag/detail/analysis/recurrence.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/master.h"

namespace sprag::study {
namespace {

struct OfEstimator {
  const char* name;
  bool Record::*recorded;
  double Figures::*value;
  bool of_replica;  // also defined for a replica
};
constexpr OfEstimator of_estimators[] = {
    {"V_floor", &Record::V_floor, &Figures::V_floor, true},
    {"V_max", &Record::V_max, &Figures::V_max, true},
    {"rate", &Record::rate, &Figures::rate, true},
    {"time_below", &Record::time_below, &Figures::time_below, true},
    {"nees", &Record::nees, &Figures::nees, false},
    {"beyond_3_sigma", &Record::beyond_3_sigma, &Figures::beyond_3_sigma, false},
    {"trusted", &Record::trusted, &Figures::trusted, false},
    {"worse", &Record::worse, &Figures::worse, false}};

// Calls visit(quantity) for the quantities recorded of this estimator.
template <typename Visit>
void for_each_of(EstimatorKind kind, const Record& record, const Visit& visit) {
  for (const OfEstimator& quantity : of_estimators) {
    if (!(record.*quantity.recorded)) continue;
    if (!quantity.of_replica && kind == EstimatorKind::replica) continue;
    visit(quantity);
  }
}

std::vector<std::string> recorded_columns(const Study& study) {
  std::vector<std::string> names;
  for (const EstimatorKind kind : study.estimators) {
    for_each_of(kind, study.record, [&](const OfEstimator& quantity) {
      names.push_back(std::string(name(kind)) + "." + quantity.name);
    });
  }
  const Record& record = study.record;
  const auto& coordinates = study.stroboscope.coordinate_names;
  if (record.impacts) names.emplace_back("impacts");
  if (record.impacts_per_period) names.emplace_back("impacts_per_period");
  if (record.lyapunov) names.emplace_back("lyapunov");
  if (record.attractor) {
    names.emplace_back("attractor.period");
    for (const std::string& coordinate : coordinates) names.push_back("attractor." + coordinate);
  }
  if (record.poincare) names.insert(names.end(), coordinates.begin(), coordinates.end());
  return names;
}

std::int64_t closings(const std::vector<ContactEvent>& events) {
  return std::count_if(events.begin(), events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::opens;
  });
}

// Makes a text a field of a CSV file without quotes.
std::string one_field(std::string text) {
  for (char& c : text) {
    if (c == ',') c = ';';
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return text.empty() ? "failed" : text;
}

// Runs act(). Exceptions except Interrupted become the failure of the run.
template <typename Run, typename Act>
void note_failure(Run& run, const Act& act) {
  try {
    act();
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    run.failure = one_field(error.what());
  }
}

}  // namespace

std::vector<std::string> columns(const Study& study) {
  std::vector<std::string> names = {"index", "point", "run"};
  for (const Axis& axis : study.axes) names.push_back(axis.path);
  if (study.record.poincare) names.emplace_back("n");
  const std::vector<std::string> recorded = recorded_columns(study);
  names.insert(names.end(), recorded.begin(), recorded.end());
  names.emplace_back("failure");
  return names;
}

int rows_of_run(const Study& study) {
  return study.record.poincare ? study.stroboscope.periods : 1;
}

// Results of a run before its rows are written.
struct Measurement::Run {
  std::int64_t index = 0;
  std::vector<double> values;  // of the axes
  std::string failure;         // empty: none
  Setting setting;
  Truth truth;
  std::vector<ContactEvent> arrived;
  std::vector<Figures> figures;  // one for each of the study's estimators
  double impacts = 0.0;
  std::optional<Recurrence> found;
};

Measurement::Measurement(const Study& study)
    : study_(study), recorded_(recorded_columns(study).size()) {}

const Setting& Measurement::setting_at(const std::vector<double>& values) {
  if (!setting_ || values != values_) {
    setting_ = nullptr;
    flows_ = nullptr;
    setting_ = std::make_unique<const Setting>(setting_of(study_, values));
    values_ = values;
  }
  return *setting_;
}

// Computes everything of a run except the observers.
void Measurement::begin(Run& run) {
  const Record& record = study_.record;
  run.values = values_at(study_, run.index);
  if (recorded_ == 0) return;
  run.setting = setting_at(run.values);
  Setting& setting = run.setting;
  const std::uint64_t stream = stream_of(study_, run.index);
  draw_starts(study_, stream, setting);
  if (record.of_estimators()) {
    run.truth = run_machine(setting.machine, setting.duration, setting.tick, study_.samples);
    run.arrived = disturb(run.truth.events, setting.disturbance,
                          static_cast<int>(setting.machine.model.contacts.size()), setting.duration,
                          study_.seed, stream);
  } else if (record.impacts) {
    Master(setting.machine.model, setting.machine.truth.start)
        .advance(at(setting.duration), run.truth.events);
  }
  run.impacts = static_cast<double>(closings(run.truth.events));
  if (!record.of_recurrence()) return;
  const Stroboscope& stroboscope = study_.stroboscope;
  if (!flows_) flows_ = std::make_unique<const Flows>(setting.machine.model);
  run.found = recurrence(*flows_, setting.machine.truth.start,
                         {.period = stroboscope.period,
                          .transient = stroboscope.transient,
                          .periods = stroboscope.periods,
                          .longest = stroboscope.longest,
                          .lyapunov = record.lyapunov});
}

void Measurement::follow_all(Run& run) const {
  if (!study_.record.of_estimators()) return;
  for (const EstimatorKind kind : study_.estimators) {
    run.figures.push_back(
        follow(kind, run.setting.observer, run.arrived, run.truth, study_.threshold));
  }
  if (study_.record.worse) add_worse(study_.estimators, run.figures);
}

// The recorded values: one row, or one for each n.
std::vector<std::vector<double>> Measurement::recorded(const Run& run) const {
  if (!run.failure.empty()) {
    return {std::vector<double>(recorded_, std::numeric_limits<double>::quiet_NaN())};
  }
  const Record& record = study_.record;
  std::vector<double> row;
  for (std::size_t e = 0; e < run.figures.size(); ++e) {
    for_each_of(study_.estimators[e], record, [&](const OfEstimator& quantity) {
      row.push_back(run.figures[e].*quantity.value);
    });
  }
  if (record.impacts) row.push_back(run.impacts);
  if (!run.found) return {row};
  const Recurrence& found = *run.found;
  const Stroboscope& stroboscope = study_.stroboscope;
  if (record.impacts_per_period) row.push_back(found.impacts_per_period);
  if (record.lyapunov) row.push_back(found.lyapunov);
  if (record.attractor) {
    row.push_back(found.attractor_period);
    for (const int i : stroboscope.coordinates) row.push_back(found.attractor[i]);
  }
  if (!record.poincare) return {row};
  std::vector<std::vector<double>> rows;
  for (Eigen::Index n = 0; n < found.points.rows(); ++n) {
    rows.push_back(row);
    for (const int i : stroboscope.coordinates) rows.back().push_back(found.points(n, i));
  }
  return rows;
}

void Measurement::append(const Run& run, std::vector<Row>& rows) const {
  std::int64_t n = run.failure.empty() ? 1 : 0;
  for (std::vector<double>& row : recorded(run)) {
    rows.push_back({run.index, run.values, n++, std::move(row), run.failure});
  }
}

bool Measurement::append_rows(std::int64_t index, std::vector<Row>& rows) {
  Run run;
  run.index = index;
  note_failure(run, [&] {
    begin(run);
    follow_all(run);
  });
  append(run, rows);
  return run.failure.empty();
}

bool Measurement::append_rows(std::int64_t index, std::string& text) {
  std::vector<Row> rows;
  const bool good = append_rows(index, rows);
  for (const Row& row : rows) append_line(study_, row, text);
  return good;
}

void append_line(const Study& study, const Row& row, std::string& text) {
  append_number(text, row.index);
  const auto append_whole = [&](std::int64_t number) {
    text += ',';
    append_number(text, number);
  };
  const auto append_value = [&](double value) {
    text += ',';
    if (std::isnan(value)) {
      text += "nan";  // without a sign
    } else {
      append_number(text, value);
    }
  };
  append_whole(point_of(study, row.index));
  append_whole(run_of(study, row.index));
  for (const double value : row.axes) append_value(value);
  if (study.record.poincare) append_whole(row.n);
  for (const double value : row.recorded) append_value(value);
  text += ',';
  text += row.failure;
  text += '\n';
}

}  // namespace sprag::study
