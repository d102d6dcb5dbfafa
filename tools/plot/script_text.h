// gnuplot's scripts: what those of all pictures have in common, and how gnuplot runs them. Names
// come from files and command lines. They reach gnuplot through quoted() alone; file names never
// do: curves are blocks of numbers in the script, and the picture comes back through a socket.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tools/plot/figure.h"

namespace sprag::plot {

/// The one of an estimator, by its name, in all pictures; black: of none.
Colour colour_of(std::string_view estimator);
/// '#rrggbb', in quotes.
std::string rgb(Colour colour);
/// `text` as a picture shows it: printable() and cut after 200 characters, and without what
/// gnuplot's SVG passes on as markup, "&#" and "]]>".
std::string legible(const std::string& text);
/// legible() as a string of gnuplot's, in double quotes. Four characters are special there, and
/// escaped: the quote, the backslash, ` of a command and @ of a macro. In single quotes gnuplot 5.4
/// takes '' for a quote only between other characters, and ends the string elsewhere.
std::string quoted(const std::string& text);
/// Number of characters of legible().
std::size_t shown_length(const std::string& text);
std::string number(double value);

/// The terminal for a .png, .svg or .pdf file, sizes in pixels. Throws std::invalid_argument for
/// another extension.
std::string terminal(const std::filesystem::path& output, double width, double height);

inline constexpr const char* grid = "set grid xtics ytics lt 1 lw 0.8 lc rgb '#d9d9d9'";

/// A plane of curves, in pixels from the left and from above.
struct Place {
  double left, right, top, bottom;
};

/// The script of one picture, as it grows. Places are in pixels from the left and from above.
class Script {
 public:
  /// Terminal for the extension of `output`, and frames, ticks and grid as all pictures have them.
  /// Throws as terminal().
  Script(const std::filesystem::path& output, double width, double height);

  void line(const std::string& of) { text_ += of + '\n'; }

  /// "screen x, screen y", by which gnuplot names a place in the picture.
  std::string screen(double x, double y) const;

  /// Left of the line; gnuplot's label 1.
  void title(const std::string& text, double x, double y, int font);
  void margins(const Place& place);
  /// Margins, the legend to the right, and upward at x what the y axis is; gnuplot's label 2.
  void panel(const Place& place, const std::string& y_label, double x);

  /// A block of data, so that the script is a picture by itself; returns its name. Columns are of
  /// one length; rows with something that is not finite are breaks.
  std::string data(const std::vector<std::vector<double>>& columns);

  void plot(const std::vector<std::string>& parts);

  std::string text() && { return std::move(text_); }

 private:
  std::string text_;
  double width_, height_;
  int blocks_ = 0;
};

/// Runs a script and returns the picture. Throws std::runtime_error: gnuplot is not there or fails.
std::string drawn(const std::string& script);

}  // namespace sprag::plot
