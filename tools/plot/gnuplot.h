// Draws a figure with gnuplot: panels below each other, the whole-run panels to the left of a zoom,
// and each legend to the right of its panel. Curves are thinned to the resolution of the picture:
// the first, least, greatest and last value of every pixel.
#pragma once

#include <filesystem>
#include <string>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// gnuplot's script for a .png, .svg or .pdf file, including the data. Throws std::invalid_argument
/// for another extension.
std::string gnuplot_script(const Figure& figure, const std::filesystem::path& output);

}  // namespace sprag::plot
