// Parts of gnuplot's scripts that all pictures have in common, and who runs them.
#pragma once

#include <filesystem>
#include <string>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// '#rrggbb', in quotes.
std::string rgb(Colour colour);
std::string quoted(const std::string& text);
std::string number(double value);

/// The terminal for a .png, .svg or .pdf file, sizes in pixels. Throws std::invalid_argument for
/// another extension.
std::string terminal(const std::filesystem::path& output, double width, double height);

/// Runs a script. Throws std::runtime_error: gnuplot is not there or fails.
void run_gnuplot(const std::string& script);

}  // namespace sprag::plot
