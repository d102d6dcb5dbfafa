#include "tools/report/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tools/plot/gnuplot.h"
#include "tools/plot/script_text.h"

namespace sprag::report {
namespace {

constexpr plot::PictureForm narrow{.across = 560, .across_of_two = 420, .legend_above = true};
constexpr const char* svg = "report.svg";  // for the terminal alone; no such file is written

}  // namespace

Picture picture_of(const plot::Figure& figure, const std::string& caption) {
  return {caption, plot::gnuplot_script(figure, svg, narrow)};
}

plot::Panel residual_panel(const Residuals& residuals, const std::string& quantity,
                           const std::string& unit) {
  plot::Panel panel;
  const bool limits = unit.empty();
  panel.name = panel.y_label = quantity;
  const int most = residuals.contact.empty()
                       ? 0
                       : *std::max_element(residuals.contact.begin(), residuals.contact.end());
  for (int contact = 1; contact <= most; ++contact) {
    plot::Dots dots;
    dots.title = most > 1 ? "contact " + std::to_string(contact) : "";
    dots.shape = contact - 1;
    for (std::size_t k = 0; k < residuals.size(); ++k) {
      if (residuals.contact[k] != contact) continue;
      dots.t.push_back(residuals.t[k]);
      dots.y.push_back(residuals.value[k]);
      dots.sigma.push_back(limits ? std::numeric_limits<double>::quiet_NaN() : residuals.sigma[k]);
    }
    if (!dots.t.empty()) panel.dots.push_back(std::move(dots));
  }
  if (residuals.size() == 0) return panel;
  const std::vector<double> ends{residuals.t.front(), residuals.t.back()};
  const auto line = [&](double y, const char* title) {
    panel.curves.push_back({title,
                            plot::Colour::grey,
                            y == 0.0 ? plot::Line::thin : plot::Line::dashed,
                            ends,
                            {y, y}});
  };
  line(0.0, "");
  if (limits) {
    panel.reach = 3.0;
    line(2.0, "± 2 sigma");
    line(-2.0, "");
  } else {
    plot::set_readable_unit(panel, quantity, unit);
  }
  return panel;
}

Picture residual_picture(const Residuals& residuals, const std::string& quantity,
                         const std::string& unit, const std::string& caption) {
  plot::Figure figure;
  const auto [first, last] = std::minmax_element(residuals.t.begin(), residuals.t.end());
  const double edge = 0.01 * std::max(*last - *first, 1e-9 * std::abs(*last));
  figure.from = *first - edge;
  figure.to = *last + edge;
  if (!(figure.from < figure.to)) figure.to = figure.from + 1.0;
  figure.panels.push_back(residual_panel(residuals, quantity, unit));
  return picture_of(figure, caption);
}

Picture correlation_picture(const std::vector<std::string>& names,
                            const std::vector<std::vector<double>>& values,
                            const std::string& caption) {
  using plot::number;
  const auto n = names.size();
  std::size_t longest = 4;
  for (const std::string& name : names) longest = std::max(longest, plot::shown_length(name));
  const double cell = std::clamp(480.0 / static_cast<double>(n), 14.0, 48.0);
  const double side = cell * static_cast<double>(n);
  const double left = 7.4 * static_cast<double>(longest) + 46.0;
  // As wide as the others, so that texts have one size.
  const double width = std::max(left + side + 80.0, 668.0), height = side + 44.0;
  plot::Script script(svg, width, height);
  script.margins({left, left + side, 10.0, 10.0 + side});
  std::string y_tics, x_tics;
  for (std::size_t i = 0; i < n; ++i) {
    const std::string at = std::to_string(i + 1);
    y_tics += (i > 0 ? ", " : "") + plot::quoted(names[i] + "  " + at) + " " + at;
    x_tics += (i > 0 ? ", " : "") + ("'" + at + "' " + at);
  }
  std::vector<double> x, y, z;
  std::vector<std::string> labels;
  const bool room = cell >= 30.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      if (!std::isfinite(values[i][k])) continue;
      x.push_back(static_cast<double>(k + 1));
      y.push_back(static_cast<double>(i + 1));
      z.push_back(values[i][k]);
      if (!room) continue;
      char text[16];
      std::snprintf(text, sizeof text, "%.2f", values[i][k]);
      labels.push_back("set label '" + std::string(text) + "' at " + number(x.back()) + "," +
                       number(y.back()) + " center front font ',9'");
    }
  }
  const std::string most = number(static_cast<double>(n) + 0.5);
  script.line("set xrange [0.5:" + most + "]");
  script.line("set yrange [" + most + ":0.5]");
  script.line("set ytics (" + y_tics + ") noenhanced");
  script.line("set xtics (" + x_tics + ")");
  script.line("unset grid");
  script.line("unset key");
  script.line("set palette defined (-1 '#0072B2', 0 '#ffffff', 1 '#D55E00')");
  script.line("set cbrange [-1:1]");
  script.line("set style fill solid noborder");
  for (const std::string& label : labels) script.line(label);
  if (x.empty()) {
    script.line("unset colorbox");
    script.plot({"NaN notitle"});
  } else {
    script.plot({script.data({x, y, z}) +
                 " using 1:2:($1-0.5):($1+0.5):($2-0.5):($2+0.5):3 with boxxyerror fc palette "
                 "notitle"});
  }
  script.line("unset multiplot");
  return {caption, std::move(script).text()};
}

Picture interval_picture(const std::vector<Interval>& intervals, const std::string& caption) {
  using plot::number;
  const auto n = static_cast<double>(intervals.size());
  std::size_t longest = 4, widest = 4;
  double reach = 1.0;
  std::vector<double> x, y, low, high;
  std::string y_tics;
  for (const Interval& of : intervals) {
    longest = std::max(longest, plot::shown_length(of.name));
    widest = std::max(widest, plot::shown_length(of.text));
    reach = std::max({reach, std::abs(of.value), std::abs(of.low), std::abs(of.high)});
    x.push_back(of.value);
    low.push_back(of.low);
    high.push_back(of.high);
    y.push_back(static_cast<double>(y.size() + 1));
    y_tics += (y_tics.empty() ? "" : ", ") + plot::quoted(of.name) + " " + number(y.back());
  }
  constexpr double row = 26.0, below = 66.0, width = 668.0, of_character = 7.4;
  const double left = of_character * static_cast<double>(longest) + 20.0;
  const double right =
      std::max(width - of_character * static_cast<double>(widest) - 16.0, left + 160.0);
  const double height = row * n + 14.0;
  plot::Script script(svg, std::max(width, right + 40.0), height + below);
  script.margins({left, right, 10.0, 10.0 + height});
  // An interval far beyond the range would squeeze all others.
  const std::string end = number(1.05 * std::min(reach, 4.0));
  script.line("set xrange [-" + end + ":" + end + "]");
  script.line("set yrange [" + number(n + 0.6) + ":0.4]");
  script.line("set ytics (" + y_tics + ") noenhanced");
  script.line("set xlabel 'scene = 0, ends of the assumed range = ± 1'");
  script.line("unset key");
  script.line("set object 1 rectangle from -1," + number(n + 0.6) +
              " to 1,0.4 behind fillcolor '#eef3f8' fillstyle solid noborder");
  script.line("set arrow 1 from 0," + number(n + 0.6) + " to 0,0.4 nohead linecolor '#808080'");
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    script.line("set label " + plot::quoted(intervals[i].text) + " at graph 1.02,first " +
                number(y[i]) + " left noenhanced font ',10'");
  }
  script.plot({script.data({x, y, low, high}) +
               " using 1:2:3:4 with xerrorbars pointtype 7 pointsize 0.7 linewidth 2 linecolor "
               "'#0072B2' notitle"});
  script.line("unset multiplot");
  return {caption, std::move(script).text()};
}

}  // namespace sprag::report
