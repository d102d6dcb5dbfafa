#include "tools/tolerance/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "command_line/program.h"
#include "tools/plot/script_text.h"

namespace sprag::tolerance {
namespace {

constexpr int columns = 3, panel_width = 350, panel_height = 260;
constexpr int above = 76, below = 20, to_the_left = 70;

// Line styles that differ without colour.
const char* style_of(EstimatorKind kind) {
  switch (kind) {
    case EstimatorKind::replica:
      return "lw 4";
    case EstimatorKind::timing:
      return "lw 2";
    case EstimatorKind::adaptive:
      return "lw 2.4 dt (2,3)";
    case EstimatorKind::both:
      break;
  }
  return "lw 2.4 dt (8,4)";
}

std::string label_of(const Deviation& deviation) {
  switch (deviation.kind) {
    case Deviation::Kind::jitter:
      return "jitter of event times [s]";
    case Deviation::Kind::offset:
      return "offset of event times [s]";
    case Deviation::Kind::lost:
      return "share of events lost";
    case Deviation::Kind::spurious:
      return "false pulses per s and contact";
    case Deviation::Kind::parameter:
      break;
  }
  return deviation.name + (deviation.share          ? ", share"
                           : deviation.unit.empty() ? ""
                                                    : " [" + deviation.unit + "]");
}

struct Span {
  double low = std::numeric_limits<double>::infinity(), high = 0.0;

  void take(double value) {
    if (!std::isfinite(value) || !(value > 0.0)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

plot::Script begun(const std::filesystem::path& output, double width, double height,
                   const std::string& title) {
  plot::Script script(output, width, height);
  script.line("unset key");
  script.title(title, to_the_left, 20.0, 13);
  return script;
}

// Legend: samples of lines with names, in a row below the title.
class Legend {
 public:
  void sample(const std::string& name, const std::string& style, plot::Script& script) {
    script.line("set arrow from " + script.screen(x_, level) + " to " +
                script.screen(x_ + 34.0, level) + " nohead " + style);
    script.line("set label " + plot::quoted(name) + " at " + script.screen(x_ + 40.0, level) +
                " left noenhanced");
    x_ += 64.0 + 8.0 * static_cast<double>(plot::shown_length(name));
  }

 private:
  static constexpr double level = 46.0;
  double x_ = to_the_left;
};

std::string coloured(EstimatorKind kind) {
  return " lc rgb " + plot::rgb(plot::colour_of(study::name(kind)));
}

constexpr const char* target_style = "lw 1.4 dt (2,4) lc rgb '#202020'";
constexpr const char* band_style = "lw 9 lc rgb '#d8d8d8'";

std::string target_of(double value) { return plot::number(value) + " with lines " + target_style; }

}  // namespace

void check_picture(const std::filesystem::path& output) {
  try {
    plot::terminal(output, 1, 1);
  } catch (const std::invalid_argument& e) {
    throw UsageError(e.what());
  }
}

std::string chart_script(const Bench& bench, const Tolerances& tolerances,
                         const std::filesystem::path& output) {
  const auto& estimators = bench.settings().estimators;
  const auto panels = static_cast<int>(tolerances.found.size());
  const int across = std::min(columns, std::max(panels, 1));
  const int rows = (panels + across - 1) / across;
  const double width = to_the_left + across * panel_width;
  const double height = above + rows * panel_height + below;
  // Values above a hundred times the motion are drawn at that limit, so that a divergence is
  // visible.
  const double highest = 100.0 * bench.motion_energy();
  Span V;
  V.take(bench.target());
  V.take(bench.motion_energy());
  for (const Spread& spread : tolerances.undisturbed.V) V.take(spread.median);
  for (const Found& found : tolerances.found) {
    for (const Point& point : found.points)
      for (const Spread& spread : point.V) V.take(std::min(spread.median, highest));
  }
  // Values far below the target need no resolution.
  const double lowest = std::max(V.low / 3.0, 1e-10 * bench.target());

  plot::Script script =
      begun(output, width, height, bench.scene().name + ": V that is left, against what is off");
  script.line("set logscale xy");
  script.line("set format x '10^{%T}'");
  script.line("set yrange [" + plot::number(lowest) + ":" + plot::number(3.0 * V.high) + "]");
  Legend legend;
  for (const EstimatorKind kind : estimators)
    legend.sample(study::name(kind), std::string(style_of(kind)) + coloured(kind), script);
  legend.sample("target", target_style, script);
  legend.sample("shaded: all runs", band_style, script);

  for (int i = 0; i < panels; ++i) {
    const Found& found = tolerances.found[static_cast<std::size_t>(i)];
    const double left = to_the_left + (i % across) * panel_width;
    const double top = above + (i / across) * panel_height;
    script.margins({left, left + panel_width - 40.0, top, top + panel_height - 70.0});
    script.line("set xlabel " + plot::quoted(label_of(found.deviation)) + " noenhanced");
    // All panels share one axis of V.
    script.line(i % across == 0 ? "set ylabel 'V' offset 1" : "unset ylabel; set format y ''");
    if (i % across == 0) script.line("set format y '10^{%T}'");
    std::vector<std::string> parts, curves;
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      std::vector<double> amount, low, median, high;
      const auto shown = [&](double value) {
        return std::isnan(value) ? highest : std::clamp(value, lowest, highest);
      };
      for (const Point& point : found.points) {
        amount.push_back(point.amount);
        low.push_back(shown(point.V[e].low));
        median.push_back(shown(point.V[e].median));
        high.push_back(shown(point.V[e].high));
      }
      const std::string name = script.data({amount, low, median, high});
      const std::string colour = coloured(estimators[e]);
      parts.push_back(name + " using 1:2:4 with filledcurves fs transparent solid 0.13 noborder" +
                      colour);
      curves.push_back(name + " using 1:3 with lines " + style_of(estimators[e]) + colour);
    }
    script.line("set xrange [" + plot::number(found.points.front().amount) + ":" +
                plot::number(found.points.back().amount) + "]");
    parts.insert(parts.end(), curves.begin(), curves.end());
    parts.push_back(target_of(bench.target()));
    script.plot(parts);
    if (i == 0) script.line("unset label; unset arrow");
  }
  script.line("unset multiplot");
  return std::move(script).text();
}

std::string chart_script(const Bench& bench, const std::vector<FewerModes>& table,
                         const std::filesystem::path& output) {
  const auto& estimators = bench.settings().estimators;
  constexpr double width = 940.0, height = 470.0;
  const double motion = observed_motion(bench);
  plot::Script script =
      begun(output, width, height, bench.scene().name + ": error against the modes that are kept");
  Span errors;
  errors.take(motion);
  // With all modes the error is rounding or jitter, far below that with few modes.
  for (const FewerModes& row : table) {
    for (const auto* of : {&row.plain, &row.corrected})
      for (const Spread& error : *of) errors.take(std::min(error.median, 100.0 * motion));
  }
  const double lowest = std::max(errors.low / 3.0, 1e-8 * motion);
  script.line("set logscale y");
  script.line("set format y '10^{%T}'");
  script.line("set yrange [" + plot::number(lowest) + ":" + plot::number(3.0 * errors.high) + "]");
  script.line("set xrange [" + plot::number(0.9 * table.front().modes) + ":" +
              plot::number(1.05 * table.back().modes) + "]");
  if (table.back().modes > 8) script.line("set logscale x");
  std::string ticks;
  for (const FewerModes& row : table)
    ticks += (ticks.empty() ? "" : ", ") + std::to_string(row.modes);
  script.line("set xtics (" + ticks + ")");
  script.line("set xlabel 'modes that are kept'");
  script.line("set ylabel 'root mean square of the error [m]' offset 1");
  script.margins({to_the_left + 10.0, width - 20.0, above + 24.0, height - 60.0});
  Legend legend;
  for (const EstimatorKind kind : estimators) {
    legend.sample(study::name(kind), std::string("lw 2") + coloured(kind), script);
    legend.sample("corrected", std::string("lw 2 dt (8,4)") + coloured(kind), script);
  }
  legend.sample("motion", target_style, script);

  std::vector<std::string> curves;
  const auto add_curve = [&](std::vector<Spread> FewerModes::*of, std::size_t e,
                             const std::string& style) {
    std::vector<double> modes, shown;
    for (const FewerModes& row : table) {
      if ((row.*of).empty()) continue;
      const double error = (row.*of)[e].median;
      modes.push_back(row.modes);
      shown.push_back(std::isnan(error) ? errors.high : std::clamp(error, lowest, errors.high));
    }
    curves.push_back(script.data({modes, shown}) + " with linespoints pt 7 ps 0.7 " + style +
                     coloured(estimators[e]));
  };
  for (std::size_t e = 0; e < estimators.size(); ++e) {
    add_curve(&FewerModes::plain, e, "lw 2");
    if (!table.front().corrected.empty() || table.size() > 1)
      add_curve(&FewerModes::corrected, e, "lw 2 dt (8,4)");
  }
  curves.push_back(target_of(motion));
  script.plot(curves);
  script.line("unset multiplot");
  return std::move(script).text();
}

}  // namespace sprag::tolerance
