#include "tools/tolerance/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "command_line/program.h"
#include "sprag/files/csv.h"
#include "tools/plot/script_text.h"

namespace sprag::tolerance {
namespace {

constexpr int columns = 3, panel_width = 350, panel_height = 260;
constexpr int above = 76, below = 20, to_the_left = 70;

std::string text_of(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

// As in the pictures of runs.
const char* colour_of(EstimatorKind kind) {
  switch (kind) {
    case EstimatorKind::replica:
      return "#d55e00";
    case EstimatorKind::timing:
      return "#cc79a7";
    case EstimatorKind::adaptive:
      return "#009e73";
    case EstimatorKind::both:
      break;
  }
  return "#0072b2";
}

// What a printer without colours tells them apart by.
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

void add(const std::string& line, std::string& text) { text += line + '\n'; }

// What both pictures begin with.
std::string beginning(const std::filesystem::path& output, double width, double height,
                      const std::string& title) {
  std::string text;
  add("set terminal " + plot::terminal(output, width, height), text);
  add("set output " + plot::quoted(output.string()), text);
  add("set encoding utf8", text);
  add("set border 3 lw 1 lc rgb '#404040'", text);
  add("set tics nomirror out scale 0.6 textcolor rgb '#202020'", text);
  add("set grid xtics ytics lt 1 lw 0.8 lc rgb '#d9d9d9'", text);
  add("set multiplot", text);
  add("unset key", text);
  add("set label " + plot::quoted(title) + " at screen " + text_of(to_the_left / width) +
          ", screen " + text_of(1.0 - 20.0 / height) + " left noenhanced font ',13'",
      text);
  return text;
}

// Samples of lines with names, in a row below the title.
class Legend {
 public:
  Legend(double width, double height) : width_(width), level_(text_of(1.0 - 46.0 / height)) {}

  void sample(const std::string& name, const std::string& style, std::string& text) {
    add("set arrow from screen " + text_of(x_ / width_) + ", screen " + level_ + " to screen " +
            text_of((x_ + 34.0) / width_) + ", screen " + level_ + " nohead " + style,
        text);
    add("set label '" + name + "' at screen " + text_of((x_ + 40.0) / width_) + ", screen " +
            level_ + " left noenhanced",
        text);
    x_ += 64.0 + 8.0 * static_cast<double>(name.size());
  }

 private:
  double width_;
  std::string level_;
  double x_ = to_the_left;
};

std::string coloured(EstimatorKind kind) {
  return std::string(" lc rgb '") + colour_of(kind) + "'";
}

constexpr const char* target_style = "lw 1.4 dt (2,4) lc rgb '#202020'";
constexpr const char* band_style = "lw 9 lc rgb '#d8d8d8'";

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
  // What is larger than a hundred times the motion is drawn there, so that a divergence is seen.
  const double highest = 100.0 * bench.motion_energy();
  Span V;
  V.take(bench.target());
  V.take(bench.motion_energy());
  for (const Spread& spread : tolerances.undisturbed.V) V.take(spread.median);
  for (const Found& found : tolerances.found) {
    for (const Point& point : found.points)
      for (const Spread& spread : point.V) V.take(std::min(spread.median, highest));
  }
  // Far below the target all is well.
  const double lowest = std::max(V.low / 3.0, 1e-10 * bench.target());

  std::string text = beginning(output, width, height,
                               bench.scene().name + ": V that is left, against what is off");
  const auto line = [&](const std::string& of) { add(of, text); };
  const auto screen_y = [&](double from_above) { return text_of(1.0 - from_above / height); };
  line("set logscale xy");
  line("set format x '10^{%T}'");
  line("set yrange [" + text_of(lowest) + ":" + text_of(3.0 * V.high) + "]");
  Legend legend(width, height);
  for (const EstimatorKind kind : estimators)
    legend.sample(study::name(kind), std::string(style_of(kind)) + coloured(kind), text);
  legend.sample("target", target_style, text);
  legend.sample("shaded: all runs", band_style, text);

  int block = 0;
  for (int i = 0; i < panels; ++i) {
    const Found& found = tolerances.found[static_cast<std::size_t>(i)];
    const double left = to_the_left + (i % across) * panel_width;
    const double top = above + (i / across) * panel_height;
    line("set lmargin at screen " + text_of(left / width));
    line("set rmargin at screen " + text_of((left + panel_width - 40.0) / width));
    line("set tmargin at screen " + screen_y(top));
    line("set bmargin at screen " + screen_y(top + panel_height - 70.0));
    line("set xlabel '" + label_of(found.deviation) + "' noenhanced");
    // All panels have one axis of V.
    line(i % across == 0 ? "set ylabel 'V' offset 1" : "unset ylabel; set format y ''");
    if (i % across == 0) line("set format y '10^{%T}'");
    std::string bands, curves;
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      const std::string name = "$d" + std::to_string(++block);
      line(name + " << EOD");
      for (const Point& point : found.points) {
        const auto shown = [&](double value) {
          return text_of(std::isnan(value) ? highest : std::clamp(value, lowest, highest));
        };
        const Spread& spread = point.V[e];
        line(text_of(point.amount) + ' ' + shown(spread.low) + ' ' + shown(spread.median) + ' ' +
             shown(spread.high));
      }
      line("EOD");
      const std::string colour = coloured(estimators[e]);
      bands += (bands.empty() ? "" : ", ") + name +
               " using 1:2:4 with filledcurves fs transparent solid 0.13 noborder" + colour;
      curves += ", " + name + " using 1:3 with lines " + style_of(estimators[e]) + colour;
    }
    line("set xrange [" + text_of(found.points.front().amount) + ":" +
         text_of(found.points.back().amount) + "]");
    line("plot " + bands + curves + ", " + text_of(bench.target()) + " with lines " + target_style);
    if (i == 0) line("unset label; unset arrow");
  }
  line("unset multiplot");
  return text;
}

std::string chart_script(const Bench& bench, const std::vector<FewerModes>& table,
                         const std::filesystem::path& output) {
  const auto& estimators = bench.settings().estimators;
  constexpr double width = 940.0, height = 470.0;
  const double motion = observed_motion(bench);
  std::string text = beginning(output, width, height,
                               bench.scene().name + ": error against the modes that are kept");
  const auto line = [&](const std::string& of) { add(of, text); };
  Span errors;
  errors.take(motion);
  // All modes leave rounding or jitter, far below what few of them do.
  for (const FewerModes& row : table) {
    for (const auto* of : {&row.plain, &row.corrected})
      for (const Spread& error : *of) errors.take(std::min(error.median, 100.0 * motion));
  }
  const double lowest = std::max(errors.low / 3.0, 1e-8 * motion);
  line("set logscale y");
  line("set format y '10^{%T}'");
  line("set yrange [" + text_of(lowest) + ":" + text_of(3.0 * errors.high) + "]");
  line("set xrange [" + text_of(0.9 * table.front().modes) + ":" +
       text_of(1.05 * table.back().modes) + "]");
  if (table.back().modes > 8) line("set logscale x");
  std::string ticks;
  for (const FewerModes& row : table)
    ticks += (ticks.empty() ? "" : ", ") + std::to_string(row.modes);
  line("set xtics (" + ticks + ")");
  line("set xlabel 'modes that are kept'");
  line("set ylabel 'root mean square of the error [m]' offset 1");
  line("set lmargin at screen " + text_of((to_the_left + 10.0) / width));
  line("set rmargin at screen " + text_of((width - 20.0) / width));
  line("set tmargin at screen " + text_of(1.0 - (above + 24.0) / height));
  line("set bmargin at screen " + text_of(60.0 / height));
  Legend legend(width, height);
  for (const EstimatorKind kind : estimators) {
    legend.sample(study::name(kind), std::string("lw 2") + coloured(kind), text);
    legend.sample("corrected", std::string("lw 2 dt (8,4)") + coloured(kind), text);
  }
  legend.sample("motion", target_style, text);

  std::string curves;
  int block = 0;
  const auto add_curve = [&](std::vector<Spread> FewerModes::*of, std::size_t e,
                             const std::string& style) {
    const std::string name = "$d" + std::to_string(++block);
    line(name + " << EOD");
    for (const FewerModes& row : table) {
      if ((row.*of).empty()) continue;
      const double error = (row.*of)[e].median;
      line(std::to_string(row.modes) + ' ' +
           text_of(std::isnan(error) ? errors.high : std::clamp(error, lowest, errors.high)));
    }
    line("EOD");
    curves += name + " with linespoints pt 7 ps 0.7 " + style + coloured(estimators[e]) + ", ";
  };
  for (std::size_t e = 0; e < estimators.size(); ++e) {
    add_curve(&FewerModes::plain, e, "lw 2");
    if (!table.front().corrected.empty() || table.size() > 1)
      add_curve(&FewerModes::corrected, e, "lw 2 dt (8,4)");
  }
  line("plot " + curves + text_of(motion) + " with lines " + target_style);
  line("unset multiplot");
  return text;
}

}  // namespace sprag::tolerance
