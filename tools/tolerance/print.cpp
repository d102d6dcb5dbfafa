#include "tools/tolerance/print.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "sprag/detail/analysis/wrapped_text.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/text/printable.h"
#include "tools/tolerance/words.h"

namespace sprag::tolerance {
namespace {

std::string description(const Deviation& deviation) {
  switch (deviation.kind) {
    case Deviation::Kind::jitter:
      return "event times jitter";
    case Deviation::Kind::offset:
      return "clocks differ";
    case Deviation::Kind::lost:
      return "events get lost";
    case Deviation::Kind::spurious:
      return "events that were none";
    case Deviation::Kind::parameter:
      break;
  }
  return deviation.name;
}

// "both bears event times to 0.3 ms, 2 % of the events lost, ..."
void append_plain_words(const Tolerances& tolerances, const std::string& estimator, std::size_t e,
                        std::string& text) {
  std::string borne, not_borne;
  const auto add = [](const std::string& words, std::string& list) {
    if (!list.empty()) list += ", ";
    list += words;
  };
  for (const Found& found : tolerances.found) {
    const Limit& limit = found.limits[e];
    if (limit.kind == Limit::Kind::never) {
      append_wrapped(text,
                     "With " + estimator + " V does not come below it even where nothing is off.");
      return;
    }
    if (limit.kind == Limit::Kind::below_all) {
      add(in_words(found.deviation, limit.amount), not_borne);
    } else {
      add(in_words(found.deviation, limit.amount), borne);
      if (limit.kind == Limit::Kind::beyond_all) borne += " or worse";
    }
  }
  if (!borne.empty())
    append_wrapped(text, "It is enough for " + estimator + " to have " + borne + ".");
  if (!not_borne.empty()) append_wrapped(text, "It is not enough to have " + not_borne + ".");
}

}  // namespace

std::string limit_text(const Deviation& deviation, const Limit& limit) {
  switch (limit.kind) {
    case Limit::Kind::within:
      return amount_text(deviation, limit.amount);
    case Limit::Kind::beyond_all:
      return "> " + amount_text(deviation, limit.amount);
    case Limit::Kind::below_all:
      return "< " + amount_text(deviation, limit.amount);
    case Limit::Kind::never:
      break;
  }
  return "-";
}

std::string to_text(const Bench& bench, const Tolerances& tolerances) {
  const Settings& settings = bench.settings();
  std::string text = printable(bench.scene().name) + ": how much may be off for V < " +
                     short_number(bench.target()) + ", " +
                     short_number(bench.target() / bench.motion_energy()) +
                     " of the energy of the motion\n\n";
  constexpr std::size_t column = 23;  // "0.076 per s and contact"
  std::size_t widest = 22;
  for (const Found& found : tolerances.found)
    widest = std::max(widest, description(found.deviation).size());
  std::vector<std::string> cells = {"what is off"};
  for (const EstimatorKind kind : settings.estimators) cells.emplace_back(study::name(kind));
  cells.emplace_back("guaranteed for");
  add_line(cells, widest, column, text);
  cells = {"nothing: V is"};
  for (const Spread& V : tolerances.undisturbed.V) cells.push_back(short_number(V.median));
  add_line(cells, widest, column, text);
  for (const Found& found : tolerances.found) {
    cells = {description(found.deviation)};
    for (const Limit& limit : found.limits) cells.push_back(limit_text(found.deviation, limit));
    cells.push_back(found.guaranteed ? limit_text(found.deviation, *found.guaranteed) : "-");
    add_line(cells, widest, column, text);
  }
  text += '\n';
  for (std::size_t e = 0; e < settings.estimators.size(); ++e) {
    append_plain_words(tolerances, study::name(settings.estimators[e]), e, text);
  }
  text += '\n';
  append_wrapped(
      text,
      "V: the median of the second half of a run, then of " + std::to_string(settings.runs) +
          " runs of " + short_number(bench.duration()) + " s, " +
          short_number(bench.duration() * bench.closings_per_time()) +
          " closings each. One thing is off at a time; event times jitter by " +
          short_number(bench.scene().prior.jitter) + " s beside it" +
          (bench.scene().prior.drift > 0.0 ? ", and filters are given a drift of " +
                                                 short_number(bench.scene().prior.drift) + " per s"
                                           : std::string()) +
          ". The columns of estimators are measured. \"guaranteed for\" is proven: with a "
          "deviation of every event, or of the parameter, up to there the replica's bound B "
          "stays below the target.");
  return text;
}

void write_json(const Bench& bench, const Tolerances& tolerances, nlohmann::ordered_json& object) {
  const Settings& settings = bench.settings();
  const auto spreads = [&](const Point& point) {
    nlohmann::ordered_json of;
    for (std::size_t e = 0; e < settings.estimators.size(); ++e) {
      nlohmann::ordered_json& entry = of[study::name(settings.estimators[e])];
      entry = to_json(point.V[e]);
      if (!std::isnan(point.worse[e])) entry["worse"] = point.worse[e];
    }
    return of;
  };
  object["scene"] = bench.scene().name;
  object["target"] = bench.target();
  object["motion_energy"] = bench.motion_energy();
  object["duration"] = bench.duration();
  object["runs"] = settings.runs;
  object["closings_per_time"] = bench.closings_per_time();
  object["jitter"] = bench.scene().prior.jitter;
  object["drift"] = bench.scene().prior.drift;
  object["undisturbed"] = spreads(tolerances.undisturbed);
  object["disturbances"] = nlohmann::ordered_json::array();
  for (const Found& found : tolerances.found) {
    nlohmann::ordered_json of = {{"what", found.deviation.name},
                                 {"unit", found.deviation.unit},
                                 {"share", found.deviation.share}};
    for (std::size_t e = 0; e < settings.estimators.size(); ++e) {
      const Limit& limit = found.limits[e];
      nlohmann::ordered_json& entry = of["tolerance"][study::name(settings.estimators[e])];
      entry["kind"] = name(limit.kind);
      if (limit.kind != Limit::Kind::never) entry["amount"] = limit.amount;
      entry["text"] = limit_text(found.deviation, limit);
    }
    if (found.guaranteed) {
      of["guaranteed"] = {{"kind", name(found.guaranteed->kind)},
                          {"text", limit_text(found.deviation, *found.guaranteed)}};
      if (found.guaranteed->kind != Limit::Kind::never) {
        of["guaranteed"]["amount"] = found.guaranteed->amount;
      }
    }
    for (const Point& point : found.points) {
      of["points"].push_back({{"amount", point.amount}, {"V", spreads(point)}});
    }
    object["disturbances"].push_back(std::move(of));
  }
}

std::string to_csv(const Bench& bench, const Tolerances& tolerances) {
  const auto& estimators = bench.settings().estimators;
  std::string text = "what,unit,amount,estimator,median,low,high,worse\n";
  const auto add = [&](const std::string& what, const std::string& unit, const Point& point) {
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      text += what + ',' + unit + ',';
      append_number(text, point.amount);
      text += std::string(",") + study::name(estimators[e]);
      append_spread(point.V[e], text);
      text += ',';
      if (std::isnan(point.worse[e])) {
        text += "nan";  // without a sign
      } else {
        append_number(text, point.worse[e]);
      }
      text += '\n';
    }
  };
  add("nothing", "", tolerances.undisturbed);
  for (const Found& found : tolerances.found) {
    for (const Point& point : found.points) add(found.deviation.name, found.deviation.unit, point);
  }
  return text;
}

}  // namespace sprag::tolerance
