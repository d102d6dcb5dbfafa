#include "tools/plot/study_figure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "sprag/detail/analysis/attractors.h"
#include "sprag/detail/analysis/quantile.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "tools/plot/script_text.h"

namespace sprag::plot {
namespace {

// Prefixes of the study's columns.
const std::vector<std::string> estimators{"replica", "timing", "both", "adaptive"};

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// Whether values differ by a constant factor and span more than a decade.
bool spaced_by_factors(const std::vector<double>& values) {
  if (values.size() < 3 || !(values.front() > 0.0)) return false;
  if (!(values.back() > 10.0 * values.front())) return false;
  const double step = std::log(values[1] / values[0]);
  for (std::size_t i = 2; i < values.size(); ++i) {
    if (std::abs(std::log(values[i] / values[i - 1]) - step) > 0.01 * step) return false;
  }
  return true;
}

// Whether values are positive and span more than two decades; these are shown by logarithms.
bool wide(const std::vector<double>& values) {
  double least = std::numeric_limits<double>::infinity(), greatest = 0.0;
  for (const double value : values) {
    if (value <= 0.0) return false;
    if (!std::isfinite(value)) continue;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  return greatest > 100.0 * least;
}

class Maker {
 public:
  Maker(const StudyTable& table, const StudyOptions& options) : table_(table), options_(options) {
    choose_rows();
    choose_axes();
  }

  StudyFigure figure() {
    StudyFigure figure;
    figure.title = options_.title.empty() ? table_.name : options_.title;
    for (const std::string& quantity : quantities()) {
      if (axes_.size() == 1) {
        add_panel(quantity, figure);
      } else {
        add_maps(quantity, figure);
      }
    }
    if (figure.panels.empty()) throw InputError("there is nothing to show in this study");
    figure.axes = axes_;
    return figure;
  }

 private:
  const std::vector<double>& key(const std::string& name) const {
    const std::vector<double>* column = table_.column(name);
    if (column == nullptr) {
      throw std::invalid_argument(name + " is no column of the study; there are " +
                                  listed(table_.names));
    }
    return *column;
  }

  void choose_rows() {
    rows_.resize(table_.rows());
    for (std::size_t i = 0; i < rows_.size(); ++i) rows_[i] = i;
    for (const std::string& where : options_.where) {
      const std::size_t equals = where.find('=');
      const auto value =
          equals == std::string::npos ? std::nullopt : parse_double(where.substr(equals + 1));
      if (!value) throw std::invalid_argument(where + " is not allowed; must be KEY=VALUE");
      const std::vector<double>& of = key(where.substr(0, equals));
      double nearest = std::numeric_limits<double>::infinity();
      for (const std::size_t i : rows_) {
        if (std::abs(of[i] - *value) < std::abs(nearest - *value)) nearest = of[i];
      }
      std::erase_if(rows_, [&](std::size_t i) { return of[i] != nearest; });
    }
  }

  void choose_axes() {
    std::vector<std::string> names = options_.over.empty() ? table_.axes : options_.over;
    // A key that --where fixes does not vary.
    if (options_.over.empty()) {
      std::erase_if(names, [&](const std::string& name) { return values_of(name).size() < 2; });
    }
    if (names.empty() && options_.over.empty()) {
      throw std::invalid_argument(
          "without its manifest the varied keys of the study are unknown; give --over KEY");
    }
    if (names.empty() || names.size() > 2) {
      throw std::invalid_argument("the study varies " + listed(names) +
                                  "; --over chooses one or two of them, --where KEY=VALUE one "
                                  "value of the others");
    }
    for (const std::string& name : names) {
      std::vector<double> values = values_of(name);
      if (values.empty()) throw InputError(name + " has no values");
      axes_.push_back({name, spaced_by_factors(values), std::move(values)});
    }
  }

  std::vector<double> values_of(const std::string& name) const {
    const std::vector<double>& column = key(name);
    std::set<double> values;
    for (const std::size_t i : rows_) {
      if (std::isfinite(column[i])) values.insert(column[i]);
    }
    return {values.begin(), values.end()};
  }

  // The recorded quantities: columns other than axes and numbering.
  std::vector<std::string> recorded() const {
    std::vector<std::string> names;
    const std::set<std::string> axes(table_.axes.begin(), table_.axes.end());
    const std::set<std::string> others{"index", "point", "run", "n", "failure"};
    for (const std::string& name : table_.names) {
      if (!axes.contains(name) && !others.contains(name)) names.push_back(name);
    }
    return names;
  }

  // The estimator of a column by its prefix; empty if there is none.
  static std::string estimator_of(const std::string& name) {
    for (const std::string& estimator : estimators) {
      if (name.starts_with(estimator + ".")) return estimator;
    }
    return {};
  }
  static std::string without_estimator(const std::string& name) {
    const std::string estimator = estimator_of(name);
    return estimator.empty() ? name : name.substr(estimator.size() + 1);
  }

  // The quantities to show, without the prefixes of estimators.
  std::vector<std::string> quantities() const {
    std::vector<std::string> all;
    const auto add = [&all](const std::string& name) {
      if (std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
    };
    for (const std::string& name : recorded()) {
      const bool of_attractor = name.starts_with("attractor.");
      add(of_attractor ? "attractor" : without_estimator(name));
    }
    std::erase_if(all, [this](const std::string& name) { return axis(name); });
    if (options_.show.empty()) {
      const auto has = [&all](const char* name) {
        return std::find(all.begin(), all.end(), name) != all.end();
      };
      if (axes_.size() == 2) {
        if (has("attractor")) return {"attractor"};
        return {all.begin(), all.begin() + (all.empty() ? 0 : 1)};
      }
      std::erase(all, "attractor");
      const auto point = std::find_if(all.begin(), all.end(), [this](const std::string& name) {
        return of_the_stroboscope(name);
      });
      if (point != all.end()) {
        std::vector<std::string> shown{*point};
        if (has("lyapunov")) shown.emplace_back("lyapunov");
        return shown;
      }
      return {all.begin(), all.begin() + std::min<long>(2, std::ssize(all))};
    }
    for (const std::string& name : options_.show) {
      const bool there = std::find(all.begin(), all.end(), name) != all.end() ||
                         (table_.column(name) != nullptr && name != "failure");
      if (!there) {
        throw std::invalid_argument(name + " is nothing that the study has recorded; there are " +
                                    listed(all));
      }
    }
    return options_.show;
  }

  bool axis(const std::string& name) const {
    return std::any_of(axes_.begin(), axes_.end(),
                       [&](const Axis& axis) { return axis.name == name; });
  }

  // The columns of a quantity: one, or one per estimator.
  std::vector<std::string> columns_of(const std::string& quantity) const {
    if (table_.column(quantity) != nullptr) return {quantity};
    std::vector<std::string> names;
    for (const std::string& estimator : estimators) {
      if (table_.column(estimator + "." + quantity) != nullptr) {
        names.push_back(estimator + "." + quantity);
      }
    }
    return names;
  }

  bool of_the_stroboscope(const std::string& name) const {
    return table_.column("n") != nullptr && name.size() > 1 && (name[0] == 'q' || name[0] == 'u') &&
           name.find_first_not_of("0123456789", 1) == std::string::npos;
  }

  // Points of the stroboscope repeat the other quantities of their run, which count once.
  bool first_of_run(std::size_t row) const {
    const std::vector<double>* n = table_.column("n");
    return n == nullptr || (*n)[row] <= 1.0;
  }

  void add_panel(const std::string& quantity, StudyFigure& figure) const {
    StudyPanel panel;
    panel.name = quantity;
    const std::vector<double>& x = key(axes_.front().name);
    if (of_the_stroboscope(quantity)) {
      const std::vector<double>& y = key(quantity);
      for (const std::size_t i : rows_) {
        if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
        panel.x.push_back(x[i]);
        panel.y.push_back(y[i]);
      }
      if (!panel.x.empty()) figure.panels.push_back(std::move(panel));
      return;
    }
    panel.kind = StudyPanel::Kind::bands;
    const std::vector<std::string> names = quantity == "attractor"
                                               ? std::vector<std::string>{"attractor.period"}
                                               : columns_of(quantity);
    std::vector<double> all;
    for (const std::string& name : names) {
      const std::vector<double>& y = key(name);
      const std::string estimator = estimator_of(name);
      const Colour colour = colour_of(estimator);
      std::map<double, std::vector<double>> values;
      for (const std::size_t i : rows_) {
        if (std::isfinite(x[i]) && !std::isnan(y[i]) && first_of_run(i)) {
          values[x[i]].push_back(y[i]);
        }
      }
      Band band{"5 to 95 %" + (estimator.empty() ? "" : " of " + estimator), colour, {}, {}, {}};
      Curve curve{
          estimator.empty() ? "median" : "median of " + estimator, colour, Line::solid, {}, {}};
      bool several = false;
      for (const auto& [at, of_runs] : values) {
        several = several || of_runs.size() > 1;
        band.t.push_back(at);
        band.low.push_back(quantile(of_runs, 0.05));
        band.high.push_back(quantile(of_runs, 0.95));
        curve.t.push_back(at);
        curve.y.push_back(quantile(of_runs, 0.5));
        all.insert(all.end(), of_runs.begin(), of_runs.end());
      }
      if (!several) curve.title = estimator.empty() ? quantity : estimator;
      const bool shown = std::any_of(curve.y.begin(), curve.y.end(),
                                     [](double value) { return std::isfinite(value); });
      if (!shown) continue;
      if (several) panel.bands.push_back(std::move(band));
      panel.curves.push_back(std::move(curve));
    }
    panel.logarithmic = wide(all);
    if (!panel.curves.empty()) figure.panels.push_back(std::move(panel));
  }

  void add_maps(const std::string& quantity, StudyFigure& figure) const {
    if (quantity == "attractor") {
      add_labels(figure);
      return;
    }
    const std::size_t first = figure.panels.size();
    std::vector<double> all;
    for (const std::string& name : columns_of(quantity)) {
      const std::vector<double>& x = key(axes_[0].name);
      const std::vector<double>& y = key(axes_[1].name);
      const std::vector<double>& z = key(name);
      std::map<std::pair<double, double>, std::vector<double>> values;
      for (const std::size_t i : rows_) {
        if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || std::isnan(z[i])) continue;
        if (first_of_run(i) || of_the_stroboscope(name)) values[{x[i], y[i]}].push_back(z[i]);
      }
      StudyPanel panel;
      panel.kind = StudyPanel::Kind::map;
      panel.name = name;
      for (const auto& [at, of_runs] : values) {
        panel.x.push_back(at.first);
        panel.y.push_back(at.second);
        panel.z.push_back(quantile(of_runs, 0.5));
      }
      if (panel.x.empty()) continue;
      all.insert(all.end(), panel.z.begin(), panel.z.end());
      figure.panels.push_back(std::move(panel));
    }
    const bool logarithmic = wide(all);
    std::erase_if(all, [&](double z) { return !std::isfinite(z) || (logarithmic && !(z > 0.0)); });
    if (all.empty()) return;
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    for (std::size_t i = first; i < figure.panels.size(); ++i) {
      figure.panels[i].logarithmic = logarithmic;
      figure.panels[i].least = *least;
      figure.panels[i].most = *most;
    }
  }

  void add_labels(StudyFigure& figure) const {
    const std::vector<double>& x = key(axes_[0].name);
    const std::vector<double>& y = key(axes_[1].name);
    const std::vector<double>& period = key("attractor.period");
    const auto coordinates = [&](char q_or_u) {
      std::vector<const std::vector<double>*> columns;
      for (const std::string& name : table_.names) {
        if (name.starts_with(std::string("attractor.") + q_or_u)) {
          columns.push_back(table_.column(name));
        }
      }
      return columns;
    };
    const auto q = coordinates('q'), u = coordinates('u');
    StudyPanel panel;
    panel.kind = StudyPanel::Kind::labels;
    panel.name = "attractor";
    std::vector<int> periods;
    std::vector<std::size_t> shown;
    for (const std::size_t i : rows_) {
      if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || std::isnan(period[i])) continue;
      if (!first_of_run(i)) continue;
      shown.push_back(i);
      periods.push_back(static_cast<int>(period[i]));
      panel.x.push_back(x[i]);
      panel.y.push_back(y[i]);
    }
    const auto f = static_cast<Eigen::Index>(std::max(q.size(), u.size()));
    if (shown.empty() || f == 0) return;
    // A study may have recorded only some of the coordinates.
    Simulation::Rows points = Simulation::Rows::Zero(std::ssize(shown), 2 * f);
    for (std::size_t k = 0; k < shown.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      Eigen::Index j = 0;
      for (const auto* column : q) points(row, j++) = (*column)[shown[k]];
      j = f;
      for (const auto* column : u) points(row, j++) = (*column)[shown[k]];
    }
    const std::vector<int> labels = label_attractors(periods, points);
    panel.titles = {"none found"};
    for (std::size_t k = 0; k < labels.size(); ++k) {
      const auto label = static_cast<std::size_t>(labels[k]);
      panel.z.push_back(labels[k]);
      if (label == 0) continue;
      if (panel.titles.size() <= label) panel.titles.resize(label + 1);
      panel.titles[label] = std::to_string(label) + ": period " + std::to_string(periods[k]);
    }
    figure.panels.push_back(std::move(panel));
  }

  const StudyTable& table_;
  const StudyOptions& options_;
  std::vector<std::size_t> rows_;
  std::vector<Axis> axes_;
};

}  // namespace

StudyFigure make_study_figure(const StudyTable& table, const StudyOptions& options) {
  return Maker(table, options).figure();
}

}  // namespace sprag::plot
