// Draws a figure with gnuplot: panels below each other, those of a whole run to the left where the
// others are zoomed in, every legend to the right of its panel. Curves are thinned to what a
// picture shows: the first, least, greatest and last value of every pixel.
#pragma once

#include <filesystem>
#include <string>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// gnuplot's script for a .png, .svg or .pdf file, data included. Throws std::invalid_argument for
/// another extension.
std::string gnuplot_script(const Figure& figure, const std::filesystem::path& output);

}  // namespace sprag::plot
