// Names are data: any content of a scene's name, a label, a column, a manifest or a file's name
// appears as text in a picture. It neither ends gnuplot's strings nor executes commands. With
// gnuplot itself.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "command_line/printable.h"
#include "tests/support/program_test.h"
#include "tests/support/random.h"
#include "tools/plot/script_text.h"

namespace sprag::plot {
namespace {

using test::Arguments;
using test::read_text;
using test::write_text;

constexpr const char* states_text = "k,t,q1,u1\n0,0,1,2\n1,8,3,4\n";

/// A text in gnuplot's SVG.
std::string in_xml(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return result;
}

class HostileNamesTest : public test::ProgramTest {
 protected:
  std::string file(const std::string& name, const std::string& text) {
    return write_text(path(name), text);
  }

  /// A command that would make a file if a shell or gnuplot executed it; see nothing_ran().
  std::string command() const { return "touch " + path("ran"); }
  void nothing_ran() const { EXPECT_FALSE(std::filesystem::exists(path("ran"))); }

  /// All control characters, characters special to gnuplot, a shell, XML or a terminal, valid and
  /// invalid UTF-8.
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (int c = 0; c < 0x20; ++c) {
      const std::string control(1, static_cast<char>(c));
      all.push_back("a" + control + "system('" + command() + "')" + control + "b");
    }
    for (const char* text : {"\x7f",
                             "'",
                             "''",
                             "\"",
                             "\\",
                             "\\'",
                             "a\\",
                             "$(",
                             "|",
                             "<",
                             "< date",
                             "-",
                             "#",
                             ";",
                             "@a",
                             "{/Bold a}",
                             "^{a}_b",
                             "%s %d %",
                             "Ω ∂g/∂t",
                             "日本語",
                             "🔔",
                             "\xff\xfe",
                             "a\xc3",
                             "\xc0\xaf",
                             "\xed\xa0\x80",
                             "\xc2\x9b[31m",
                             "\xe2\x80\xae",
                             "&amp;",
                             "&lt",
                             "&#x1b;",
                             "&#27;",
                             "]]>",
                             "--> <script>",
                             "\\U+221E \\123 \\n",
                             "$GPVAL_VERSION",
                             "\x1b]0;title\x07"}) {
      all.emplace_back(text);
    }
    all.push_back("`" + command() + "`");
    all.push_back("'.system('" + command() + "').'");
    all.push_back("\".system('" + command() + "').\"");
    all.push_back("\\\".system('" + command() + "').\"");
    all.push_back("a\nset output '| " + command() + "'\n!" + command() + "\n");
    return all;
  }

  std::string plotted(const Arguments& arguments) {
    Arguments all = arguments;
    all.insert(all.end(), {"--output", path("a.svg")});
    const Ended ended = run(PLOT, all);
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_EQ(ended.err, "") << "gnuplot warns of nothing";
    return read_text(path("a.svg"));
  }

  void shows(const std::string& svg, const std::string& name) const {
    EXPECT_NE(svg.find(">" + in_xml(legible(name)) + "<"), std::string::npos)
        << testing::PrintToString(name);
  }
};

TEST_F(HostileNamesTest, TextsAreShownLiterally) {
  std::vector<std::string> all = names();
  Random random(20261);
  for (int i = 0; i < 40; ++i) {
    std::string bytes = "b";
    for (int k = 0; k < 12; ++k) bytes += static_cast<char>(random.integer(0, 255));
    all.push_back(bytes);
  }
  Script script(path("a.svg"), 1000.0, 30.0 * static_cast<double>(all.size()) + 60.0);
  script.panel({100.0, 500.0, 10.0, 300.0}, "y\r'" + all.back(), 10.0);
  std::vector<std::string> curves;
  double y = 20.0;
  for (const std::string& name : all) {
    script.line("set label " + quoted(name) + " at " + script.screen(20.0, y += 28.0) +
                " left noenhanced");
    curves.push_back("sin(x) title " + quoted("curve " + name));
  }
  script.line("set xlabel " + quoted("x\n" + all.front()) + " noenhanced");
  script.plot(curves);
  script.line("unset multiplot");
  testing::internal::CaptureStderr();
  const std::string svg = drawn(std::move(script).text());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "gnuplot warns of nothing";
  for (const std::string& name : all) {
    if (legible(name).find_first_not_of(' ') == std::string::npos) continue;
    shows(svg, name);
    shows(svg, "curve " + name);
  }
  shows(svg, "x\n" + all.front());
  shows(svg, "y\r'" + all.back());
  // Valid XML with texts of one line each, for any name.
  std::string without_tabs = svg;
  std::erase(without_tabs, '\t');
  EXPECT_EQ(printable_lines(without_tabs), without_tabs);
  EXPECT_EQ(svg.find("&#"), std::string::npos);
  EXPECT_EQ(svg.find("]]>"), std::string::npos);
  nothing_ran();
}

TEST_F(HostileNamesTest, SceneOfAnyNameIsDrawn) {
  const std::string name = "a\nsystem(\"" + command() + "\")\n";
  const std::string states = file("s.csv", states_text);
  for (const std::string& of : {name, "'" + name, std::string("\x1b[31mred")}) {
    const std::string scene =
        file("a.toml", "name = " + nlohmann::json(of).dump() +
                           "\n[system]\nM = [[1]]\nC = [[1]]\nK = [[1]]\n[[contact]]\n"
                           "direction = [1]\n[impact]\nrestitution = 0.5\n");
    shows(plotted({scene, states}), of);
    nothing_ran();
  }
}

TEST_F(HostileNamesTest, TitlesLabelsAndColumnsAreText) {
  for (const std::string& name : names()) {
    if (name.find('\0') != std::string::npos) continue;  // not possible as an argument of a program
    const std::string states = file("s.csv", states_text);
    const std::string svg =
        plotted({"run " + name + "=" + states, "--title", "title " + name, "--show", "q1"});
    shows(svg, "title " + name);
    shows(svg, "run " + name);
  }
  const std::string column = "a'\x1b`" + command() + "`\x7f";
  const std::string states = file("c.csv", "k,t,q1,u1," + column + "\n0,0,1,2,3\n1,8,3,4,5\n");
  shows(plotted({states, "--show", column}), column);
  nothing_ran();
}

TEST_F(HostileNamesTest, StudyOfAnyNamesIsDrawn) {
  const std::string name = "a\n!" + command() + "\n";
  const std::string axis = "x'\x1b\x7f";
  const nlohmann::json manifest{{"name", name}, {"axes", {{{"path", axis}, {"group", 0}}}}};
  file("manifest.json", manifest.dump());
  const std::string rows =
      file("rows.csv",
           "index,point,run," + axis + ",rate,failure\n0,0,0,1,2,\n1,1,0,2,3,\n2,2,0,3,5,\n");
  const std::string svg = plotted({rows, "--show", "rate"});
  shows(svg, name);
  shows(svg, axis);
  nothing_ran();
}

TEST_F(HostileNamesTest, FilesHaveGivenNames) {
  const std::string states = file("s.csv", states_text);
  // A file name without a folder.
  const auto plot_here = [&](const std::string& in, const std::string& out) {
    const Ended ended = run("/bin/sh", {"-c", "cd \"$1\" && shift && exec \"$@\"", "sh", path(""),
                                        PLOT, in, "--output", out});
    EXPECT_EQ(ended.code, 0) << ended.err;
    nothing_ran();
    return read_text(path(out));
  };
  for (const char* name :
       {"|touch ran; cat > x.svg", "< touch ran.svg", "-.svg", "`touch ran`.svg", "a'b\"c.svg",
        "a\\.svg", "\x1b[31m.svg", "$HOME.svg", "x'\n!touch ran\n.svg"}) {
    EXPECT_NE(plot_here("s.csv", name).find("</svg>"), std::string::npos) << name;
  }
  const std::string hostile = "x'\n!touch ran\n";
  file(hostile + ".csv", states_text);
  shows(plot_here(hostile + ".csv", "b.svg"), hostile);
}

TEST_F(HostileNamesTest, LongNamesAreTruncated) {
  const std::string states = file("s.csv", states_text);
  const std::string name(100000, 'n');
  const std::string svg = plotted({name + "=" + states, "--title", name, "--show", "q1"});
  shows(svg, name);
  EXPECT_EQ(shown_length(name), 201u);
  EXPECT_EQ(shown_length("Ω\n"), 3u);
  // As a file name, which is too long to exist.
  const Ended absent = run(PLOT, {name, "--output", path("b.svg")});
  EXPECT_EQ(absent.code, 2) << absent.err;
}

TEST_F(HostileNamesTest, ImpossibleContactNumberTakesNoMemory) {
  for (const char* contact : {"0", "61", "1e9", "1.5", "nan", "-1"}) {
    const std::string events = file(
        "e.csv", std::string("t,contact,closed\n1,1,1\n1.5,1,0\n2,") + contact + ",1\n3,1,1\n");
    const Ended ended = run(PLOT, {events, "--output", path("a.svg")});
    EXPECT_EQ(ended.code, 1) << contact;
    EXPECT_NE(
        ended.err.find(events + ":4: contact " + contact + "; must be a whole number in 1 to "),
        std::string::npos)
        << ended.err;
  }
}

TEST_F(HostileNamesTest, AFullDiskIsAFailureAndNamesTheFile) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const std::string states = file("s.csv", states_text);
  for (const char* name : {"a.svg", "a.png", "a.pdf"}) {
    std::filesystem::create_symlink("/dev/full", path(name));
    const Ended ended = run(PLOT, {states, "--output", path(name)});
    EXPECT_EQ(ended.code, 1) << name;
    EXPECT_EQ(ended.err, "plot: " + path(name) + ": No space left on device\n");
  }
  // A limited file size: a disk with room for a part.
  const Ended limited = run("/bin/sh", {"-c", "ulimit -f 1 && exec \"$@\"", "sh", PLOT, states,
                                        "--output", path("b.svg")});
  EXPECT_EQ(limited.code, 1);
  EXPECT_EQ(limited.err, "plot: " + path("b.svg") + ": File too large\n");
  const Ended nowhere = run(PLOT, {states, "--output", path("nowhere/a.svg")});
  EXPECT_EQ(nowhere.code, 1);
  EXPECT_NE(nowhere.err.find(path("nowhere/a.svg")), std::string::npos) << nowhere.err;
}

TEST_F(HostileNamesTest, OldPictureIsKeptWithoutGnuplot) {
  const std::string states = file("s.csv", states_text);
  const std::string picture = file("a.svg", "old");
  const Ended ended =
      run("/usr/bin/env", {"PATH=" + path("empty"), PLOT, states, "--output", picture});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("gnuplot is not installed"), std::string::npos) << ended.err;
  EXPECT_EQ(read_text(picture), "old");
}

}  // namespace
}  // namespace sprag::plot
