// Common parts of gnuplot scripts, and running gnuplot. Names come from files and command lines and
// reach gnuplot only through quoted(). File names never reach it: data are blocks in the script,
// and the picture is returned through a socket.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// The colour of an estimator in all pictures; black for any other name.
Colour colour_of(std::string_view estimator);
/// '#rrggbb', in quotes.
std::string rgb(Colour colour);
/// `text` for a picture: printable(), cut after 200 characters, and without "&#" and "]]>", which
/// gnuplot's SVG terminal would pass on as markup.
std::string legible(const std::string& text);
/// legible() as a gnuplot string in double quotes. Four characters are special there and escaped:
/// the quote, the backslash, ` (command) and @ (macro). Single quotes are not safe: gnuplot 5.4
/// reads '' as a quote only between other characters, and as the end of the string elsewhere.
std::string quoted(const std::string& text);
/// Number of characters of legible().
std::size_t shown_length(const std::string& text);
std::string number(double value);

/// The terminal for a .png, .svg or .pdf file, sizes in pixels. Throws std::invalid_argument for
/// another extension.
std::string terminal(const std::filesystem::path& output, double width, double height);

inline constexpr const char* grid = "set grid xtics ytics lt 1 lw 0.8 lc rgb '#d9d9d9'";

/// The area of a plot, in pixels from the left and from the top.
struct Place {
  double left, right, top, bottom;
};

/// The script of one picture. Positions are in pixels from the left and from the top.
class Script {
 public:
  /// Sets the terminal for the extension of `output`, and frames, ticks and grid. Throws as
  /// terminal().
  Script(const std::filesystem::path& output, double width, double height);

  void line(const std::string& of) { text_ += of + '\n'; }

  /// "screen x, screen y", gnuplot's notation of a position in the picture.
  std::string screen(double x, double y) const;

  /// Puts the title at (x, y), left-aligned; uses gnuplot's label 1.
  void title(const std::string& text, double x, double y, int font);
  void margins(const Place& place);
  /// Sets the margins, the legend to the right, and a vertical label of the y axis at x; uses
  /// gnuplot's label 2.
  void panel(const Place& place, const std::string& y_label, double x);

  /// Adds a block of data, so that the script is self-contained; returns its name. Columns have
  /// equal length; a row with a value that is not finite is a break.
  std::string data(const std::vector<std::vector<double>>& columns);

  void plot(const std::vector<std::string>& parts);

  std::string text() && { return std::move(text_); }

 private:
  std::string text_;
  double width_, height_;
  int blocks_ = 0;
};

/// Runs a script and returns the picture. Throws std::runtime_error if gnuplot is missing or fails.
std::string drawn(const std::string& script);

}  // namespace sprag::plot
