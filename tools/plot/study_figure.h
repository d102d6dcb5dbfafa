// Content of a picture of a study: quantities over the one or two keys that vary, in panels of one
// kind each.
//
//   points  one key: every point of the stroboscope, a bifurcation diagram
//   bands   one key: median and 5 to 95 % of the runs, one colour for each estimator
//   map     two keys: the median of the runs as a colour
//   labels  two keys: the attractor that each start leads to, basins of attraction
#pragma once

#include <string>
#include <vector>

#include "tools/plot/figure.h"
#include "tools/plot/study_table.h"

namespace sprag::plot {

struct Axis {
  std::string name;
  bool logarithmic = false;
  std::vector<double> values;  ///< occurring values, ascending, finite
};

struct StudyPanel {
  enum class Kind { points, bands, map, labels };
  Kind kind = Kind::points;
  std::string name;
  bool logarithmic = false;  ///< scale of the quantity, as height or colour
  std::vector<Band> bands;   ///< t is the key
  std::vector<Curve> curves;
  std::vector<double> x, y, z;      ///< points: x, y; map and labels: x, y and quantity or label
  double least = 0.0, most = 0.0;   ///< map: range of the colours, the same for all estimators
  std::vector<std::string> titles;  ///< of the labels 0, 1, ...
};

struct StudyFigure {
  std::string title;
  std::vector<Axis> axes;  ///< one, or two
  std::vector<StudyPanel> panels;
};

struct StudyOptions {
  std::string title;               ///< empty: the study's name
  std::vector<std::string> show;   ///< quantities; empty: a default by the kind of study
  std::vector<std::string> over;   ///< one or two keys; empty: those that the study varies
  std::vector<std::string> where;  ///< KEY=VALUE: only rows with the value of KEY nearest to VALUE
};

/// Throws InputError if there is nothing to show; std::invalid_argument, with the available names,
/// for an option that does not match the table.
StudyFigure make_study_figure(const StudyTable& table, const StudyOptions& options);

/// gnuplot's script; see gnuplot_script().
std::string study_script(const StudyFigure& figure, const std::filesystem::path& output);

}  // namespace sprag::plot
