// Draws a figure with gnuplot: panels below each other, the whole-run panels to the left of a zoom,
// and each legend to the right of its panel or above it. Curves are thinned to the resolution of
// the picture: the first, least, greatest and last value of every pixel.
#pragma once

#include <filesystem>
#include <string>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// Size of a picture in pixels, and where its legends are.
struct PictureForm {
  int across = 1000;          ///< width of the panels
  int across_of_two = 620;    ///< width of each of two columns, with a zoom
  bool legend_above = false;  ///< above each panel, for narrow pictures; else to the right
};

/// gnuplot's script for a .png, .svg or .pdf file, including the data. Throws std::invalid_argument
/// for another extension.
std::string gnuplot_script(const Figure& figure, const std::filesystem::path& output,
                           const PictureForm& form = {});

}  // namespace sprag::plot
