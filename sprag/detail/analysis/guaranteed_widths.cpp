#include "sprag/detail/analysis/guaranteed_widths.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/half_width.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/text/table.h"

namespace sprag {
namespace {

constexpr std::size_t wanted_events = 400;
constexpr double slow_periods = 20.0;  // of the first trial run
constexpr int most_doublings = 8;

std::string with_unit(double value, double scale, const std::string& unit) {
  char number[48];
  const double shown = value * scale;
  // Two digits as 1e+02 are hard to read.
  std::snprintf(number, sizeof number, shown >= 99.5 && shown < 1e5 ? "%.0f" : "%.2g", shown);
  return number + (unit.empty() ? "" : " " + unit);
}

// In the unit, its thousandth or its millionth.
std::string with_prefix(double value, const std::string& unit) {
  if (value < 1e-4) return with_unit(value, 1e6, "u" + unit);
  return value < 0.1 ? with_unit(value, 1e3, "m" + unit) : with_unit(value, 1.0, unit);
}

std::string limits_text(const Tolerance& tolerance) {
  std::string text;
  const auto add = [&](double value, const std::string& words) {
    if (value > 0.0) text += (text.empty() ? "" : ", ") + words;
  };
  add(tolerance.time, "event times to " + with_prefix(tolerance.time, "s"));
  add(tolerance.restitution, "restitution to " + with_unit(tolerance.restitution, 1.0, ""));
  add(tolerance.stiffness, "stiffness to " + with_unit(tolerance.stiffness, 100.0, "%"));
  add(tolerance.damping, "damping to " + with_unit(tolerance.damping, 100.0, "%"));
  add(tolerance.force, "force to " + with_unit(tolerance.force, 1.0, ""));
  add(tolerance.clearance, "clearance to " + with_prefix(tolerance.clearance, "m"));
  return text;
}

}  // namespace

std::optional<GuaranteedWidths> guaranteed_widths(const Scene& scene) {
  if (!scene.prior.tolerance.any()) return std::nullopt;
  GuaranteedWidths result;
  result.why_none = why_no_bound(scene);
  if (!result.why_none.empty()) return result;
  const Dynamics dynamics(scene.model);
  const EnergyMetric metric(dynamics);
  const double slowest = std::max(metric.omega().minCoeff(), 1e-2 * metric.omega_max());
  result.duration = slow_periods * 6.3 / (slowest > 0.0 ? slowest : 1.0);
  std::vector<ContactEvent> events;
  try {
    Master master(scene.model, scene.truth.given ? scene.truth.start : scene.prior.start);
    for (int i = 0; i < most_doublings; ++i) {
      master.advance(at(result.duration), events, 20 * wanted_events);
      if (events.size() >= wanted_events) break;
      if (i + 1 < most_doublings) result.duration *= 2.0;
    }
  } catch (const SimulationError& error) {
    result.why_none = std::string("the trial run ended: ") + error.what();
    return result;
  }
  result.floor = certified_floor(scene, events, result.duration);
  const HalfWidths widths(metric);
  const auto& outputs = scene.model.outputs;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    result.widths.emplace_back(
        outputs[i].name,
        half_width(widths.outputs()[static_cast<Eigen::Index>(i)], result.floor.largest));
  }
  for (Eigen::Index i = 0; i < widths.gaps().size() && outputs.empty(); ++i) {
    result.widths.emplace_back("gap " + std::to_string(i + 1),
                               half_width(widths.gaps()[i], result.floor.largest));
  }
  if (!std::isfinite(result.floor.largest)) result.why_none = "the bound stays infinite";
  return result;
}

std::string guaranteed_text(const Scene& scene, const std::optional<GuaranteedWidths>& found) {
  if (!found) return {};
  std::string words;
  if (!found->why_none.empty()) {
    words = "not guaranteed: " + found->why_none;
  } else {
    words = "guaranteed for " + limits_text(scene.prior.tolerance) + ": ";
    std::string unheld;
    for (const auto& [name, width] : found->widths) {
      if (std::isfinite(width)) {
        words += name + " within " + with_prefix(width, "m") + ", ";
      } else {
        unheld += (unheld.empty() ? "" : ", ") + name;
      }
    }
    words += "V below " + with_unit(found->floor.largest, 1.0, "") +
             ", in the second half of a trial of " + with_unit(found->duration, 1.0, "s");
    if (!unheld.empty()) words += "; no length for " + unheld + ", which no spring holds";
    words += std::isfinite(found->floor.without_events)
                 ? "; after a gap in the events V below " +
                       with_unit(found->floor.without_events, 1.0, "")
                 : "; after a gap in the events B is infinite, since C or K is singular or joint "
                   "impacts may gain energy";
  }
  std::string text;
  append_wrapped(text, words);
  return text;
}

}  // namespace sprag
