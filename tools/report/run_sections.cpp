#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/plot/figure.h"
#include "tools/report/analysis.h"
#include "tools/report/pictures.h"
#include "tools/report/sections.h"

namespace sprag::report {
namespace {

using plot::TableKind;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t most_gaps = 6;

std::string plural(std::size_t n, const std::string& what) {
  return std::to_string(n) + ' ' + what + (n == 1 ? "" : "s");
}

double last_of(const plot::Table& table, const std::string& name) {
  const auto* column = table.column(name);
  return column == nullptr || column->empty() ? unknown : column->back();
}

std::string numbered(const char* name, std::size_t from_zero) {
  return std::string(name).append(std::to_string(from_zero + 1));
}

// Largest standard deviation of a gap at the end; infinite if one is, NaN if there is none.
double last_sigma(const plot::Table& states, std::size_t contacts) {
  double most = unknown;
  for (std::size_t i = 0; i < contacts; ++i) {
    const double sigma = last_of(states, numbered("sigma_g", i));
    if (!std::isnan(sigma)) most = std::isnan(most) ? sigma : std::max(most, sigma);
  }
  return most;
}

// The panels `show` over time; empty if the files have none of them.
std::optional<plot::Figure> figure_of(const Inputs& inputs, std::vector<std::string> show,
                                      Shown shown, std::vector<std::string>& left_out) {
  plot::FigureOptions options;
  options.show = std::move(show);
  options.from = shown.from;
  options.to = shown.to;
  if (inputs.tables.empty()) return std::nullopt;
  plot::Figure figure = plot::make_figure(inputs.tables, &inputs.scene, options, left_out);
  figure.title.clear();
  return figure;
}

bool is_gap(const std::string& name) {
  return name.size() > 1 && name[0] == 'g' &&
         name.find_first_not_of("0123456789", 1) == std::string::npos;
}

bool is_summary(const std::string& name) { return name == "V" || name == "impulse"; }

// What the states or the report of a run say about its last closing that failed.
struct Failures {
  std::optional<std::size_t> count;
  std::optional<std::size_t> closings;
};

Failures failures_of(const ObserverRun& run, const Inputs& inputs) {
  Failures result;
  if (run.figures != nullptr) {
    if (const auto count = number_at(*run.figures, "/confidence/inconsistencies")) {
      result.count = static_cast<std::size_t>(std::max(*count, 0.0));
    }
  }
  if (!result.count && run.states != nullptr) {
    if (const double count = last_of(*run.states, "inconsistencies"); count >= 0.0) {
      result.count = static_cast<std::size_t>(count);
    }
  }
  const plot::Table* events = inputs.first(TableKind::events);
  if (events == nullptr) events = inputs.first(TableKind::impacts);
  if (events != nullptr) {
    const std::vector<ReportedEvent> all = reported_events(*events);
    result.closings = static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(),
                      [](const ReportedEvent& event) { return event.kind != plot::opens_kind; }));
  }
  return result;
}

std::string first_failure(const ObserverRun& run) {
  if (run.figures == nullptr) return "";
  const Json list = list_at(*run.figures, "/confidence/first_inconsistencies");
  if (list.empty()) return "";
  return ", first at t = " + rounded(number_at(list[0], "/t").value_or(unknown), 6) +
         " s, contact " + count_at(list[0], "/contact") +
         " (suspected: " + text_at(list[0], "/suspicion") + ")";
}

std::string bound_text(const ObserverRun& run) {
  double bound = run.states != nullptr ? last_of(*run.states, "B") : unknown;
  if (std::isnan(bound) && run.figures != nullptr) {
    bound = number_at(*run.figures, "/confidence/bound/final").value_or(unknown);
  }
  return std::isfinite(bound)
             ? "the error energy of the replica is at most B = " + rounded(bound, 3) +
                   " J, if the scene and its tolerances are right"
             : "no bound on the error energy is given";
}

// What is known at the end.
std::string end_of(const ObserverRun& run, const Inputs& inputs) {
  if (run.states == nullptr || run.states->columns.front().empty()) {
    const double settled = run.figures == nullptr
                               ? unknown
                               : number_at(*run.figures, "/settled_tick").value_or(unknown);
    return "At the last settled tick, " + rounded(settled, 9) + ", " + bound_text(run) + ".";
  }
  const plot::Table& states = *run.states;
  const std::string at_end = "At the end, t = " + rounded(last_of(states, "t"), 6) + " s, ";
  const double sigma = last_sigma(states, inputs.scene.model.contacts.size());
  const auto* from_filter = states.column("from_filter");
  if (from_filter != nullptr && !(from_filter->back() > 0.5)) {
    return at_end + "the estimate is the replica's, for which no standard deviation is claimed; " +
           bound_text(run) + ".";
  }
  if (std::isnan(sigma)) return at_end + bound_text(run) + ".";
  if (!std::isfinite(sigma)) return at_end + "no standard deviation is claimed.";
  return at_end + "the filter gives a standard deviation of " + rounded(sigma, 2) +
         " m for the gap" + (inputs.scene.model.contacts.size() > 1 ? "s at most" : "") + ", and " +
         bound_text(run) + ".";
}

}  // namespace

Verdict verdict_of_run(const ObserverRun& run, const Inputs& inputs) {
  Verdict verdict{.about = "Observer, run " + run.label, .first = {}, .second = {}};
  const Failures failures = failures_of(run, inputs);
  const std::string closings =
      failures.closings ? plural(*failures.closings, "closing") : std::string();
  if (!failures.count) {
    verdict.first =
        "Whether the events fit the filter is not determined: the run has no filter, or its report "
        "is not among the files.";
  } else if (*failures.count == 0) {
    verdict.first = (closings.empty() ? "No event" : "None of the " + closings) +
                    " contradicts the filter's estimate.";
    verdict.tone = Tone::good;
  } else {
    verdict.first = "The filter's gate failed " + plural(*failures.count, "time") +
                    (closings.empty() ? "" : " in " + closings) + first_failure(run) + ".";
    verdict.tone = Tone::bad;
  }
  verdict.second = end_of(run, inputs);
  return verdict;
}

std::optional<Section> motion_section(const Inputs& inputs, Shown shown) {
  if (!inputs.has(TableKind::states)) return std::nullopt;
  Section section{"Motion", {}};
  std::vector<std::string> gaps, left_out;
  const std::size_t contacts = inputs.scene.model.contacts.size();
  for (std::size_t i = 0; i < std::min(contacts, most_gaps); ++i) gaps.push_back(numbered("g", i));
  std::optional<plot::Figure> all = figure_of(inputs, {}, shown, left_out);
  if (contacts > 0) {
    std::vector<std::string> none;
    std::optional<plot::Figure> figure = figure_of(inputs, gaps, shown, none);
    // An output may have the name of a gap; its panel is shown below.
    std::erase_if(figure->panels,
                  [](const plot::Panel& panel) { return !panel.y_label.starts_with("gap "); });
    const auto contacts_panel =
        std::find_if(all->panels.begin(), all->panels.end(),
                     [](const plot::Panel& panel) { return panel.name == "contacts"; });
    if (contacts_panel != all->panels.end()) figure->panels.push_back(*contacts_panel);
    std::string caption = "Gap at each contact with bands of ± 2 sigma, and reported contacts.";
    if (contacts > most_gaps) {
      caption += " Contacts " + std::to_string(most_gaps + 1) + " to " + std::to_string(contacts) +
                 " are not shown.";
    }
    section.blocks.emplace_back(picture_of(*figure, caption));
  }
  std::erase_if(all->panels, [&](const plot::Panel& panel) {
    return panel.name == "contacts" || is_summary(panel.name) ||
           (contacts > 0 && panel.y_label.starts_with("gap "));
  });
  if (!all->panels.empty()) {
    std::string caption = contacts > 0 ? "Outputs and estimated parameters." : "Coordinates.";
    std::erase_if(left_out, is_gap);
    for (std::size_t i = 0; i < left_out.size(); ++i) {
      caption += (i == 0 ? " Not shown: " : ", ") + left_out[i];
    }
    section.blocks.emplace_back(picture_of(*all, caption));
  }
  return section;
}

namespace {

void add_innovations(const plot::Table& states, double jitter, Section& section) {
  const Residuals all = innovations(states);
  const Residuals unit = normalized(all);
  if (unit.size() == 0) return;
  section.blocks.emplace_back(residual_picture(
      unit, "innovation / sigma", "",
      "Innovations of " + states.label +
          ": the gap that the filter predicts at each closing, divided by its standard deviation. "
          "The states have one closing for each tick."));
  if (!(jitter > 0.0)) {
    section.blocks.emplace_back(
        Paragraph{"The scene has no jitter: event times count as exact, and innovations after the "
                  "first impacts are rounding errors. Whether sigma is right is not tested."});
  } else if (const auto test = consistency(unit)) {
    section.blocks.emplace_back(Paragraph{
        rounded(100.0 * test->within_two, 3) + " % of the " + std::to_string(test->n) +
        " innovations are within 2 sigma. Their mean square is " + rounded(test->mean_square, 3) +
        "; if sigma is right it lies between " + rounded(test->low, 3) + " and " +
        rounded(test->high, 3) + " in 95 % of all runs. " +
        (test->holds() ? "Sigma passes this test."
         : test->mean_square > test->high
             ? "Sigma fails this test: the estimate is less certain than it claims."
             : "Sigma fails this test: the estimate is more certain than it claims.")});
  } else {
    section.blocks.emplace_back(Paragraph{"Whether sigma is right is not determined: that takes " +
                                          std::to_string(fewest_residuals) +
                                          " innovations or more."});
  }
}

void add_predictions(const Inputs& inputs, Section& section) {
  const plot::Table* source = inputs.first(TableKind::events);
  if (source == nullptr) source = inputs.first(TableKind::impacts);
  for (const plot::Table& table : inputs.predictions) {
    if (source == nullptr) {
      section.blocks.emplace_back(Paragraph{
          "Predictions are given without measured events: an events CSV or an impacts CSV."});
      return;
    }
    const PredictionCheck check =
        check_predictions(table, reported_events(*source), inputs.scene.prior.jitter);
    const std::size_t claimed = check.errors.size() + check.others;
    std::string text = "Of " + plural(claimed + check.none + check.open_end, "prediction") + " " +
                       std::to_string(check.none) + " claim no event. Of the " +
                       std::to_string(claimed) + " whose next event was measured, " +
                       std::to_string(check.errors.size()) + " have the right contact.";
    if (check.errors.size() > 0) {
      section.blocks.emplace_back(
          residual_picture(check.errors, "measured - predicted time", "s",
                           "Next event after each prediction: measured minus predicted time, with "
                           "bars of ± 2 sigma."));
      if (const auto test = consistency(normalized(check.errors))) {
        text += " " + rounded(100.0 * test->within_two, 3) +
                " % of the measured times are within 2 sigma of the predicted ones.";
      }
    }
    section.blocks.emplace_back(Paragraph{text});
  }
}

}  // namespace

std::optional<Section> residuals_section(const Inputs& inputs) {
  Section section{"Predicted and measured events", {}};
  for (const ObserverRun& run : inputs.runs()) {
    if (run.states != nullptr) add_innovations(*run.states, inputs.scene.prior.jitter, section);
  }
  add_predictions(inputs, section);
  if (section.blocks.empty()) return std::nullopt;
  return section;
}

namespace {

// Median of finite values; NaN if there is none.
double median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return unknown;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

TextTable impacts_by_contact(const plot::Table& impacts) {
  TextTable table{"Impacts of " + impacts.label + ", by contact",
                  {"contact", "impacts", "median speed [m/s]", "largest speed [m/s]", "at t [s]",
                   "its sigma [m/s]", "largest impulse [N s]"},
                  {}};
  const auto& t = *impacts.column("t");
  const auto& contact = *impacts.column("contact");
  const auto* kind = impacts.column("kind");
  const auto* before = impacts.column("velocity_before");
  const auto* sigma = impacts.column("sigma_velocity_before");
  const auto* impulse = impacts.column("impulse");
  if (before == nullptr || sigma == nullptr || impulse == nullptr) return table;
  const int most =
      contact.empty() ? 0 : static_cast<int>(*std::max_element(contact.begin(), contact.end()));
  for (int i = 1; i <= most; ++i) {
    std::vector<double> speeds;
    double fastest = -1.0, fastest_t = unknown, fastest_sigma = unknown, largest = unknown;
    for (std::size_t k = 0; k < t.size(); ++k) {
      if (contact[k] != i || (*kind)[k] == plot::opens_kind || !std::isfinite((*before)[k]))
        continue;
      const double speed = std::abs((*before)[k]);
      speeds.push_back(speed);
      if (speed > fastest) {
        fastest = speed;
        fastest_t = t[k];
        fastest_sigma = (*sigma)[k];
      }
      if (!(largest >= (*impulse)[k])) largest = (*impulse)[k];
    }
    if (speeds.empty()) continue;
    table.rows.push_back({std::to_string(i), std::to_string(speeds.size()),
                          rounded(median(speeds), 4), rounded(fastest, 4), rounded(fastest_t, 6),
                          std::isfinite(fastest_sigma) ? rounded(fastest_sigma, 2) : "none claimed",
                          rounded(largest, 4)});
  }
  return table;
}

}  // namespace

std::optional<Section> impacts_section(const Inputs& inputs, Shown shown) {
  if (!inputs.has(TableKind::impacts)) return std::nullopt;
  Section section{"Impact velocities", {}};
  std::vector<std::string> none;
  try {
    if (const auto figure = figure_of(inputs, {"velocity_before", "velocity_after"}, shown, none)) {
      section.blocks.emplace_back(
          picture_of(*figure,
                     "Gap velocity before and after each event, with bars of ± 2 sigma. "
                     "An infinite sigma has no bar."));
    }
  } catch (const std::invalid_argument&) {
    section.blocks.emplace_back(Paragraph{"The impacts files have no event with a velocity."});
  }
  for (const plot::Table& table : inputs.tables) {
    if (table.kind != TableKind::impacts) continue;
    TextTable by_contact = impacts_by_contact(table);
    if (!by_contact.rows.empty()) section.blocks.emplace_back(std::move(by_contact));
  }
  return section;
}

std::optional<Section> certainty_section(const Inputs& inputs, Shown shown) {
  Section section{"Error energy V and bound B", {}};
  TextTable table{
      "First and last value", {"quantity", "run", "first", "at t [s]", "last", "at t [s]"}, {}};
  bool drawn = false;
  const auto add = [&](const plot::Table& of, const char* name) {
    const auto* y = of.column(name);
    if (y == nullptr || y->empty()) return;
    const auto& t = *of.column("t");
    const auto text = [](double value) {
      return std::isfinite(value) ? rounded(value, 4) : std::string("infinite");
    };
    table.rows.push_back({std::string(name) + " [J]", of.label, text(y->front()),
                          rounded(t.front(), 6), text(y->back()), rounded(t.back(), 6)});
    drawn = drawn ||
            std::any_of(y->begin(), y->end(), [](double v) { return std::isfinite(v) && v > 0.0; });
  };
  for (const plot::Table& of : inputs.tables) {
    if (of.kind == TableKind::energy) add(of, "V");
    if (of.kind == TableKind::states) add(of, "B");
  }
  if (table.rows.empty()) return std::nullopt;
  std::vector<std::string> none;
  if (drawn) {
    if (const auto figure = figure_of(inputs, {"V"}, shown, none)) {
      section.blocks.emplace_back(picture_of(
          *figure, "V compares the estimate with a simulated machine. B bounds V of the replica."));
    }
  }
  if (!drawn || !inputs.has(TableKind::energy)) {
    section.blocks.emplace_back(Paragraph{
        inputs.has(TableKind::energy)
            ? "No value of V or B is finite and positive, so there is no picture."
            : "V is not determined: the true state is not among the files. It is known of a "
              "simulated machine only."});
  }
  section.blocks.emplace_back(std::move(table));
  return section;
}

std::optional<Section> inconsistencies_section(const Inputs& inputs) {
  Section section{"Inconsistencies", {}};
  for (const ObserverRun& run : inputs.runs()) {
    if (run.figures == nullptr) continue;
    const Json list = list_at(*run.figures, "/confidence/first_inconsistencies");
    const double count = number_at(*run.figures, "/confidence/inconsistencies").value_or(unknown);
    if (std::isnan(count)) continue;
    if (list.empty()) {
      section.blocks.emplace_back(Paragraph{"Run " + run.label + ": none."});
      continue;
    }
    TextTable table{"Events of the run " + run.label + " that failed the filter's gate",
                    {"t [s]", "contact", "suspected", "innovation² / variance", "records lost"},
                    {}};
    for (const Json& one : list) {
      if (table.rows.size() >= most_rows) break;
      const auto square = number_at(one, "/square_over_variance");
      table.rows.push_back({rounded(number_at(one, "/t").value_or(unknown), 8),
                            count_at(one, "/contact"), text_at(one, "/suspicion"),
                            square ? rounded(*square, 3) : "",
                            is_true_at(one, "/known_loss") ? "yes" : "no"});
    }
    const auto shown = static_cast<double>(table.rows.size());
    section.blocks.emplace_back(std::move(table));
    if (count > shown) {
      section.blocks.emplace_back(
          Paragraph{"The first " + rounded(shown, 9) + " of " + rounded(count, 9) + "."});
    }
    if (const auto refutations = number_at(*run.figures, "/confidence/refutations")) {
      section.blocks.emplace_back(Paragraph{"The bound has refuted the filter's estimate " +
                                            rounded(*refutations, 9) + " times."});
    }
  }
  for (const ObserverRun& run : inputs.runs()) {
    if (run.figures == nullptr) continue;
    const Json degraded = list_at(*run.figures, "/degraded");
    TextTable table{"Intervals of the run " + run.label + " in which events may be missing",
                    {"from [s]", "to [s]"},
                    {}};
    for (const Json& one : degraded) {
      if (table.rows.size() >= most_rows) break;
      table.rows.push_back({rounded(number_at(one, "/from").value_or(unknown), 8),
                            rounded(number_at(one, "/to").value_or(infinity), 8)});
    }
    if (!table.rows.empty()) section.blocks.emplace_back(std::move(table));
  }
  if (section.blocks.empty()) return std::nullopt;
  return section;
}

}  // namespace sprag::report
