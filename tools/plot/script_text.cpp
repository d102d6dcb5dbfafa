#include "tools/plot/script_text.h"

#include <sys/wait.h>

#include <cstdio>
#include <stdexcept>

#include "sprag/files/csv.h"

namespace sprag::plot {

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
