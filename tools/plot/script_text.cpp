#include "tools/plot/script_text.h"

#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "sprag/files/csv.h"

namespace sprag::plot {

Colour colour_of(std::string_view estimator) {
  if (estimator == "replica") return Colour::vermilion;
  if (estimator == "timing") return Colour::purple;
  if (estimator == "both") return Colour::blue;
  if (estimator == "adaptive") return Colour::green;
  return Colour::black;
}

std::string rgb(Colour colour) {
  switch (colour) {
    case Colour::black:
      return "'#000000'";
    case Colour::vermilion:
      return "'#D55E00'";
    case Colour::purple:
      return "'#CC79A7'";
    case Colour::sky:
      return "'#56B4E9'";
    case Colour::blue:
      return "'#0072B2'";
    case Colour::green:
      return "'#009E73'";
    case Colour::orange:
      return "'#E69F00'";
    case Colour::grey:
      return "'#7F7F7F'";
  }
  return {};
}

std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? "''" : std::string(1, c);
  return result + "'";
}

std::string number(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

std::string terminal(const std::filesystem::path& output, double width, double height) {
  const std::string extension = output.extension().string();
  const std::string size = number(width) + "," + number(height);
  const std::string font = " enhanced font 'DejaVu Sans,11' background '#ffffff'";
  if (extension == ".png") return "pngcairo size " + size + font;
  if (extension == ".svg") return "svg size " + size + font;
  // Inches; 96 pixels in each.
  if (extension == ".pdf") {
    return "pdfcairo size " + number(width / 96.0) + "in," + number(height / 96.0) + "in" + font;
  }
  throw std::invalid_argument(output.string() + " is not allowed; must end in .png, .svg or .pdf");
}

Script::Script(const std::filesystem::path& output, double width, double height)
    : width_(width), height_(height) {
  line("set terminal " + terminal(output, width, height));
  line("set output " + quoted(output.string()));
  line("set encoding utf8");
  line("set border 3 lw 1 lc rgb '#404040'");
  line("set tics nomirror out scale 0.6 textcolor rgb '#202020'");
  line(grid);
  line("set multiplot");
}

std::string Script::screen(double x, double y) const {
  return "screen " + number(x / width_) + ", screen " + number(1.0 - y / height_);
}

void Script::title(const std::string& text, double x, double y, int font) {
  line("set label 1 " + quoted(text) + " at " + screen(x, y) + " left noenhanced font '," +
       std::to_string(font) + "'");
}

void Script::margins(const Place& place) {
  line("set lmargin at screen " + number(place.left / width_));
  line("set rmargin at screen " + number(place.right / width_));
  line("set tmargin at screen " + number(1.0 - place.top / height_));
  line("set bmargin at screen " + number(1.0 - place.bottom / height_));
}

void Script::panel(const Place& place, const std::string& y_label, double x) {
  margins(place);
  line("set key at " + screen(place.right + 12.0, place.top) +
       " left top vertical Left reverse noenhanced samplen 2.2 spacing 1.15 width 0");
  // At one place whatever the numbers beside it are; a ylabel would move, even out of the picture.
  line("set label 2 " + quoted(y_label) + " at " + screen(x, (place.top + place.bottom) / 2.0) +
       " center rotate by 90 noenhanced");
}

std::string Script::data(const std::vector<std::vector<double>>& columns) {
  std::string name = "$d" + std::to_string(++blocks_);
  line(name + " << EOD");
  for (std::size_t i = 0; i < columns.front().size(); ++i) {
    const bool there = std::all_of(columns.begin(), columns.end(),
                                   [&](const auto& column) { return std::isfinite(column[i]); });
    // An empty line is a break.
    if (there) {
      for (const auto& column : columns) {
        append_number(text_, column[i]);
        text_ += ' ';
      }
    }
    text_ += '\n';
  }
  line("EOD");
  return name;
}

void Script::plot(const std::vector<std::string>& parts) {
  text_ += "plot ";
  for (std::size_t i = 0; i < parts.size(); ++i) text_ += (i > 0 ? ", \\\n  " : "") + parts[i];
  text_ += '\n';
}

void run_gnuplot(const std::string& script) {
  std::FILE* pipe = popen("gnuplot", "w");
  if (pipe == nullptr) throw std::runtime_error("gnuplot cannot be started");
  const bool written = std::fwrite(script.data(), 1, script.size(), pipe) == script.size();
  const int status = pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127) {
    throw std::runtime_error("gnuplot is not there (Debian's package gnuplot-nox)");
  }
  if (!written || status != 0) throw std::runtime_error("gnuplot has failed");
}

}  // namespace sprag::plot
