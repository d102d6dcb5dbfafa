#include "tools/plot/gnuplot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/plot/script_text.h"
#include "tools/plot/thinning.h"

namespace sprag::plot {
namespace {

// Lengths in pixels of the picture.
constexpr int pixels_across = 1000, pixels_across_of_two = 620;
constexpr int panel_height = 250, contact_height = 40, least_height = 110, least_picture = 420;
constexpr int above = 46, above_without_title = 16, below = 58, between = 20, to_the_left = 84;
constexpr double letter = 7.4, room_of_sample = 70.0;

// Widths and dashes distinguish lines that are printed without colours.
std::string style(Line line) {
  switch (line) {
    case Line::thick:
      return "lw 4";
    case Line::solid:
      return "lw 1.8";
    case Line::thin:
      return "lw 1.1";
    case Line::dashed:
      return "lw 2 dt (8,4)";
    case Line::dotted:
      return "lw 2 dt (2,4)";
  }
  return {};
}

bool reaches(const std::vector<double>& t, Figure::Zoom axis) {
  return !t.empty() && t.front() <= axis.to && t.back() >= axis.from;
}

struct Column {
  std::vector<const Panel*> panels;
  Figure::Zoom axis;
  double left = 0.0, right = 0.0;
};

struct Layout {
  std::vector<Column> columns;
  double width = 0.0, height = 0.0, above = 0.0;
};

int height_of(const Panel& panel) {
  if (panel.contacts.empty()) return panel_height;
  return std::max(least_height, contact_height * static_cast<int>(panel.contacts.size()));
}

int height_of(const std::vector<const Panel*>& panels) {
  int height = -between;
  for (const Panel* panel : panels) height += height_of(*panel) + between;
  return height;
}

double longest_title(const Figure& figure) {
  std::size_t longest = 30;
  for (const Panel& panel : figure.panels) {
    for (const Curve& curve : panel.curves) longest = std::max(longest, shown_length(curve.title));
    for (const Band& band : panel.bands) longest = std::max(longest, shown_length(band.title));
  }
  return static_cast<double>(longest);
}

Layout layout_of(const Figure& figure) {
  Layout layout;
  std::vector<Column>& columns = layout.columns;
  columns.push_back({{}, {figure.from, figure.to}});
  if (figure.zoom) columns.push_back({{}, *figure.zoom});
  for (const Panel& panel : figure.panels) {
    (panel.whole_run ? columns.front() : columns.back()).panels.push_back(&panel);
  }
  std::erase_if(columns, [](const Column& column) { return column.panels.empty(); });
  const double across = columns.size() == 1 ? pixels_across : pixels_across_of_two;
  const double legend = longest_title(figure) * letter + room_of_sample;
  int tallest = least_picture;
  for (Column& column : columns) {
    column.left = layout.width + to_the_left;
    column.right = column.left + across;
    layout.width = column.right + legend;
    tallest = std::max(tallest, height_of(column.panels));
  }
  layout.above = figure.title.empty() ? above_without_title : above;
  layout.height = layout.above + tallest + below;
  return layout;
}

void draw(const Panel& panel, const Place& place, Figure::Zoom axis, bool lowest, Script& script) {
  const int pixels = static_cast<int>(place.right - place.left);
  std::vector<std::string> parts;
  const auto add = [&](const std::string& name, const std::string& how, const std::string& title) {
    parts.push_back(name + " " + how + (title.empty() ? " notitle" : " title " + quoted(title)));
  };
  double least = std::numeric_limits<double>::infinity(), greatest = -least;
  const auto see = [&](const std::vector<double>& t, const std::vector<double>& y) {
    for (std::size_t k = 0; k < t.size(); ++k) {
      if (!std::isfinite(y[k]) || t[k] < axis.from || t[k] > axis.to) continue;
      least = std::min(least, y[k]);
      greatest = std::max(greatest, y[k]);
    }
  };
  for (const Band& band : panel.bands) {
    const BandPoints points = thinned(band.t, band.low, band.high, axis.from, axis.to, pixels);
    if (!reaches(points.t, axis)) continue;
    see(points.t, points.low);
    see(points.t, points.high);
    add(script.data({points.t, points.low, points.high}),
        "using 1:2:3 with filledcurves fs transparent solid 0.25 noborder fc rgb " +
            rgb(band.colour),
        band.title);
  }
  for (const Curve& curve : panel.curves) {
    std::vector<double> y = curve.y;
    // A logarithmic axis cannot show these values.
    if (panel.logarithmic) {
      for (double& value : y) value = value > 0.0 ? value : std::nan("");
    }
    const Points points = thinned(curve.t, y, axis.from, axis.to, pixels);
    const bool known = std::any_of(points.y.begin(), points.y.end(),
                                   [](double value) { return std::isfinite(value); });
    if (!known || !reaches(points.t, axis)) continue;
    see(points.t, points.y);
    add(script.data({points.t, points.y}),
        "using 1:2 with lines " + style(curve.line) + " lc rgb " + rgb(curve.colour), curve.title);
  }
  for (const Dots& dots : panel.dots) {
    const std::vector<int> shapes{7, 5, 9, 11, 13, 6, 4, 8};
    const std::string look = " pt " +
                             std::to_string(shapes[static_cast<std::size_t>(dots.shape) % 8]) +
                             " ps 0.7 lc rgb " + rgb(dots.colour);
    std::vector<double> t, y, bar;
    for (std::size_t k = 0; k < dots.t.size(); ++k) {
      if (dots.t[k] < axis.from || dots.t[k] > axis.to) continue;
      t.push_back(dots.t[k]);
      y.push_back(dots.y[k]);
      bar.push_back(std::isfinite(dots.sigma[k]) ? 2.0 * dots.sigma[k] : 0.0);
    }
    if (!t.empty()) add(script.data({t, y, bar}), "using 1:2:3 with yerrorbars" + look, dots.title);
  }
  std::vector<double> impacts;
  for (const double t : panel.impacts) {
    if (axis.from <= t && t <= axis.to) impacts.push_back(t);
  }
  if (!impacts.empty()) {
    add(script.data({impacts, std::vector<double>(impacts.size(), 0.0)}),
        "using 1:2 with points pt 7 ps 0.6 lc rgb '#303030'", "contact closes, as reported");
  }
  std::vector<double> pulse_t, pulse_row, from, to, row;
  for (std::size_t i = 0; i < panel.contacts.size(); ++i) {
    const auto height = static_cast<double>(i + 1);
    for (const double t : panel.contacts[i].pulses) {
      if (t < axis.from || t > axis.to) continue;
      pulse_t.push_back(t);
      pulse_row.push_back(height);
    }
    for (const auto& [begin, end] : panel.contacts[i].closed) {
      if (end < axis.from || begin > axis.to) continue;
      from.push_back(std::max(begin, axis.from));
      to.push_back(std::min(end, axis.to));
      row.push_back(height);
    }
  }
  if (!from.empty()) {
    add(script.data({from, row, to}),
        "using 1:2:($3-$1):(0) with vectors nohead lw 6 lc rgb '#7F7F7F'", "contact stays closed");
  }
  if (!pulse_t.empty()) {
    add(script.data({pulse_t, pulse_row}),
        "using 1:($2-0.35):(0):(0.7) with vectors nohead lw 1.2 lc rgb '#303030'",
        "impact, as reported");
  }

  script.panel(place, panel.y_label, place.left - to_the_left + 14.0);
  script.line("set xrange [" + number(axis.from) + ":" + number(axis.to) + "]");
  script.line(lowest ? "set xlabel 'time t [s]'" : "unset xlabel");
  script.line(lowest ? "set format x '%g'" : "set format x ''");
  script.line(panel.logarithmic ? "set logscale y" : "unset logscale y");
  script.line(panel.logarithmic ? "set format y '10^{%T}'" : "set format y '%g'");
  if (panel.contacts.empty()) {
    // A constant curve has no range of its own.
    const bool constant = least == greatest && panel.dots.empty() && impacts.empty();
    const double around = least == 0.0 ? 1.0 : 0.1 * std::abs(least);
    script.line(constant && !panel.logarithmic
                    ? "set yrange [" + number(least - around) + ":" + number(least + around) + "]"
                    : "set yrange [*:*]");
    script.line("set ytics autofreq");
  } else {
    script.line("set yrange [0.4:" + number(static_cast<double>(panel.contacts.size()) + 0.6) +
                "]");
    script.line("set ytics 1");
  }
  if (parts.empty()) {
    // An empty frame: there is no data in this interval.
    script.line("unset logscale y");
    script.line("plot [][0:1] -1 notitle");
  } else {
    script.plot(parts);
  }
  script.line("unset label 1");
}

// Panels of a column share the height of the picture.
void draw(const Column& column, const Layout& layout, Script& script) {
  const double scale =
      (layout.height - layout.above - below + between) / (height_of(column.panels) + between);
  double y = layout.above;
  for (const Panel* panel : column.panels) {
    const double step = scale * (height_of(*panel) + between);
    draw(*panel, {column.left, column.right, y, y + step - between}, column.axis,
         panel == column.panels.back(), script);
    y += step;
  }
}

}  // namespace

std::string gnuplot_script(const Figure& figure, const std::filesystem::path& output) {
  const Layout layout = layout_of(figure);
  Script script(output, layout.width, layout.height);
  if (!figure.title.empty()) script.title(figure.title, to_the_left, 24.0, 14);
  for (const Column& column : layout.columns) draw(column, layout, script);
  script.line("unset multiplot");
  return std::move(script).text();
}

}  // namespace sprag::plot
