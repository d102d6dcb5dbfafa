#include "tools/plot/script_text.h"

#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <stdexcept>
#include <system_error>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/text/printable.h"

namespace sprag::plot {
namespace {

constexpr std::size_t most_characters = 200;

bool begins_character(char byte) { return (static_cast<unsigned char>(byte) & 0xc0U) != 0x80U; }

[[noreturn]] void fail(const std::string& what, int error) {
  throw std::runtime_error(what + ": " + std::generic_category().message(error));
}

// One end of a socket pair.
class Socket {
 public:
  explicit Socket(int descriptor) : descriptor_(descriptor) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { close(); }

  int operator*() const { return descriptor_; }
  void close() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }

 private:
  int descriptor_;
};

// Starts gnuplot without a shell and without the user's settings.
pid_t start_gnuplot(const Socket& end) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, *end, STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, *end, STDOUT_FILENO);
  std::string program = "gnuplot", default_settings = "-d";
  const std::array<char*, 3> arguments{program.data(), default_settings.data(), nullptr};
  pid_t id = -1;
  const int error =
      ::posix_spawnp(&id, program.c_str(), &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    throw std::runtime_error(
        "gnuplot is not installed, so that no picture can be drawn; install Debian's package "
        "gnuplot-nox");
  }
  if (error != 0) fail("gnuplot cannot be started", error);
  return id;
}

bool is_passing(int error) { return error == EINTR || error == EAGAIN || error == EWOULDBLOCK; }

// Sends the script and reads the picture until the end of the stream.
std::string picture_of(std::string_view script, const Socket& gnuplot) {
  std::string picture;
  std::array<char, 65536> piece;
  for (;;) {
    pollfd ready{*gnuplot, POLLIN, 0};
    if (!script.empty()) ready.events |= POLLOUT;
    if (::poll(&ready, 1, -1) < 0 && errno != EINTR) fail("gnuplot", errno);
    if (!script.empty()) {
      const ssize_t sent =
          ::send(*gnuplot, script.data(), script.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
      if (sent > 0) script.remove_prefix(static_cast<std::size_t>(sent));
      // gnuplot has ended before reading all; its exit code is checked later.
      if (sent < 0 && !is_passing(errno)) script = {};
      if (script.empty()) ::shutdown(*gnuplot, SHUT_WR);
    }
    const ssize_t got = ::recv(*gnuplot, piece.data(), piece.size(), MSG_DONTWAIT);
    if (got == 0) return picture;
    if (got < 0 && !is_passing(errno)) return picture;
    if (got > 0) picture.append(piece.data(), static_cast<std::size_t>(got));
  }
}

}  // namespace

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

std::string legible(const std::string& text) {
  std::string clean = printable(text);
  const auto replace = [&clean](std::string_view what, std::string_view with) {
    for (std::size_t at = clean.find(what); at != std::string::npos; at = clean.find(what, at)) {
      clean.replace(at, what.size(), with);
    }
  };
  replace("&#", "\\x26#");
  replace("]]>", "]]\\x3e");
  std::size_t characters = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    if (!begins_character(clean[i]) || ++characters <= most_characters) continue;
    return clean.substr(0, i) + "…";
  }
  return clean;
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : legible(text)) {
    switch (c) {
      case '"':
      case '\\':
        result += '\\';
        result += c;
        break;
      case '`':
        result += "\\140";
        break;
      case '@':
        result += "\\100";
        break;
      default:
        result += c;
    }
  }
  return result + '"';
}

std::size_t shown_length(const std::string& text) {
  const std::string shown = legible(text);
  return static_cast<std::size_t>(std::count_if(shown.begin(), shown.end(), begins_character));
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
  // In inches, with 96 pixels per inch.
  if (extension == ".pdf") {
    return "pdfcairo size " + number(width / 96.0) + "in," + number(height / 96.0) + "in" + font;
  }
  throw std::invalid_argument(output.string() + " is not allowed; must end in .png, .svg or .pdf");
}

Script::Script(const std::filesystem::path& output, double width, double height)
    : width_(width), height_(height) {
  line("set terminal " + terminal(output, width, height));
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
  // A label at a fixed position; gnuplot would move a ylabel with the width of the numbers.
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

std::string drawn(const std::string& script) {
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    fail("gnuplot cannot be started", errno);
  }
  const Socket own(ends[0]);
  Socket its(ends[1]);
  const pid_t gnuplot = start_gnuplot(its);
  its.close();
  std::string picture = picture_of(script, own);
  int status = 0;
  while (::waitpid(gnuplot, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0 || picture.empty()) {
    throw std::runtime_error("gnuplot has failed: there is no picture");
  }
  return picture;
}

}  // namespace sprag::plot
