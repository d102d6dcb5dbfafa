// plot of a study: the kind of picture for its rows, its content, and that gnuplot draws it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "tests/support/program_test.h"
#include "tests/support/random.h"
#include "tools/plot/study_figure.h"

namespace sprag::plot {
namespace {

using test::read_text;
using test::write_text;

class StudyPlotTest : public test::ProgramTest {
 protected:
  using Rows = std::vector<std::vector<double>>;

  // The rows and the manifest of a study, as `study` writes them, in a folder of that name.
  std::string write(const std::string& name, const std::vector<std::string>& axes,
                    const std::vector<std::string>& columns, const Rows& rows) const {
    std::filesystem::create_directory(path(name));
    nlohmann::ordered_json manifest{{"name", name}, {"axes", nlohmann::ordered_json::array()}};
    for (std::size_t i = 0; i < axes.size(); ++i) {
      manifest["axes"].push_back({{"path", axes[i]}, {"group", i}});
    }
    write_text(path(name) + "/manifest.json", manifest.dump());
    std::string text = "index,point,run";
    for (const std::string& of : axes) text += "," + of;
    for (const std::string& of : columns) text += "," + of;
    text += ",failure\n";
    for (std::size_t i = 0; i < rows.size(); ++i) {
      text += std::to_string(i) + ",0,0";
      for (const double value : rows[i]) {
        text += ',';
        append_number(text, value);
      }
      text += i % 2 == 0 ? ",\n" : ",t = 1: a word; another\n";
    }
    const std::string file = path(name) + "/rows.csv";
    write_text(file, text);
    return file;
  }

  static StudyOptions where(const std::string& text) {
    StudyOptions options;
    options.where = {text};
    return options;
  }
  static StudyOptions over(const std::string& text) {
    StudyOptions options;
    options.over = {text};
    return options;
  }
  static StudyOptions show(const std::string& text) {
    StudyOptions options;
    options.show = {text};
    return options;
  }

  static StudyFigure figure(const std::string& file, const StudyOptions& options = {}) {
    return make_study_figure(read_study_table({file}), options);
  }
};

TEST_F(StudyPlotTest, OneKeyGivesMedianAndBandOfEachEstimator) {
  Rows rows;
  for (const double jitter : {1e-6, 1e-5, 1e-4, 1e-3}) {
    for (int r = 0; r < 21; ++r) rows.push_back({jitter, jitter * (r + 1), 5.0, std::nan("")});
  }
  const StudyFigure of =
      figure(write("a", {"events.jitter"}, {"replica.V_floor", "both.V_floor", "both.rate"}, rows));
  EXPECT_EQ(of.title, "a");
  ASSERT_EQ(of.axes.size(), 1U);
  EXPECT_TRUE(of.axes[0].logarithmic);
  ASSERT_EQ(of.panels.size(), 1U) << "rate is nowhere known";
  const StudyPanel& panel = of.panels[0];
  EXPECT_EQ(panel.kind, StudyPanel::Kind::bands);
  EXPECT_TRUE(panel.logarithmic);
  ASSERT_EQ(panel.curves.size(), 2U);
  EXPECT_NE(panel.curves[0].colour, panel.curves[1].colour);
  EXPECT_EQ(panel.curves[0].title, "median of replica");
  ASSERT_EQ(panel.curves[0].t.size(), 4U);
  EXPECT_DOUBLE_EQ(panel.curves[0].y[2], 11e-4);
  EXPECT_DOUBLE_EQ(panel.bands[0].low[2], 2e-4);
  EXPECT_DOUBLE_EQ(panel.bands[0].high[2], 20e-4);
  EXPECT_EQ(panel.bands[1].high[3], 5.0);
}

TEST_F(StudyPlotTest, PointsOfTheStroboscopeMakeABifurcationDiagram) {
  Rows rows;
  for (int k = 0; k < 3; ++k) {
    for (int n = 1; n <= 4; ++n) rows.push_back({2.0 + k, 1.0 * n, -1.0 * k, 0.1 * n, 7.0});
  }
  const StudyFigure of =
      figure(write("b", {"force.1.frequency"}, {"n", "lyapunov", "q1", "u1"}, rows));
  ASSERT_EQ(of.panels.size(), 2U);
  EXPECT_EQ(of.panels[0].kind, StudyPanel::Kind::points);
  EXPECT_EQ(of.panels[0].name, "q1");
  EXPECT_EQ(of.panels[0].y.size(), 12U);
  EXPECT_EQ(of.panels[1].name, "lyapunov");
  EXPECT_EQ(of.panels[1].curves.at(0).y, (std::vector<double>{0.0, -1.0, -2.0}));
  EXPECT_TRUE(of.panels[1].bands.empty()) << "one value for all points of a run";
}

TEST_F(StudyPlotTest, TwoKeysGiveColourMapOfMedian) {
  Rows rows;
  for (const double x : {1.0, 2.0, 4.0}) {
    for (const double y : {-1.0, 1.0}) {
      for (int r = 0; r < 3; ++r) rows.push_back({x, y, x * y + r, 100.0 * x});
    }
  }
  const std::string file = write("c", {"x", "y"}, {"replica.rate", "both.rate"}, rows);
  const StudyFigure of = figure(file);
  ASSERT_EQ(of.panels.size(), 2U);
  EXPECT_EQ(of.panels[0].kind, StudyPanel::Kind::map);
  EXPECT_EQ(of.panels[0].name, "replica.rate");
  EXPECT_EQ(of.panels[0].z, (std::vector<double>{0.0, 2.0, -1.0, 3.0, -3.0, 5.0}));
  for (const StudyPanel& panel : of.panels) {
    EXPECT_EQ(panel.least, -3.0) << "colours mean the same in both";
    EXPECT_EQ(panel.most, 400.0);
  }
  // Fixing one key leaves the other.
  const StudyFigure of_one = figure(file, where("y=0.8"));
  ASSERT_EQ(of_one.axes.size(), 1U);
  EXPECT_EQ(of_one.panels.at(0).curves.at(0).y, (std::vector<double>{2.0, 3.0, 5.0}));
  EXPECT_THROW(figure(file, over("z")), std::invalid_argument);
  EXPECT_THROW(figure(file, where("y")), std::invalid_argument);
  EXPECT_THROW(figure(file, show("ra")), std::invalid_argument);
}

TEST_F(StudyPlotTest, StartsAreColouredByAttractor) {
  Rows rows;
  Random random(3);
  for (int i = 0; i < 30; ++i) {
    for (int k = 0; k < 20; ++k) {
      const double off = random.uniform(-1e-6, 1e-6);
      const bool left = i + k < 20;
      rows.push_back(
          {0.1 * i, 1.0 * k, left ? 1.0 : 2.0, left ? 0.3 : -0.2, left ? 1.0 + off : 4.0});
      if (i == k) rows.back() = {0.1 * i, 1.0 * k, 0.0, std::nan(""), std::nan("")};
    }
  }
  const StudyFigure of = figure(write("d", {"master.q.1", "master.u.1"},
                                      {"attractor.period", "attractor.q1", "attractor.u1"}, rows));
  ASSERT_EQ(of.panels.size(), 1U);
  const StudyPanel& panel = of.panels[0];
  EXPECT_EQ(panel.kind, StudyPanel::Kind::labels);
  EXPECT_EQ(panel.titles, (std::vector<std::string>{"none found", "1: period 1", "2: period 2"}));
  ASSERT_EQ(panel.z.size(), rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_EQ(panel.z[k], rows[k][2]) << k;
}

TEST_F(StudyPlotTest, GnuplotDrawsAllKinds) {
  Rows grid, uneven, scattered, lines;
  Random random(4);
  for (const double x : {1.0, 2.0, 4.0, 5.0}) {
    for (const double y : {1e-3, 1e-2, 1e-1}) {
      uneven.push_back({x, y, x * y, x > 2.0 ? 1.0 : 2.0, x > 2.0 ? 0.1 : 0.4});
      grid.push_back({std::floor(x / 1.5), y, x * y, x > 2.0 ? 0.0 : 2.0, 0.1});
      scattered.push_back({random.uniform(0.0, 1.0), random.uniform(0.0, 1.0), x, 1.0 + x, 0.1});
      lines.push_back({y, x, 0.0, x * y, -y});
    }
  }
  const std::vector<std::string> columns{"both.V_floor", "attractor.period", "attractor.q1"};
  const std::vector<std::string> axes{"x", "y"};
  const std::string bifurcation = write("l", {"x"}, {"n", "impacts", "q1", "lyapunov"}, lines);
  const std::vector<std::string> files{write("g", axes, columns, grid),
                                       write("u", axes, columns, uneven),
                                       write("s", axes, columns, scattered), bifurcation};
  for (const std::string& file : files) {
    for (const char* show : {"both.V_floor", "attractor", "q1,lyapunov,impacts"}) {
      if ((file == bifurcation) != (std::string(show).starts_with("q1"))) continue;
      for (const char* name : {"a.png", "a.svg", "a.pdf"}) {
        const auto ended = run(PLOT, {file, "--show", show, "--output", path(name)});
        EXPECT_EQ(ended.code, 0) << ended.err;
        EXPECT_EQ(ended.err, "") << file << " " << show << ": gnuplot warns of nothing";
        EXPECT_GT(std::filesystem::file_size(path(name)), 1000U);
      }
    }
  }
  run(PLOT, {files[1], "--output", path("b.svg")});
  const std::string svg = read_text(path("b.svg"));
  for (const char* text : {"1: period 1", "2: period 2", "attractor"}) {
    EXPECT_EQ(svg.find(text) != std::string::npos, std::string(text) != "attractor") << text;
  }
}

// A single value of a key, a value that is not finite, and no finite value.
TEST_F(StudyPlotTest, SparseDataIsDrawn) {
  const double inf = std::numeric_limits<double>::infinity();
  const std::string file =
      write("f", {"x", "y"}, {"attractor.period", "attractor.q1", "rate", "V"},
            {{1.0, 1.0, 1.0, 4.0, -inf, 2.0}, {1.0, 2.0, 2.0, 3.0, -inf, inf}});
  for (const test::Arguments& of :
       {test::Arguments{"--show", "attractor"}, test::Arguments{"--show", "V"},
        test::Arguments{"--over", "y", "--show", "V,rate"}}) {
    test::Arguments arguments{file, "--output", path("f.png")};
    if (of[0] != "--over") arguments.insert(arguments.end(), {"--over", "x,y"});
    arguments.insert(arguments.end(), of.begin(), of.end());
    const auto ended = run(PLOT, arguments);
    EXPECT_EQ(ended.code, 0);
    EXPECT_EQ(ended.err, "") << of[1];
  }
  EXPECT_EQ(run(PLOT, {file, "--over", "y", "--show", "rate", "--output", path("g.png")}).code, 2)
      << "nothing to show";
}

TEST_F(StudyPlotTest, DamagedRowsAndBadUsage) {
  const std::string file = write("e", {"x"}, {"rate"}, {{1.0, 2.0}, {2.0, 3.0}});
  const std::string out = path("e.png");
  for (const test::Arguments& arguments :
       {test::Arguments{file, "--output", out, "--over", "none"},
        test::Arguments{file, "--output", out, "--show", "V"},
        test::Arguments{file, "--output", file},
        test::Arguments{file, "--output", out, "--report", path("e") + "/manifest.json"},
        test::Arguments{file, SPRAG_SOURCE_DIR "/scenes/lab_rig.toml", "--output", out}}) {
    const auto ended = run(PLOT, arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err, "");
  }
  const std::string text = read_text(file);
  write_text(file, text + "2,0\n");
  const auto damaged = run(PLOT, {file, "--output", out});
  EXPECT_EQ(damaged.code, 1);
  EXPECT_NE(damaged.err.find(":4: "), std::string::npos) << damaged.err;
  EXPECT_TRUE(std::filesystem::exists(out)) << "what is there before it is drawn";
  // Without a manifest the varied keys are unknown.
  write_text(file, text);
  std::filesystem::remove(path("e") + "/manifest.json");
  EXPECT_EQ(run(PLOT, {file, "--output", out}).code, 2);
  EXPECT_EQ(run(PLOT, {file, "--over", "x", "--output", out}).code, 0);
}

}  // namespace
}  // namespace sprag::plot
