#include "tools/plot/gnuplot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string_view>

#include "tools/plot/script_text.h"
#include "tools/plot/thinning.h"

namespace sprag::plot {
namespace {

// Lengths in pixels of the picture.
constexpr int panel_height = 250, contact_height = 40, least_height = 110, least_picture = 420;
constexpr int above = 46, above_without_title = 16, below = 58, between = 20;
constexpr double letter = 7.4, room_of_sample = 70.0, legend_row = 18.0, to_the_right = 24.0;
// Left of a panel: its title, a gap, its numbers and their ticks.
constexpr double title_at = 14.0, of_title = 28.0, of_ticks = 8.0, least_left = 84.0;

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

constexpr const char* closing_title = "contact closes, as reported";
constexpr const char* closed_title = "contact stays closed";
constexpr const char* pulse_title = "impact, as reported";

struct Column {
  std::vector<const Panel*> panels;
  Figure::Zoom axis;
  double margin = 0.0, left = 0.0, right = 0.0;  ///< the margin holds titles and numbers of y axes
  double row = 0.0;  ///< width of an entry of the legends above the panels; 0: they are elsewhere
};

struct Layout {
  std::vector<Column> columns;
  double width = 0.0, height = 0.0, above = 0.0;
};

// Titles of the legend of a panel.
std::vector<std::string> titles_of(const Panel& panel) {
  std::vector<std::string> titles;
  const auto add = [&titles](const std::string& title) {
    if (!title.empty()) titles.push_back(title);
  };
  for (const Band& band : panel.bands) add(band.title);
  for (const Curve& curve : panel.curves) add(curve.title);
  for (const Dots& dots : panel.dots) add(dots.title);
  if (!panel.impacts.empty()) add(closing_title);
  if (!panel.contacts.empty()) {
    add(closed_title);
    add(pulse_title);
  }
  return titles;
}

// Number of entries of a legend above a panel that stand side by side.
int entries_across(const Column& column) {
  return std::max(1, static_cast<int>((column.right - column.left) / column.row));
}

double legend_height(const Panel& panel, const Column& column) {
  if (column.row == 0.0) return 0.0;
  const int across = entries_across(column);
  const int rows = (static_cast<int>(titles_of(panel).size()) + across - 1) / across;
  return legend_row * rows + 4.0;
}

int height_of(const Panel& panel) {
  if (panel.contacts.empty()) return panel_height;
  return std::max(least_height, contact_height * static_cast<int>(panel.contacts.size()));
}

// With their legends, if these are above the panels.
double height_of(const Column& column) {
  double height = -between;
  for (const Panel* panel : column.panels) {
    height += height_of(*panel) + legend_height(*panel, column) + between;
  }
  return height;
}

double longest_title(const Figure& figure, bool all) {
  std::size_t longest = all ? 0 : 30;
  for (const Panel& panel : figure.panels) {
    for (const std::string& title : titles_of(panel)) {
      longest = std::max(longest, shown_length(title));
    }
  }
  return static_cast<double>(longest);
}

// Room for the numbers of a y axis: those at multiples of a step that is not longer than
// gnuplot's.
double width_of_numbers(const Panel& panel, Figure::Zoom axis) {
  if (panel.logarithmic || !panel.contacts.empty()) return 5.0 * letter;
  double least = std::numeric_limits<double>::infinity(), most = -least;
  const auto extend = [&](const std::vector<double>& t, const std::vector<double>& y,
                          double sign = 0.0, const std::vector<double>& width = {}) {
    for (std::size_t k = 0; k < t.size(); ++k) {
      const double bar = width.empty() || !std::isfinite(width[k]) ? 0.0 : sign * width[k];
      if (!std::isfinite(y[k]) || t[k] < axis.from || t[k] > axis.to) continue;
      least = std::min(least, y[k] + bar);
      most = std::max(most, y[k] + bar);
    }
  };
  for (const Curve& curve : panel.curves) extend(curve.t, curve.y);
  for (const Band& band : panel.bands) {
    extend(band.t, band.low);
    extend(band.t, band.high);
  }
  for (const Dots& dots : panel.dots) {
    extend(dots.t, dots.y, 2.0, dots.sigma);
    extend(dots.t, dots.y, -2.0, dots.sigma);
  }
  const double size = std::max(std::abs(least), std::abs(most));
  if (!(most - least > 1e-6 * size)) return 12.0 * letter;
  const double step = std::pow(10.0, std::floor(std::log10((most - least) / 5.0)));
  std::size_t longest = 0;
  for (double tick = std::floor(least / step); tick <= std::ceil(most / step); tick += 1.0) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", tick * step);
    longest = std::max(longest, std::string_view(text).size());
  }
  return letter * static_cast<double>(longest);
}

double margin_of(const Column& column) {
  double margin = least_left;
  for (const Panel* panel : column.panels) {
    margin = std::max(margin, of_title + width_of_numbers(*panel, column.axis) + of_ticks);
  }
  return margin;
}

Layout layout_of(const Figure& figure, const PictureForm& form) {
  Layout layout;
  std::vector<Column>& columns = layout.columns;
  columns.push_back({{}, {figure.from, figure.to}});
  if (figure.zoom) columns.push_back({{}, *figure.zoom});
  for (const Panel& panel : figure.panels) {
    (panel.whole_run ? columns.front() : columns.back()).panels.push_back(&panel);
  }
  std::erase_if(columns, [](const Column& column) { return column.panels.empty(); });
  const double across = columns.size() == 1 ? form.across : form.across_of_two;
  const double legend = longest_title(figure, form.legend_above) * letter + room_of_sample;
  double tallest = form.legend_above ? 0.0 : least_picture;
  for (Column& column : columns) {
    column.margin = margin_of(column);
    column.left = layout.width + column.margin;
    column.right = column.left + across;
    layout.width = column.right + (form.legend_above ? to_the_right : legend);
    if (form.legend_above) column.row = std::min(legend, across);
    tallest = std::max(tallest, height_of(column));
  }
  layout.above = figure.title.empty() ? above_without_title : above;
  layout.height = layout.above + tallest + below;
  return layout;
}

// The data of one panel within an interval of time, as parts of a plot command.
class PanelData {
 public:
  PanelData(Figure::Zoom axis, int pixels, Script& script)
      : axis_(axis), pixels_(pixels), script_(&script) {}

  void add(const Band& band) {
    const BandPoints points = thinned(band.t, band.low, band.high, axis_.from, axis_.to, pixels_);
    if (!reaches(points.t, axis_)) return;
    extend_range(points.t, points.low);
    extend_range(points.t, points.high);
    add({points.t, points.low, points.high},
        "1:2:3 with filledcurves fs transparent solid 0.25 noborder fc rgb " + rgb(band.colour),
        band.title);
  }

  void add(const Curve& curve, bool logarithmic) {
    std::vector<double> y = curve.y;
    // A logarithmic axis cannot show these values.
    if (logarithmic) {
      for (double& value : y) value = value > 0.0 ? value : std::nan("");
    }
    const Points points = thinned(curve.t, y, axis_.from, axis_.to, pixels_);
    const bool known = std::any_of(points.y.begin(), points.y.end(),
                                   [](double value) { return std::isfinite(value); });
    if (!known || !reaches(points.t, axis_)) return;
    extend_range(points.t, points.y);
    add({points.t, points.y},
        "1:2 with lines " + style(curve.line) + " lc rgb " + rgb(curve.colour), curve.title);
  }

  void add(const Dots& dots) {
    constexpr std::array shapes{7, 5, 9, 11, 13, 6, 4, 8};
    std::vector<double> t, y, bar;
    for (std::size_t k = 0; k < dots.t.size(); ++k) {
      if (!contains(dots.t[k])) continue;
      t.push_back(dots.t[k]);
      y.push_back(dots.y[k]);
      bar.push_back(std::isfinite(dots.sigma[k]) ? 2.0 * dots.sigma[k] : 0.0);
    }
    if (t.empty()) return;
    has_dots_ = true;
    const int shape = shapes[static_cast<std::size_t>(dots.shape) % shapes.size()];
    add({t, y, bar},
        "1:2:3 with yerrorbars pt " + std::to_string(shape) + " ps 0.7 lc rgb " + rgb(dots.colour),
        dots.title);
  }

  void add_impacts(const std::vector<double>& times) {
    std::vector<double> impacts;
    for (const double t : times) {
      if (contains(t)) impacts.push_back(t);
    }
    if (impacts.empty()) return;
    has_dots_ = true;
    add({impacts, std::vector<double>(impacts.size(), 0.0)},
        "1:2 with points pt 7 ps 0.6 lc rgb '#303030'", closing_title);
  }

  // A row for each contact.
  template <typename Contacts>
  void add_contacts(const Contacts& contacts) {
    std::vector<double> pulse_t, pulse_row, from, to, row;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const auto height = static_cast<double>(i + 1);
      for (const double t : contacts[i].pulses) {
        if (!contains(t)) continue;
        pulse_t.push_back(t);
        pulse_row.push_back(height);
      }
      for (const auto& [begin, end] : contacts[i].closed) {
        if (end < axis_.from || begin > axis_.to) continue;
        from.push_back(std::max(begin, axis_.from));
        to.push_back(std::min(end, axis_.to));
        row.push_back(height);
      }
    }
    if (!from.empty()) {
      add({from, row, to}, "1:2:($3-$1):(0) with vectors nohead lw 6 lc rgb '#7F7F7F'",
          closed_title);
    }
    if (!pulse_t.empty()) {
      add({pulse_t, pulse_row}, "1:($2-0.35):(0):(0.7) with vectors nohead lw 1.2 lc rgb '#303030'",
          pulse_title);
    }
  }

  const std::vector<std::string>& parts() const { return parts_; }

  // Range of a constant curve, which has none of its own; else the range of all data.
  std::string y_range(bool logarithmic) const {
    if (logarithmic || least_ != greatest_ || has_dots_) return "[*:*]";
    const double around = least_ == 0.0 ? 1.0 : 0.1 * std::abs(least_);
    return "[" + number(least_ - around) + ":" + number(least_ + around) + "]";
  }

 private:
  bool contains(double t) const { return axis_.from <= t && t <= axis_.to; }

  void add(const std::vector<std::vector<double>>& columns, const std::string& how,
           const std::string& title) {
    parts_.push_back(script_->data(columns) + " using " + how +
                     (title.empty() ? " notitle" : " title " + quoted(title)));
  }

  void extend_range(const std::vector<double>& t, const std::vector<double>& y) {
    for (std::size_t k = 0; k < t.size(); ++k) {
      if (!std::isfinite(y[k]) || !contains(t[k])) continue;
      least_ = std::min(least_, y[k]);
      greatest_ = std::max(greatest_, y[k]);
    }
  }

  Figure::Zoom axis_;
  int pixels_;
  Script* script_;
  std::vector<std::string> parts_;
  double least_ = std::numeric_limits<double>::infinity(), greatest_ = -least_;
  bool has_dots_ = false;
};

// `place` is that of the panel without a legend above it.
void draw(const Panel& panel, const Place& place, const Column& column, Script& script) {
  const Figure::Zoom axis = column.axis;
  const bool lowest = &panel == column.panels.back();
  PanelData data(axis, static_cast<int>(place.right - place.left), script);
  for (const Band& band : panel.bands) data.add(band);
  for (const Curve& curve : panel.curves) data.add(curve, panel.logarithmic);
  for (const Dots& dots : panel.dots) data.add(dots);
  data.add_impacts(panel.impacts);
  data.add_contacts(panel.contacts);

  script.panel(place, panel.y_label, place.left - column.margin + title_at);
  if (column.row > 0.0) {
    script.line("set key at " +
                script.screen(place.left, place.top - legend_height(panel, column)) +
                " left top horizontal Left reverse noenhanced samplen 2.2 spacing 1.15 width 0 "
                "maxcols " +
                std::to_string(entries_across(column)));
  }
  script.line("set xrange [" + number(axis.from) + ":" + number(axis.to) + "]");
  script.line(lowest ? "set xlabel 'time t [s]'" : "unset xlabel");
  script.line(lowest ? "set format x '%g'" : "set format x ''");
  script.line(panel.logarithmic ? "set logscale y" : "unset logscale y");
  script.line(panel.logarithmic ? "set format y '10^{%T}'" : "set format y '%g'");
  if (panel.contacts.empty()) {
    const std::string reach = number(panel.reach);
    script.line("set yrange " + (panel.reach > 0.0 ? "[*<-" + reach + ":" + reach + "<*]"
                                                   : data.y_range(panel.logarithmic)));
    script.line("set ytics autofreq");
  } else {
    script.line("set yrange [0.4:" + number(static_cast<double>(panel.contacts.size()) + 0.6) +
                "]");
    script.line("set ytics 1");
  }
  if (data.parts().empty()) {
    // An empty frame: there is no data in this interval.
    script.line("unset logscale y");
    script.line("plot [][0:1] -1 notitle");
  } else {
    script.plot(data.parts());
  }
  script.line("unset label 1");
}

// Panels of a column share the height of the picture.
void draw(const Column& column, const Layout& layout, Script& script) {
  const double scale =
      (layout.height - layout.above - below + between) / (height_of(column) + between);
  double y = layout.above;
  for (const Panel* panel : column.panels) {
    const double legend = legend_height(*panel, column);
    const double step = scale * (height_of(*panel) + legend + between);
    draw(*panel, {column.left, column.right, y + legend, y + step - between}, column, script);
    y += step;
  }
}

}  // namespace

std::string gnuplot_script(const Figure& figure, const std::filesystem::path& output,
                           const PictureForm& form) {
  const Layout layout = layout_of(figure, form);
  Script script(output, layout.width, layout.height);
  if (!figure.title.empty()) {
    script.title(figure.title, layout.columns.front().margin, 24.0, 14);
  }
  for (const Column& column : layout.columns) draw(column, layout, script);
  script.line("unset multiplot");
  return std::move(script).text();
}

}  // namespace sprag::plot
