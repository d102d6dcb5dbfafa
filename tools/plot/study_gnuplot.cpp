#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "tools/plot/script_text.h"
#include "tools/plot/study_figure.h"

namespace sprag::plot {
namespace {

// Lengths in pixels of the picture.
constexpr double across = 860.0, to_plane = 96.0, above_title = 46.0, above_nothing = 16.0;
constexpr double below_axis = 58.0, below_plane = 76.0, between_panels = 22.0;
constexpr double of_points = 420.0, of_bands = 260.0, of_map = 480.0;
constexpr double letter_width = 7.4, beside_map = 170.0, beside_points = 30.0;

// Cividis (Nunez, Anderton & Renslow, PLoS ONE 13, 2018): uniform in lightness, so it can be read
// by colour-blind readers and in grey.
constexpr const char* cividis =
    "set palette defined (0 '#00224e', 1 '#123570', 2 '#3b496c', 3 '#575d6d', 4 '#707173', "
    "5 '#8a8678', 6 '#a59c74', 7 '#c3b369', 8 '#e1cc55', 9 '#fee838')";

// Colours of label 0 (no attractor found) and of the other labels. All labels beyond the last share
// its colour.
constexpr std::array<unsigned, 9> label_colours{0xd9d9d9, 0x0072b2, 0xe69f00, 0x009e73, 0xcc79a7,
                                                0x56b4e9, 0xd55e00, 0xf0e442, 0x000000};
constexpr std::size_t labels_named = label_colours.size() - 1;

std::size_t colour_number(double label) {
  return std::min(static_cast<std::size_t>(label), labels_named);
}

double height_of_study(const StudyPanel& panel) {
  switch (panel.kind) {
    case StudyPanel::Kind::points:
      return of_points;
    case StudyPanel::Kind::bands:
      return of_bands;
    default:
      return of_map;
  }
}

bool in_plane(const StudyPanel& panel) {
  return panel.kind == StudyPanel::Kind::map || panel.kind == StudyPanel::Kind::labels;
}

double shown(const Axis& axis, double value) {
  return axis.logarithmic ? std::log10(value) : value;
}

// Boundaries of the cells around values, in the scale of the axis.
struct Cells {
  std::vector<double> centres;
  bool even = true;  ///< all cells have the same width
  double low(std::size_t i) const {
    return i == 0 ? centres[0] - 0.5 * width(0) : 0.5 * (centres[i - 1] + centres[i]);
  }
  double high(std::size_t i) const {
    const std::size_t last = centres.size() - 1;
    return i == last ? centres[last] + 0.5 * width(last - (last > 0 ? 1 : 0))
                     : 0.5 * (centres[i] + centres[i + 1]);
  }
  double width(std::size_t i) const {
    return centres.size() < 2 ? 1.0 : centres[i + 1] - centres[i];
  }
};

Cells cells_of(const Axis& axis) {
  Cells cells;
  for (const double value : axis.values) cells.centres.push_back(shown(axis, value));
  if (cells.centres.size() < 2) return cells;
  const double mean = (cells.centres.back() - cells.centres.front()) /
                      static_cast<double>(cells.centres.size() - 1);
  for (std::size_t i = 0; i + 1 < cells.centres.size(); ++i) {
    cells.even = cells.even && std::abs(cells.width(i) - mean) <= 1e-3 * mean;
  }
  return cells;
}

// A script with the size of the figure.
Script begun(const StudyFigure& figure, double over, const std::filesystem::path& output) {
  double beside = beside_points;
  double height = over + below_axis - between_panels;
  for (const StudyPanel& panel : figure.panels) {
    height += height_of_study(panel) + between_panels;
    if (in_plane(panel)) {
      beside = std::max(beside, beside_map);
      height += &panel == &figure.panels.back() ? 0.0 : below_plane - between_panels;
    }
    std::size_t longest = 0;
    for (const Curve& curve : panel.curves) {
      if (curve.title != panel.name) longest = std::max(longest, shown_length(curve.title));
    }
    for (const Band& band : panel.bands) longest = std::max(longest, shown_length(band.title));
    if (longest > 0) {
      beside = std::max(beside, letter_width * static_cast<double>(longest) + 70.0);
    }
  }
  return {output, to_plane + across + beside, height};
}

class StudyScript {
 public:
  StudyScript(const StudyFigure& figure, const std::filesystem::path& output);
  std::string text() && { return std::move(script_).text(); }

 private:
  void frame(const StudyPanel& panel, const Place& place, bool lowest);
  void range(char axis, double low, double high);
  void range_of_constant(const std::vector<double>& values);
  void ticks(char name, const Axis& axis, bool labels);
  void draw_points(const StudyPanel& panel, const Place& place);
  void draw_bands(const StudyPanel& panel);
  void draw_plane(const StudyPanel& panel);
  std::string plane(const StudyPanel& panel, const Cells& x_cells, const Cells& y_cells);
  void name_labels(const StudyPanel& panel, std::vector<std::string>& parts);
  void draw_colour_scale(const StudyPanel& panel);
  bool on_grid(const StudyPanel& panel) const;

  const StudyFigure& figure_;
  double above_;
  Script script_;
};

StudyScript::StudyScript(const StudyFigure& figure, const std::filesystem::path& output)
    : figure_(figure),
      above_(figure.title.empty() ? above_nothing : above_title),
      script_(begun(figure, above_, output)) {
  script_.line(cividis);
  if (!figure.title.empty()) script_.title(figure.title, to_plane, 24.0, 14);
  double y = above_;
  for (const StudyPanel& panel : figure.panels) {
    const bool lowest = &panel == &figure.panels.back();
    const Place place{to_plane, to_plane + across, y, y + height_of_study(panel)};
    frame(panel, place, lowest || in_plane(panel));
    switch (panel.kind) {
      case StudyPanel::Kind::points:
        draw_points(panel, place);
        break;
      case StudyPanel::Kind::bands:
        draw_bands(panel);
        break;
      default:
        draw_plane(panel);
        break;
    }
    script_.line("unset label 1");
    y = place.bottom + (in_plane(panel) ? below_plane : between_panels);
  }
  script_.line("unset multiplot");
}

void StudyScript::range(char axis, double low, double high) {
  script_.line(std::string("set ") + axis + "range [" + number(low) + ":" + number(high) + "]");
}

// Sets a range for constant values, which have none of their own.
void StudyScript::range_of_constant(const std::vector<double>& values) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  if (!(least >= most)) return;
  const double around = least == 0.0 || !std::isfinite(least) ? 1.0 : 0.1 * std::abs(least);
  const double middle = std::isfinite(least) ? least : 0.0;
  range('y', middle - around, middle + around);
}

// Ticks at decades of a logarithmic axis, which is drawn in logarithms since images require it.
void StudyScript::ticks(char name, const Axis& axis, bool labels) {
  const std::string which = std::string(1, name) + "tics";
  if (!axis.logarithmic) {
    script_.line("set " + which + " autofreq");
    script_.line(std::string("set format ") + name + (labels ? " '%g'" : " ''"));
    return;
  }
  const int first = static_cast<int>(std::floor(std::log10(axis.values.front())));
  const int last = static_cast<int>(std::ceil(std::log10(axis.values.back())));
  std::string list;
  for (int decade = first; decade <= last; ++decade) {
    list += (list.empty() ? "" : ", ") +
            std::string(labels ? "'10^{" + std::to_string(decade) + "}' " : "'' ") +
            std::to_string(decade);
  }
  script_.line("set " + which + " (" + list + ")");
}

void StudyScript::frame(const StudyPanel& panel, const Place& place, bool lowest) {
  const Axis& x = figure_.axes.front();
  script_.line(lowest ? "set xlabel " + quoted(x.name) + " noenhanced" : "unset xlabel");
  const Cells cells = cells_of(x);
  const bool plane = in_plane(panel);
  const double least = plane ? cells.low(0) : cells.centres.front();
  const double most = plane ? cells.high(cells.centres.size() - 1) : cells.centres.back();
  range('x', least, most > least ? most : least + 1.0);
  ticks('x', x, lowest);
  script_.panel(place, plane ? figure_.axes.back().name : panel.name, 16.0);
  script_.line(plane ? "unset grid" : grid);
  script_.line(!plane && panel.logarithmic ? "set logscale y" : "unset logscale y");
  script_.line("set ytics autofreq");
  script_.line(!plane && panel.logarithmic ? "set format y '10^{%T}'" : "set format y '%g'");
  script_.line("set yrange [*:*]");
  script_.line("unset logscale cb");
}

// Draws at most one point per half pixel.
void StudyScript::draw_points(const StudyPanel& panel, const Place& place) {
  const Axis& axis = figure_.axes.front();
  const auto [least, most] = std::minmax_element(panel.y.begin(), panel.y.end());
  const double rows = place.bottom - place.top;
  const double height = *most > *least ? *most - *least : 1.0;
  const double first = shown(axis, axis.values.front());
  const double last = shown(axis, axis.values.back());
  const double length = last > first ? last - first : 1.0;
  range_of_constant(panel.y);
  std::set<std::pair<long, long>> taken;
  std::vector<double> x, y;
  for (std::size_t i = 0; i < panel.x.size(); ++i) {
    const double at = shown(axis, panel.x[i]);
    // Half a pixel, since dots are drawn between pixels.
    const std::pair pixel{std::lround((at - first) / length * 2.0 * across),
                          std::lround((panel.y[i] - *least) / height * 2.0 * rows)};
    if (!taken.insert(pixel).second) continue;
    x.push_back(at);
    y.push_back(panel.y[i]);
  }
  script_.plot({script_.data({x, y}) + " using 1:2 with points pt 7 ps 0.16 lc rgb " +
                rgb(Colour::black) + " notitle"});
}

void StudyScript::draw_bands(const StudyPanel& panel) {
  const Axis& axis = figure_.axes.front();
  std::vector<std::string> parts;
  const auto of_axis = [&](std::vector<double> t) {
    for (double& value : t) value = shown(axis, value);
    return t;
  };
  const auto positive = [&](std::vector<double> y) {
    if (!panel.logarithmic) return y;
    for (double& value : y) value = value > 0.0 ? value : std::nan("");
    return y;
  };
  bool negative = false, others = false;
  std::vector<double> heights;
  for (const Curve& curve : panel.curves) {
    for (const double y : curve.y) (y < 0.0 ? negative : others) = true;
    heights.insert(heights.end(), curve.y.begin(), curve.y.end());
  }
  for (const Band& band : panel.bands) {
    heights.insert(heights.end(), band.low.begin(), band.low.end());
    heights.insert(heights.end(), band.high.begin(), band.high.end());
  }
  range_of_constant(heights);
  for (const Band& band : panel.bands) {
    parts.push_back(script_.data({of_axis(band.t), positive(band.low), positive(band.high)}) +
                    " using 1:2:3 with filledcurves fs transparent solid 0.25 noborder fc rgb " +
                    rgb(band.colour) + " title " + quoted(band.title));
  }
  for (const Curve& curve : panel.curves) {
    // A single curve with the name of its panel needs no legend.
    const bool has_title = curve.title != panel.name;
    parts.push_back(script_.data({of_axis(curve.t), positive(curve.y)}) +
                    " using 1:2 with linespoints pt 7 ps 0.3 lw 1.4 lc rgb " + rgb(curve.colour) +
                    (has_title ? " title " + quoted(curve.title) : " notitle"));
  }
  // The sign distinguishes stable from unstable, so the zero line is drawn.
  if (negative && others) parts.emplace_back("0 with lines lw 1 lc rgb '#404040' notitle");
  script_.plot(parts);
}

// Whether at least half of all pairs of values occur, as in a grid but not with random starts.
bool StudyScript::on_grid(const StudyPanel& panel) const {
  return panel.x.size() <= figure_.axes[0].values.size() * figure_.axes[1].values.size() &&
         2 * panel.x.size() >= figure_.axes[0].values.size() * figure_.axes[1].values.size();
}

// Part of a plot command: the values of a plane as an image, as boxes if the axes are uneven, or as
// points if they are on no grid.
std::string StudyScript::plane(const StudyPanel& panel, const Cells& x_cells,
                               const Cells& y_cells) {
  const bool labels = panel.kind == StudyPanel::Kind::labels;
  std::vector<double> x, y, z, red, green, blue, packed;
  std::vector<double> x_low, x_high, y_low, y_high;
  const auto place = [](const std::vector<double>& values, double value) {
    return static_cast<std::size_t>(std::lower_bound(values.begin(), values.end(), value) -
                                    values.begin());
  };
  // Cells overlap slightly; otherwise the background would show between them.
  const auto overlap = [](const Cells& cells, double pixels) {
    return (cells.high(cells.centres.size() - 1) - cells.low(0)) / pixels;
  };
  const double x_overlap = overlap(x_cells, across);
  const double y_overlap = overlap(y_cells, of_map);
  for (std::size_t i = 0; i < panel.x.size(); ++i) {
    if (!std::isfinite(panel.z[i])) continue;
    if (!labels && panel.logarithmic && !(panel.z[i] > 0.0)) continue;
    const std::size_t column = place(figure_.axes[0].values, panel.x[i]);
    const std::size_t row = place(figure_.axes[1].values, panel.y[i]);
    x.push_back(x_cells.centres[column]);
    y.push_back(y_cells.centres[row]);
    x_low.push_back(x_cells.low(column));
    x_high.push_back(x_cells.high(column) + x_overlap);
    y_low.push_back(y_cells.low(row));
    y_high.push_back(y_cells.high(row) + y_overlap);
    z.push_back(panel.z[i]);
    if (!labels) continue;
    const unsigned colour = label_colours[colour_number(panel.z[i])];
    packed.push_back(colour);
    red.push_back(colour >> 16);
    green.push_back((colour >> 8) & 0xff);
    blue.push_back(colour & 0xff);
  }
  // gnuplot's images need at least 2 x 2 values.
  const bool image =
      x_cells.even && y_cells.even && x_cells.centres.size() > 1 && y_cells.centres.size() > 1;
  const std::string colour = labels ? "rgb variable" : "palette";
  if (x.empty()) return "NaN notitle";
  if (!on_grid(panel)) {
    return script_.data({x, y, labels ? packed : z}) + " using 1:2:3 with points pt 7 ps 0.5 lc " +
           colour + " notitle";
  }
  if (image && labels) {
    return script_.data({x, y, red, green, blue}) + " using 1:2:3:4:5 with rgbimage notitle";
  }
  if (image) return script_.data({x, y, z}) + " using 1:2:3 with image notitle";
  return script_.data({x, y, x_low, x_high, y_low, y_high, labels ? packed : z}) +
         " using 1:2:3:4:5:6:7 with boxxyerror fs solid noborder fc " + colour + " notitle";
}

// Adds the labels that occur to the key of the plot.
void StudyScript::name_labels(const StudyPanel& panel, std::vector<std::string>& parts) {
  for (std::size_t label = 0; label < std::min(panel.titles.size(), labels_named + 1); ++label) {
    const bool occurs = std::any_of(panel.z.begin(), panel.z.end(),
                                    [&](double of) { return colour_number(of) == label; });
    if (!occurs) continue;
    const bool others = label == labels_named && panel.titles.size() > labels_named + 1;
    char colour[16];
    std::snprintf(colour, sizeof colour, "'#%06x'", label_colours[label]);
    parts.push_back(std::string("NaN with points pt 5 ps 1.6 lc rgb ") + colour + " title " +
                    quoted(others ? std::to_string(label) + " and on" : panel.titles[label]));
  }
}

void StudyScript::draw_colour_scale(const StudyPanel& panel) {
  if (panel.logarithmic) script_.line("set logscale cb");
  script_.line(panel.logarithmic ? "set format cb '10^{%T}'" : "set format cb '%g'");
  script_.line(panel.most > panel.least
                   ? "set cbrange [" + number(panel.least) + ":" + number(panel.most) + "]"
                   : std::string("set cbrange [*:*]"));
  script_.line("set cblabel " + quoted(panel.name) + " noenhanced offset 1");
  script_.line("set colorbox");
}

void StudyScript::draw_plane(const StudyPanel& panel) {
  const Cells x_cells = cells_of(figure_.axes[0]);
  const Cells y_cells = cells_of(figure_.axes[1]);
  range('y', y_cells.low(0), y_cells.high(y_cells.centres.size() - 1));
  ticks('y', figure_.axes[1], true);
  std::vector<std::string> parts{plane(panel, x_cells, y_cells)};
  if (panel.kind == StudyPanel::Kind::labels) {
    script_.line("unset colorbox");
    name_labels(panel, parts);
  } else {
    draw_colour_scale(panel);
  }
  script_.plot(parts);
}

}  // namespace

std::string study_script(const StudyFigure& figure, const std::filesystem::path& output) {
  return StudyScript(figure, output).text();
}

}  // namespace sprag::plot
