// What a picture of runs shows, apart from how it is drawn: panels on one time axis, each with
// curves, bands of two sigma and marks of contacts. One colour has one meaning in all panels.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/scene.h"
#include "tools/plot/table.h"

namespace sprag::plot {

/// Colours of Okabe and Ito, which colour-blind readers tell apart.
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

/// Values of single instants, with bars of two sigma where these are known.
struct Dots {
  std::string title;
  Colour colour = Colour::black;
  int shape = 0;  ///< one for each contact, from 0
  std::vector<double> t, y, sigma;
};

struct Panel {
  std::string name;  ///< as --show has it
  std::string y_label;
  bool logarithmic = false;
  bool whole_run = false;  ///< stays whole where the others are zoomed in
  std::vector<Band> bands;
  std::vector<Curve> curves;
  std::vector<Dots> dots;
  std::vector<double> impacts;  ///< times, marked where the gap is zero
  /// Contacts over time, one row for each from below; of no other panel.
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
  std::optional<Zoom> zoom;  ///< of all panels but those of a whole run
};

struct FigureOptions {
  std::string title;              ///< empty: the scene's name
  std::vector<std::string> show;  ///< names of panels, in this order; empty: as many as fit
  double from = -std::numeric_limits<double>::infinity();
  double to = std::numeric_limits<double>::infinity();
  std::optional<Figure::Zoom> zoom;
};

/// The picture of these tables; `scene` makes gaps of states, null: coordinates are shown. Names of
/// panels that were left out, since more would not be legible, go to `left_out`. Throws InputError:
/// nothing to show, states that do not fit the scene; std::invalid_argument: a name in `show` that
/// is no panel's, with those that there are.
Figure make_figure(const std::vector<Table>& tables, const Scene* scene,
                   const FigureOptions& options, std::vector<std::string>& left_out);

}  // namespace sprag::plot
