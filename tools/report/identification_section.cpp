#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/report/analysis.h"
#include "tools/report/pictures.h"
#include "tools/report/sections.h"

namespace sprag::report {
namespace {

std::string sentence(std::string clause) {
  if (clause.empty()) return clause;
  if (clause[0] >= 'a' && clause[0] <= 'z') clause[0] = static_cast<char>(clause[0] - 'a' + 'A');
  if (clause.back() != '.') clause += '.';
  return clause;
}

// "N m²" for "N m^2".
std::string unit_at(const Json& parameter) {
  std::string unit = text_at(parameter, "/unit");
  const std::string power = "^2";
  for (std::size_t at = unit.find(power); at != std::string::npos; at = unit.find(power, at)) {
    unit.replace(at, power.size(), "²");
  }
  return unit;
}

TextTable parameters_of(const Json& content) {
  TextTable table{"Parameters: value of the scene, fitted value, standard deviation, 95 % interval",
                  {"parameter", "scene", "fitted", "sigma", "95 % interval", "change"},
                  {}};
  for (const Json& of : list_at(content, "/parameters")) {
    const double nominal = number_at(of, "/nominal").value_or(unknown);
    const std::string unit = unit_at(of);
    std::vector<std::string> row{
        text_at(of, "/parameter") + (unit.empty() ? "" : " [" + unit + "]"), rounded(nominal, 6)};
    const auto value = number_at(of, "/value");
    if (!is_true_at(of, "/determined") || !value) {
      row.insert(row.end(), {"not determined", "", "", ""});
      table.rows.push_back(std::move(row));
      continue;
    }
    const auto sigma = number_at(of, "/sigma");
    const double low = number_at(of, "/low").value_or(unknown);
    const double high = number_at(of, "/high").value_or(unknown);
    const double width = sigma.value_or(high - low);
    row.push_back(rounded_to(*value, width));
    row.push_back(sigma ? rounded(*sigma, 2) : "at a physical bound");
    row.push_back("[" + rounded_to(low, width) + ", " + rounded_to(high, width) + "]");
    row.push_back(nominal != 0.0 ? rounded(100.0 * (*value - nominal) / std::abs(nominal), 3) + " %"
                                 : rounded(*value - nominal, 3));
    table.rows.push_back(std::move(row));
  }
  if (const std::string held = text_at(content, "/held"); !held.empty()) {
    table.rows.push_back({held, "", "held: it sets the scale", "", "", ""});
  }
  return table;
}

void add_intervals(const Json& content, Section& section) {
  std::vector<Interval> intervals;
  for (const Json& of : list_at(content, "/parameters")) {
    const auto value = number_at(of, "/value"), low = number_at(of, "/low"),
               high = number_at(of, "/high"), nominal = number_at(of, "/nominal"),
               least = number_at(of, "/range/0"), most = number_at(of, "/range/1");
    if (!is_true_at(of, "/determined") || !value || !low || !high || !nominal || !least || !most) {
      continue;
    }
    const auto in_range = [&](double x) {
      const double end = x < *nominal ? *nominal - *least : *most - *nominal;
      return (x - *nominal) / std::max(std::abs(end), std::numeric_limits<double>::min());
    };
    const double sigma = number_at(of, "/sigma").value_or(*high - *low);
    const std::string unit = unit_at(of);
    intervals.push_back({text_at(of, "/parameter"),
                         rounded_to(*value, sigma) + (unit.empty() ? "" : " " + unit),
                         in_range(*value), in_range(*low), in_range(*high)});
  }
  if (intervals.empty()) return;
  section.blocks.emplace_back(interval_picture(
      intervals,
      "Fitted values with 95 % intervals, against the scene's values and the ranges within which "
      "they were assumed."));
}

void add_correlations(const Json& content, Section& section) {
  const Json rows = list_at(content, "/correlations");
  const Json parameters = list_at(content, "/parameters");
  std::vector<std::size_t> determined;
  for (std::size_t i = 0; i < std::min(rows.size(), parameters.size()); ++i) {
    const bool has = rows[i].is_array() && rows[i].size() > i && rows[i][i].is_number();
    if (has) determined.push_back(i);
  }
  if (determined.size() < 2) return;
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;
  for (const std::size_t i : determined) {
    names.push_back(text_at(parameters[i], "/parameter"));
    values.emplace_back();
    for (const std::size_t k : determined) {
      const bool has = rows[i].size() > k && rows[i][k].is_number();
      values.back().push_back(has ? rows[i][k].get<double>() : unknown);
    }
  }
  section.blocks.emplace_back(correlation_picture(
      names, values,
      "Correlations of the determined parameters. Near ±1 only a combination of the two is known "
      "well."));
}

// Residuals of a report of identify; empty in one of an older version.
Residuals residuals_of(const Json& content) {
  Residuals result;
  const Json t = list_at(content, "/residuals/t"), contact = list_at(content, "/residuals/contact"),
             residual = list_at(content, "/residuals/residual"),
             sigma = list_at(content, "/residuals/sigma");
  const std::size_t n = std::min({t.size(), contact.size(), residual.size(), sigma.size()});
  for (std::size_t k = 0; k < n; ++k) {
    if (!t[k].is_number() || !contact[k].is_number_unsigned() || !residual[k].is_number()) continue;
    const auto number = contact[k].get<std::uint64_t>();
    if (number < 1 || number > 60) continue;
    result.t.push_back(t[k].get<double>());
    result.contact.push_back(static_cast<int>(number));
    result.value.push_back(residual[k].get<double>());
    result.sigma.push_back(sigma[k].is_number() ? sigma[k].get<double>() : unknown);
  }
  return result;
}

void add_residuals(const Json& content, Section& section) {
  const Residuals residuals = residuals_of(content);
  if (residuals.size() == 0) return;
  section.blocks.emplace_back(
      residual_picture(residuals, "measured - fitted time", "s",
                       "Residuals of the event times, with bars of ± 2 sigma of the jitter. Events "
                       "that the fit leaves out are not among them."));
  const Residuals unit = normalized(residuals);
  if (const auto test = consistency(unit)) {
    section.blocks.emplace_back(Paragraph{
        rounded(100.0 * test->within_two, 3) + " % of the " + std::to_string(test->n) +
        " residuals are within 2 sigma. " +
        (is_true_at(content, "/jitter_told")
             ? "The jitter was given. The mean square of residual over sigma is " +
                   rounded(test->mean_square, 3) + ", expected within " + rounded(test->low, 3) +
                   " to " + rounded(test->high, 3) + "."
             : "The jitter was estimated from these residuals, so that their size is no test of "
               "it.")});
  }
}

void add_facts(const Json& content, Section& section) {
  TextTable table{"Fit", {"quantity", "value"}, {}};
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) table.rows.push_back({name, value});
  };
  const auto number = [&](const char* key, int digits, const char* unit) {
    const auto value = number_at(content, key);
    return value ? rounded(*value, digits) + unit : std::string();
  };
  add("impacts used", count_at(content, "/impacts"));
  add("uninterrupted parts", count_at(content, "/stretches"));
  add("closings in the recording", count_at(content, "/events"));
  add("closings left out", count_at(content, "/left_out"));
  add("from", number("/from", 6, " s"));
  add("to", number("/to", 6, " s"));
  add(is_true_at(content, "/jitter_told") ? "jitter, as given" : "jitter, as found",
      number("/jitter", 3, " s"));
  add("scatter of the residuals", number("/scatter", 3, " s"));
  if (is_true_at(content, "/jitter_told")) {
    add("χ²", number("/chi2", 4, ""));
    add("largest χ² that is accepted", number("/largest_chi2", 4, ""));
  }
  add("degrees of freedom", count_at(content, "/freedom"));
  if (number_at(content, "/predicted").value_or(0.0) > 0.0) {
    add("error of predicting the last fifth from the first four", number("/predicted", 2, " s"));
    add("the same error within the first four", number("/predicted_before", 2, " s"));
  }
  if (at(content, "/drift/value") != nullptr) {
    const std::string limit = number("/drift/high", 2, "");
    add("drift, energy per unit of time",
        is_true_at(content, "/drift/found") ? number("/drift/value", 2, "") + " (" +
                                                  number("/drift/low", 2, "") + " to " + limit + ")"
                                            : "none found, below " + limit + " (95 %)");
  }
  if (is_true_at(content, "/restitution_scatter/found")) {
    add("scatter of the restitution", number("/restitution_scatter/value", 2, ""));
  }
  if (at(content, "/restitution_trend/value") != nullptr) {
    add("trend of the restitution with the impact's speed",
        number("/restitution_trend/value", 2, "") + " ± " +
            number("/restitution_trend/sigma", 2, "") +
            (is_true_at(content, "/restitution_trend/found") ? "" : ", not significant"));
  }
  section.blocks.emplace_back(std::move(table));
}

// Lost and spurious events.
void add_events(const Json& content, Section& section) {
  TextTable table{"Lost and spurious events", {"t [s]", "contact", "event"}, {}};
  for (const auto& [key, what] : {std::pair{"/missing", "lost: the machine has an impact there"},
                                  std::pair{"/spurious", "spurious: no impact belongs to it"}}) {
    for (const Json& event : list_at(content, key)) {
      if (table.rows.size() >= most_rows) break;
      table.rows.push_back({rounded(number_at(event, "/t").value_or(unknown), 8),
                            count_at(event, "/contact"), what});
    }
  }
  if (!table.rows.empty()) section.blocks.emplace_back(std::move(table));
}

}  // namespace

Verdict verdict_of_identification(const JsonFile& identification) {
  const Json& content = identification.content;
  Verdict verdict{.about = "Identification, " + identification.file,
                  .first = sentence(text_at(content, "/verdict")),
                  .second = {},
                  .tone = is_true_at(content, "/fits") ? Tone::good : Tone::bad};
  if (verdict.first.empty()) {
    const std::string error = text_at(content, "/error");
    verdict.first = error.empty() ? "The report has no verdict." : sentence(error);
    return verdict;
  }
  const auto predicted = number_at(content, "/predicted");
  if (!is_true_at(content, "/fits")) {
    verdict.second = text_at(content, "/reason");
  } else if (predicted && *predicted > 0.0) {
    verdict.second =
        "The fit to the first four fifths of the recording predicts the impacts of the "
        "last fifth within " +
        rounded(*predicted, 2) + " s, and those of the four within " +
        rounded(number_at(content, "/predicted_before").value_or(unknown), 2) + " s.";
  } else {
    verdict.second = "The residuals scatter by " +
                     rounded(number_at(content, "/scatter").value_or(unknown), 3) +
                     " s; a prediction of later impacts was not tested.";
  }
  return verdict;
}

Section identification_section(const JsonFile& identification, const Scene& scene) {
  const Json& content = identification.content;
  Section section{"Identification", {}};
  const std::string name = text_at(content, "/scene");
  if (!name.empty() && name != scene.name) {
    section.blocks.emplace_back(Paragraph{"The identification was of the scene " + name +
                                          ", this report shows the scene " + scene.name + "."});
  }
  if (!list_at(content, "/parameters").empty()) {
    section.blocks.emplace_back(parameters_of(content));
  }
  if (!list_at(content, "/others").empty()) {
    section.blocks.emplace_back(Paragraph{
        "Other values of the parameters fit the events as well: the result is ambiguous."});
  }
  add_intervals(content, section);
  add_facts(content, section);
  add_correlations(content, section);
  add_residuals(content, section);
  add_events(content, section);
  return section;
}

}  // namespace sprag::report
