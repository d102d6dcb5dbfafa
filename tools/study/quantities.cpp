#include "tools/study/quantities.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include "sprag/analysis/recurrence.h"
#include "sprag/files/csv.h"
#include "sprag/mechanics/interrupt.h"
#include "sprag/mechanics/master.h"
#include "tools/study/trial.h"

namespace sprag::study {
namespace {

struct OfEstimator {
  const char* name;
  bool Record::*recorded;
  double Figures::*value;
  bool of_replica;  // too
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

// visit(quantity) for those that are recorded of this estimator.
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

// A field of a CSV file without quotes.
std::string one_field(std::string text) {
  for (char& c : text) {
    if (c == ',') c = ';';
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return text.empty() ? "failed" : text;
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

void Measurement::append(const Setting& setting, std::uint64_t stream,
                         std::vector<double>& row) const {
  const Record& record = study_.record;
  if (!record.of_estimators() && !record.impacts) return;
  if (!record.of_estimators()) {
    Master master(setting.machine.model, setting.machine.master);
    std::vector<ContactEvent> events;
    master.advance(at(setting.duration), events);
    row.push_back(static_cast<double>(closings(events)));
    return;
  }
  const Truth truth = run_machine(setting.machine, setting.duration, setting.tick, study_.samples);
  const auto arrived = disturb(truth.events, setting.disturbance,
                               static_cast<int>(setting.machine.model.contacts.size()),
                               setting.duration, study_.seed, stream);
  std::vector<Figures> figures;
  for (const EstimatorKind kind : study_.estimators)
    figures.push_back(follow(kind, setting.told, arrived, truth, study_.threshold));
  if (record.worse) add_worse(study_.estimators, figures);
  for (std::size_t e = 0; e < figures.size(); ++e) {
    for_each_of(study_.estimators[e], record,
                [&](const OfEstimator& quantity) { row.push_back(figures[e].*quantity.value); });
  }
  if (record.impacts) row.push_back(static_cast<double>(closings(truth.events)));
}

void Measurement::measure(std::int64_t index, const std::vector<double>& values,
                          std::vector<std::vector<double>>& rows) {
  const Record& record = study_.record;
  std::vector<double> row;
  if (recorded_ == 0) {
    rows.push_back(row);
    return;
  }
  Setting setting = setting_at(values);
  const std::uint64_t stream = stream_of(study_, index);
  draw_starts(study_, stream, setting);
  append(setting, stream, row);
  if (!record.of_recurrence()) {
    rows.push_back(row);
    return;
  }
  const Stroboscope& stroboscope = study_.stroboscope;
  if (!flows_) flows_ = std::make_unique<const Flows>(setting.machine.model);
  const Recurrence found = recurrence(*flows_, setting.machine.master,
                                      {.period = stroboscope.period,
                                       .transient = stroboscope.transient,
                                       .periods = stroboscope.periods,
                                       .longest = stroboscope.longest,
                                       .lyapunov = record.lyapunov});
  if (record.impacts_per_period) row.push_back(found.impacts_per_period);
  if (record.lyapunov) row.push_back(found.lyapunov);
  if (record.attractor) {
    row.push_back(found.attractor_period);
    for (const int i : stroboscope.coordinates) row.push_back(found.attractor[i]);
  }
  if (!record.poincare) {
    rows.push_back(row);
    return;
  }
  for (Eigen::Index n = 0; n < found.points.rows(); ++n) {
    rows.push_back(row);
    for (const int i : stroboscope.coordinates) rows.back().push_back(found.points(n, i));
  }
}

bool Measurement::append_rows(std::int64_t index, std::string& text) {
  std::vector<double> values;
  std::vector<std::vector<double>> rows;
  std::string failure;
  try {
    values = values_at(study_, index);
    measure(index, values, rows);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    failure = one_field(error.what());
    rows.assign(1, std::vector<double>(recorded_, std::numeric_limits<double>::quiet_NaN()));
  }
  std::int64_t n = failure.empty() ? 1 : 0;
  for (const std::vector<double>& row : rows) {
    append_number(text, index);
    for (const std::int64_t number : {point_of(study_, index), run_of(study_, index)}) {
      text += ',';
      append_number(text, number);
    }
    const auto append_value = [&](double value) {
      text += ',';
      if (std::isnan(value)) {
        text += "nan";  // without a sign
      } else {
        append_number(text, value);
      }
    };
    for (const double value : values) append_value(value);
    if (study_.record.poincare) {
      text += ',';
      append_number(text, n++);
    }
    for (const double value : row) append_value(value);
    text += ',';
    text += failure;
    text += '\n';
  }
  return failure.empty();
}

}  // namespace sprag::study
