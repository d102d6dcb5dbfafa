// Content of a picture of runs, independent of how it is drawn: panels on one time axis with
// curves, bands of two sigma and marks of contacts. A colour has the same meaning in all panels.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/scene.h"
#include "tools/plot/table.h"

namespace sprag::plot {

/// Colours of Okabe and Ito, which colour-blind readers can distinguish.
enum class Colour { black, vermilion, purple, sky, blue, green, orange, grey };

enum class Line { thick, solid, thin, dashed, dotted };

struct Curve {
  std::string title;  ///< empty: not in the legend
  Colour colour = Colour::black;
  Line line = Line::solid;
  std::vector<double> t, y;  ///< NaN in y: a break
};

struct Band {
  std::string title;
  Colour colour = Colour::black;
  std::vector<double> t, low, high;
};

/// Values at single instants, with bars of two sigma where sigma is known.
struct Dots {
  std::string title;
  Colour colour = Colour::black;
  int shape = 0;  ///< number of the contact, from 0
  std::vector<double> t, y, sigma;
};

struct Panel {
  std::string name;  ///< as in --show
  std::string y_label;
  bool logarithmic = false;
  double reach = 0.0;      ///< the y axis extends to at least +- this; 0: as far as the data
  bool whole_run = false;  ///< shows the whole run even if the others are zoomed in
  std::vector<Band> bands;
  std::vector<Curve> curves;
  std::vector<Dots> dots;
  std::vector<double> impacts;  ///< times, marked at gap zero
  /// Contacts over time, one row for each, from below. Only the panel of contacts has them.
  struct Contacts {
    std::vector<double> pulses;
    std::vector<std::pair<double, double>> closed;  ///< from, to
  };
  std::vector<Contacts> contacts;
};

struct Figure {
  std::string title;
  std::vector<Panel> panels;
  double from = 0.0, to = 0.0;  ///< time axis
  struct Zoom {
    double from = 0.0, to = 0.0;
  };
  std::optional<Zoom> zoom;  ///< of all panels except those of the whole run
};

struct FigureOptions {
  std::string title;              ///< empty: the scene's name
  std::vector<std::string> show;  ///< names of panels, in this order; empty: as many as fit
  double from = -std::numeric_limits<double>::infinity();
  double to = std::numeric_limits<double>::infinity();
  std::optional<Figure::Zoom> zoom;
};

/// Sets y_label to "quantity [unit]", where the unit has the prefix m, µ, n or p and all values are
/// converted to it if the largest one is below 0.1 of the next larger unit. `unit` without a
/// prefix.
void set_readable_unit(Panel& panel, const std::string& quantity, const std::string& unit);

/// Makes the picture of these tables. `scene` converts states to gaps; null: coordinates are shown.
/// Panels beyond the legible number are omitted, and their names are added to `left_out`. Throws
/// InputError if there is nothing to show or states do not match the scene; std::invalid_argument,
/// with the names of all panels, for an unknown name in `show`.
Figure make_figure(const std::vector<Table>& tables, const Scene* scene,
                   const FigureOptions& options, std::vector<std::string>& left_out);

}  // namespace sprag::plot
