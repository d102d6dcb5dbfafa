// plot: thinning preserves the visible shape, panels show the content of files and scene, and
// gnuplot draws them. Other machines than the paper's beam.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tests/support/run.h"
#include "tools/plot/figure.h"
#include "tools/plot/gnuplot.h"
#include "tools/plot/table.h"
#include "tools/plot/thinning.h"

namespace sprag::plot {
namespace {

using test::read_text;
using test::write_text;

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(Thinning, EveryPixelKeepsItsRange) {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> step(0.0, 2e-4);
  std::normal_distribution<double> value;
  std::vector<double> t{0.0}, y{0.0};
  for (int i = 1; i < 100000; ++i) {
    t.push_back(t.back() + step(generator));
    y.push_back(value(generator));
  }
  const double from = 2.0, to = 7.0;
  constexpr int pixels = 300;
  const Points kept = thinned(t, y, from, to, pixels);
  EXPECT_LE(kept.t.size(), 4u * (pixels + 2));
  EXPECT_TRUE(std::is_sorted(kept.t.begin(), kept.t.end()));
  const auto spans = [&](const std::vector<double>& of_t, const std::vector<double>& of_y) {
    std::vector<double> least(pixels, infinity), greatest(pixels, -infinity);
    for (std::size_t i = 0; i < of_t.size(); ++i) {
      if (of_t[i] < from || of_t[i] >= to) continue;
      const auto pixel = static_cast<std::size_t>((of_t[i] - from) / (to - from) * pixels);
      least[pixel] = std::min(least[pixel], of_y[i]);
      greatest[pixel] = std::max(greatest[pixel], of_y[i]);
    }
    return std::pair(least, greatest);
  };
  EXPECT_EQ(spans(kept.t, kept.y), spans(t, y));
  // One point on each side: the line reaches both edges.
  EXPECT_LT(kept.t.front(), from);
  EXPECT_GT(kept.t.back(), to);
}

TEST(Thinning, KeepsBreaks) {
  const double nan = std::nan("");
  const Points kept = thinned({0, 1, 2, 3, 4}, {1, nan, nan, 2, 3}, 0.0, 4.0, 2);
  ASSERT_EQ(kept.t.size(), 4u);
  EXPECT_TRUE(std::isnan(kept.y[1]));
  EXPECT_EQ(kept.y[3], 3.0);
}

TEST(Thinning, KeepsOutlineOfBand) {
  const BandPoints band =
      thinned({0, 0.1, 0.2, 5, 6}, {0, -3, 0, infinity, 1}, {1, 1, 7, 9, 2}, 0.0, 10.0, 10);
  ASSERT_EQ(band.t.size(), 3u);
  EXPECT_EQ(band.low[0], -3.0);
  EXPECT_EQ(band.high[0], 7.0);
  EXPECT_TRUE(std::isnan(band.low[1])) << "nothing is known there";
  EXPECT_EQ(band.high[2], 2.0);
}

class PlotTest : public test::ProgramTest {
 protected:
  std::string file(const std::string& name, const std::string& text) {
    return write_text(path(name), text);
  }
  Figure figure(const std::vector<std::string>& files, const Scene* scene = nullptr,
                const FigureOptions& options = {}) {
    std::vector<Table> tables;
    for (const std::string& name : files) tables.push_back(read_table(name));
    left_out_.clear();
    return make_figure(tables, scene, options, left_out_);
  }
  std::vector<std::string> left_out_;
};

TEST_F(PlotTest, TablesAreRecognizedByHeader) {
  const std::string states = file("a.csv", "k,t,q1,u1,sigma_q1\n0,0,1,2,inf\n1,0.5,3,4,0.25\n");
  const Table table = read_table("my run=" + states);
  EXPECT_EQ(table.label, "my run");
  EXPECT_EQ(table.kind, TableKind::states);
  EXPECT_EQ(table.column("sigma_q1")->front(), infinity);
  EXPECT_EQ(*table.column("q1"), (std::vector<double>{1.0, 3.0}));
  EXPECT_EQ(read_table(states).label, "a");
  EXPECT_EQ(read_table(file("V.csv", "k,t,V,V1\n0,0,1,1\n")).kind, TableKind::energy);
  EXPECT_EQ(read_table(file("e.csv", "t,contact,closed\n")).kind, TableKind::events);
  // A valid file name.
  EXPECT_EQ(read_table(file("x=y.csv", "k,t,V,V1\n0,0,1,1\n")).label, "x=y");
}

TEST_F(PlotTest, UnknownHeaderIsReportedAndTruncatedLineEndsReading) {
  const std::string foreign = file("b.csv", "time,value\n0,1\n");
  try {
    read_table(foreign);
    ADD_FAILURE() << "it was taken";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find(foreign + ":1: "), std::string::npos) << e.what();
  }
  const Table cut = read_table(file("c.csv", "k,t,q1,u1\n0,0,1,2\n1,1,1\n2,2,1,2\n"));
  EXPECT_EQ(cut.column("t")->size(), 1u);
  ASSERT_TRUE(cut.damage);
  EXPECT_EQ(cut.damage->line, 3u);
}

TEST_F(PlotTest, GapIsComputedFromSceneWithTwoSigmaBand) {
  const Scene scene = test::shipped_scene("two_stops_beam");
  const auto f = scene.model.coordinates();
  std::string header = "k,t", row = "4,0.7", more;
  Eigen::VectorXd q(f);
  for (const char letter : {'q', 'u'}) {
    for (Eigen::Index i = 0; i < f; ++i) {
      header += "," + std::string(1, letter) + std::to_string(i + 1);
      if (letter == 'q') q[i] = 0.25 / static_cast<double>(i + 1);
      row += "," + std::to_string(letter == 'q' ? q[i] : 0.0);
    }
  }
  for (Eigen::Index i = 0; i < f; ++i) q[i] = std::stod(std::to_string(q[i]));
  std::string second = row;
  second.replace(0, 5, "5,0.9");
  const std::string states =
      file("o.csv", header + ",sigma_g1\n" + row + ",0.5\n" + second + ",inf\n");
  const Figure of = figure({states}, &scene);
  ASSERT_GE(of.panels.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(of.panels[i].name, "g" + std::to_string(i + 1));
    EXPECT_NEAR(of.panels[i].curves.at(0).y[1], gap(scene.model.contacts[i], q, 0.9), 1e-14);
  }
  const Band& band = of.panels[0].bands.at(0);
  EXPECT_NEAR(band.high[0] - band.low[0], 4 * 0.5, 1e-12);
  EXPECT_TRUE(std::isnan(band.low[1])) << "an infinite sigma has no band";
  EXPECT_TRUE(of.panels[1].bands.empty());
  EXPECT_EQ(of.from, 0.7);
  EXPECT_EQ(of.to, 0.9);
}

TEST_F(PlotTest, AnEstimateInsideASupportIsDashed) {
  const std::string text =
      "k,t,q1,u1,sigma_q1,penetrating\n0,0,1,2,inf,0\n1,1,-1,2,inf,1\n2,2,-2,2,inf,1\n"
      "3,3,3,2,1,0\n4,4,4,2,1,0\n";
  const Panel panel = figure({file("o.csv", text)}).panels.at(0);
  ASSERT_EQ(panel.curves.size(), 2u);
  const Curve& outside = panel.curves[0];
  const Curve& inside = panel.curves[1];
  EXPECT_EQ(outside.title, "o");
  EXPECT_EQ(outside.line, Line::solid);
  EXPECT_EQ(inside.title, "o, inside a support");
  EXPECT_EQ(inside.line, Line::dashed);
  EXPECT_EQ(inside.colour, outside.colour);
  for (const std::size_t i : {1u, 2u}) EXPECT_TRUE(std::isnan(outside.y[i])) << i;
  EXPECT_EQ(outside.y[0], 1.0);
  EXPECT_EQ(outside.y[3], 3.0);
  // The dashed parts reach the neighbouring points.
  for (const std::size_t i : {0u, 1u, 2u, 3u}) EXPECT_FALSE(std::isnan(inside.y[i])) << i;
  EXPECT_TRUE(std::isnan(inside.y[4]));
  const std::string never =
      file("p.csv", "k,t,q1,u1,sigma_q1,penetrating\n0,0,1,2,1,0\n1,1,1,2,1,0\n");
  EXPECT_EQ(figure({never}).panels.at(0).curves.size(), 1u);
}

TEST_F(PlotTest, StretchesOfTheReplicaAreDotted) {
  const std::string text =
      "k,t,q1,u1,sigma_q1,from_filter,penetrating\n0,0,1,2,inf,0,1\n1,1,2,2,inf,0,0\n"
      "2,2,3,2,inf,0,0\n3,3,4,2,1,1,0\n4,4,5,2,1,1,0\n";
  const Panel panel = figure({file("o.csv", text)}).panels.at(0);
  ASSERT_EQ(panel.curves.size(), 3u);
  EXPECT_EQ(panel.curves[0].title, "o");
  EXPECT_EQ(panel.curves[1].line, Line::dashed);
  const Curve& replica = panel.curves[2];
  EXPECT_EQ(replica.title, "o, replica shown");
  EXPECT_EQ(replica.line, Line::dotted);
  for (const std::size_t i : {0u, 1u, 2u}) EXPECT_TRUE(std::isnan(panel.curves[0].y[i])) << i;
  EXPECT_EQ(panel.curves[0].y[3], 4.0);
  for (const std::size_t i : {0u, 1u, 2u, 3u}) EXPECT_FALSE(std::isnan(replica.y[i])) << i;
  EXPECT_TRUE(std::isnan(replica.y[4]));
}

TEST_F(PlotTest, UnitIsReadable) {
  struct Case {
    double largest;
    const char* label;
    double factor;
  };
  for (const Case& of :
       {Case{0.2, "gap [m]", 1.0}, Case{0.02, "gap [mm]", 1e3}, Case{2e-4, "gap [mm]", 1e3},
        Case{2e-5, "gap [µm]", 1e6}, Case{2e-8, "gap [nm]", 1e9}, Case{2e-15, "gap [pm]", 1e12},
        Case{0.0, "gap [m]", 1.0}, Case{infinity, "gap [m]", 1.0}}) {
    Panel panel;
    panel.curves.push_back({"a", Colour::black, Line::solid, {0, 1}, {-of.largest, 0.0}});
    panel.bands.push_back({"b", Colour::black, {0, 1}, {-9, 0}, {9, 1}});
    panel.dots.push_back({"c", Colour::black, 0, {0.5}, {of.largest / 2}, {0.25}});
    set_readable_unit(panel, "gap", "m");
    EXPECT_EQ(panel.y_label, of.label);
    EXPECT_DOUBLE_EQ(panel.curves[0].y[0], -of.factor * of.largest);
    EXPECT_DOUBLE_EQ(panel.bands[0].low[0], -of.factor * 9);
    EXPECT_DOUBLE_EQ(panel.bands[0].high[1], of.factor);
    EXPECT_DOUBLE_EQ(panel.dots[0].sigma[0], of.factor * 0.25);
  }
}

TEST_F(PlotTest, SingleVIsTitledV) {
  const std::string V = file("V.csv", "k,t,V\n0,0,1\n1,1,0.5\n");
  const Figure one = figure({V});
  EXPECT_EQ(one.panels.at(0).curves.at(0).title, "V");
  const Figure two = figure({"a=" + V, "b=" + V});
  EXPECT_EQ(two.panels.at(0).curves.at(0).title, "V, a");
  EXPECT_EQ(two.panels.at(0).curves.at(1).title, "V, b");
}

// The title of a y axis keeps its distance from the longest number, and a legend above a panel
// from the panel.
TEST_F(PlotTest, TitlesAreClearOfNumbers) {
  Figure of;
  of.to = 1.0;
  Panel panel;
  panel.y_label = "quantity";
  panel.curves.push_back({"a", Colour::black, Line::solid, {0, 1}, {-123450.5, -123451.5}});
  of.panels.push_back(panel);
  const auto value = [](const std::string& script, const std::string& name) {
    const std::size_t at = script.find(name);
    EXPECT_NE(at, std::string::npos) << name;
    return std::stod(script.substr(at + name.size()));
  };
  const auto left = [&](const std::string& script) {
    const std::string size = script.substr(script.find(" size ") + 6);
    return value(script, "set lmargin at screen ") * std::stod(size);
  };
  EXPECT_GT(left(gnuplot_script(of, "a.svg")), 28.0 + 7.0 * 7.4) << "-123450 has 7 characters";
  of.panels[0].curves[0].y = {-1.0, 1.0};
  EXPECT_EQ(left(gnuplot_script(of, "a.svg")), 84.0);
  const PictureForm narrow{.across = 300, .legend_above = true};
  const std::string before = gnuplot_script(of, "a.svg", narrow);
  for (int k = 0; k < 9; ++k) of.panels[0].curves.push_back(of.panels[0].curves[0]);
  const std::string after = gnuplot_script(of, "a.svg", narrow);
  const auto height = [](const std::string& script) {
    const std::string size = script.substr(script.find(" size ") + 6);
    return std::stod(size.substr(size.find(',') + 1));
  };
  EXPECT_GT(height(after), height(before) + 18.0) << "more rows of the legend";
}

TEST_F(PlotTest, PredictionsAreRefused) {
  const std::string predictions = file(
      "p.csv", "made_at,certain_until,t,contact,kind,sigma_t\n1,2,,,,\n1,2,1.5,1,impact,0.1\n");
  EXPECT_EQ(read_table(predictions).columns[0].size(), 2u);
  const Ended ended = run(PLOT, {predictions, "--output", path("a.svg")});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("holds predictions"), std::string::npos) << ended.err;
}

TEST_F(PlotTest, RunHasSameColourInAllPanels) {
  const std::string machine = file("m.csv", "k,t,q1,u1\n0,0,1,2\n1,1,1,2\n");
  const std::string a = file("a.csv", "k,t,q1,u1,sigma_q1\n0,0,1,2,1\n1,1,1,2,1\n");
  const std::string b = file("b.csv", "k,t,q1,u1,B\n0,0,1,2,1\n1,1,1,2,1\n");
  const std::string V = file("V.csv", "k,t,V\n0,0,1\n1,1,0.5\n");
  const Figure of = figure({"V=" + V, "b=" + V, "b=" + b, "machine=" + machine, "a=" + a});
  const Panel& q = of.panels.at(0);
  const Panel& energy = of.panels.at(1);
  ASSERT_EQ(q.curves.size(), 3u);
  ASSERT_EQ(energy.curves.size(), 3u);
  EXPECT_EQ(q.curves[1].title, "machine");
  EXPECT_EQ(q.curves[1].colour, Colour::black);
  EXPECT_EQ(q.curves[0].colour, energy.curves[1].colour) << "b's states and V";
  EXPECT_EQ(q.curves[0].colour, energy.curves[2].colour) << "b's bound";
  EXPECT_NE(q.curves[0].colour, q.curves[2].colour);
  EXPECT_TRUE(energy.logarithmic);
}

// Outputs named in the scene and parameters come first, with the curves of all runs in one panel.
TEST_F(PlotTest, OutputsAndParametersHavePanels) {
  const std::string machine = file("m.csv", "k,t,q1,u1,tip,rate\n0,0,1,2,5,6\n1,1,1,2,7,8\n");
  const std::string a =
      file("a.csv",
           "k,t,q1,u1,B,sigma_q1,sigma_u1,sigma_g1,closing_t,filter_gap,sigma_filter_gap,accepted,"
           "impact.restitution,sigma_impact.restitution,tip,sigma_tip,rate,sigma_rate\n"
           "0,0,1,2,1,1,1,1,0,3,4,1,0.7,0.25,5.5,0.5,6,inf\n"
           "1,1,1,2,1,1,1,1,0,3,4,1,0.7,0.125,6.5,inf,8,2\n");
  const Figure of = figure({"a=" + a, "machine=" + machine});
  std::vector<std::string> names;
  for (const Panel& panel : of.panels) names.push_back(panel.name);
  EXPECT_EQ(names, (std::vector<std::string>{"tip", "rate", "impact.restitution", "q1", "V"}));
  const Panel& tip = of.panels.at(0);
  ASSERT_EQ(tip.curves.size(), 2u);
  EXPECT_EQ(tip.curves[1].y, (std::vector<double>{5.0, 7.0}));
  EXPECT_EQ(tip.curves[1].colour, Colour::black) << "the machine's";
  EXPECT_EQ(tip.curves[1].line, Line::thick);
  EXPECT_EQ(tip.curves[0].y, (std::vector<double>{5.5, 6.5}));
  EXPECT_NE(tip.curves[0].colour, Colour::black);
  ASSERT_EQ(tip.bands.size(), 1u);
  EXPECT_EQ(tip.bands[0].low[0], 4.5);
  EXPECT_EQ(tip.bands[0].high[0], 6.5);
  EXPECT_TRUE(std::isnan(tip.bands[0].low[1]));
  const Panel& restitution = of.panels.at(2);
  ASSERT_EQ(restitution.curves.size(), 1u);
  EXPECT_EQ(restitution.bands.at(0).high[1], 0.95);
  // Also for a machine alone.
  EXPECT_EQ(figure({machine}).panels.at(1).name, "rate");
  FigureOptions options;
  options.show = {"rate"};
  EXPECT_EQ(figure({a}, nullptr, options).panels.at(0).bands.at(0).high[1], 12.0);
}

// An output with the name of a standard panel does not replace it.
TEST_F(PlotTest, AnOutputMayHaveTheNameOfAnotherPanel) {
  const std::string a = file("a.csv",
                             "k,t,q1,u1,B,V,sigma_V,velocity,sigma_velocity\n0,0,1,2,1,3,1,1,1\n"
                             "1,1,1,2,1,4,1,1,1\n");
  std::vector<std::string> names;
  for (const Panel& panel : figure({a}).panels) names.push_back(panel.name);
  EXPECT_EQ(names, (std::vector<std::string>{"V", "velocity", "q1", "V"}));
  FigureOptions options;
  options.show = {"V"};
  EXPECT_EQ(figure({a}, nullptr, options).panels.size(), 2u);
}

TEST_F(PlotTest, ContactsAreDrawnAsPulsesAndIntervals) {
  const std::string events = file("e.csv",
                                  "t,contact,closed\n1,1,1\n1,1,0\n2,2,1\n3,1,1\n3,1,0\n4,2,0\n"
                                  "5,1,1\n");
  const std::string states = file("s.csv", "k,t,q1,u1\n0,0,1,2\n1,8,1,2\n");
  const Figure of = figure({events, states});
  const auto panel = std::find_if(of.panels.begin(), of.panels.end(),
                                  [](const Panel& each) { return each.name == "contacts"; });
  ASSERT_NE(panel, of.panels.end());
  ASSERT_EQ(panel->contacts.size(), 2u);
  EXPECT_EQ(panel->contacts[0].pulses, (std::vector<double>{1.0, 3.0}));
  using Closed = std::vector<std::pair<double, double>>;
  EXPECT_EQ(panel->contacts[0].closed, (Closed{{5.0, 8.0}})) << "still closed at the end";
  EXPECT_EQ(panel->contacts[1].closed, (Closed{{2.0, 4.0}}));
}

TEST_F(PlotTest, ImpactTableIsDrawnAsDotsOfEachContact) {
  const std::string states = file("s.csv", "k,t,q1,u1,B\n0,0,1,2,inf\n1,8,1,2,inf\n");
  const std::string impacts =
      file("i.csv",
           "t,contact,kind,impulse,sigma_impulse\n1,2,impact,3,0.5\n2,1,impact,4,inf\n"
           "3,1,opens,,\n");
  const Figure of = figure({"a=" + states, "a=" + impacts});
  const auto panel = std::find_if(of.panels.begin(), of.panels.end(),
                                  [](const Panel& each) { return each.name == "impulse"; });
  ASSERT_NE(panel, of.panels.end());
  ASSERT_EQ(panel->dots.size(), 2u);
  EXPECT_EQ(panel->dots[0].y, (std::vector<double>{4.0})) << "a row without an impulse is none";
  EXPECT_EQ(panel->dots[1].sigma, (std::vector<double>{0.5}));
  EXPECT_NE(panel->dots[0].shape, panel->dots[1].shape);
  EXPECT_EQ(panel->dots[0].colour, of.panels.at(0).curves.at(0).colour);
  for (const Panel& each : of.panels) EXPECT_NE(each.name, "V") << "B is infinite throughout";
}

TEST_F(PlotTest, OmittedPanelsAreReportedAndRequestedOnesShown) {
  std::string header = "k,t", row = "0,0", next = "1,1";
  for (int i = 1; i <= 9; ++i) {
    header += ",q" + std::to_string(i);
    row += ",1";
    next += ",2";
  }
  for (int i = 1; i <= 9; ++i) {
    header += ",u" + std::to_string(i);
    row += ",1";
    next += ",2";
  }
  const std::string states = file("s.csv", header + "\n" + row + "\n" + next + "\n");
  EXPECT_LT(figure({states}).panels.size(), 9u);
  EXPECT_EQ(left_out_.back(), "q9");
  FigureOptions options;
  options.show = {"u7", "q9"};
  const Figure of = figure({states}, nullptr, options);
  ASSERT_EQ(of.panels.size(), 2u);
  EXPECT_EQ(of.panels[0].name, "u7");
  options.show = {"g1"};
  try {
    figure({states}, nullptr, options);
    ADD_FAILURE() << "it was taken";
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("q1, q2"), std::string::npos) << e.what();
  }
}

// With gnuplot itself, as scripts/test installs it.
TEST_F(PlotTest, GnuplotDrawsEveryKindOfPicture) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/two_stops_beam.toml";
  ASSERT_EQ(run(MASTER_SIM, {scene, "--duration", "3", "--speed", "max", "--no-lcm", "--events",
                             path("events.csv"), "--states", path("machine.csv")})
                .code,
            0);
  ASSERT_EQ(run(OBSERVER, {scene, "--replay", path("events.csv"), "--states", path("both.csv"),
                           "--impacts", path("impacts.csv")})
                .code,
            0);
  ASSERT_EQ(run(SYNC_LOGGER, {scene, "--truth", path("machine.csv"), "--estimate", path("both.csv"),
                              "--csv", path("V.csv")})
                .code,
            0);
  const std::vector<std::string> files{scene,
                                       "a machine's=" + path("machine.csv"),
                                       "it_s ^{estimate}=" + path("both.csv"),
                                       "it_s ^{estimate}=" + path("V.csv"),
                                       path("events.csv"),
                                       "it_s ^{estimate}=" + path("impacts.csv")};
  const auto draw = [&](const std::string& name, const test::Arguments& more) {
    test::Arguments arguments = files;
    arguments.insert(arguments.end(), {"--output", path(name)});
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ended ended = run(PLOT, arguments);
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_EQ(ended.err, "") << "gnuplot warns of nothing";
    return read_text(path(name));
  };
  EXPECT_EQ(draw("a.png", {}).substr(1, 3), "PNG");
  EXPECT_EQ(draw("a.pdf", {"--zoom", "0:1"}).substr(0, 5), "%PDF-");
  EXPECT_EQ(draw("b.png", {"--show", "V,g1", "--zoom", "70:80"}).substr(1, 3), "PNG")
      << "an empty panel";
  const std::string svg = draw("a.svg", {"--title", "A run's title"});
  for (const char* text :
       {"a machine's", "it_s ^{estimate}", "A run's title", "gap g2 [m]", "error energy [J]",
        "it_s ^{estimate}, contact 2", "impact, as reported"}) {
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  }
}

TEST_F(PlotTest, ConstantCurveIsCentred) {
  const std::string still =
      file("still.csv", "k,t,q1,u1,still,zero\n0,0,1,0,-0.7,0\n1,3,2,0,-0.7,0\n");
  const Ended ended = run(PLOT, {still, "--show", "still,zero", "--output", path("still.svg")});
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(ended.err, "") << "gnuplot warns of nothing";
  FigureOptions options;
  options.show = {"zero"};
  const Figure of = figure({still}, nullptr, options);
  EXPECT_NE(gnuplot_script(of, path("still.svg")).find("set yrange [-1:1]"), std::string::npos);
}

TEST_F(PlotTest, AMatrixOfTheSceneIsNotOverwritten) {
  const std::string matrix = "1,0\n0,2\n";
  const std::string M = file("M.png", matrix);
  const std::string scene = file("a.toml",
                                 "[system]\nM = 'M.png'\nC = [[1,0],[0,1]]\nK = [[1,0],[0,1]]\n"
                                 "[[contact]]\ndirection = [1,0]\n[impact]\nrestitution = 0.5\n");
  const std::string states = file("s.csv", "k,t,q1,q2,u1,u2\n0,0,1,2,0,0\n1,8,1,2,0,0\n");
  for (const test::Arguments& arguments :
       {test::Arguments{states, scene, "--output", M},
        test::Arguments{path("none.csv"), scene, "--output", path("b.png"), "--report", M}}) {
    const Ended ended = run(PLOT, arguments);
    EXPECT_EQ(ended.code, 2);
    EXPECT_NE(ended.err.find("same file"), std::string::npos) << ended.err;
    EXPECT_EQ(read_text(M), matrix);
  }
  EXPECT_FALSE(std::filesystem::exists(path("b.png")));
  EXPECT_EQ(run(PLOT, {states, scene, "--output", path("b.png")}).code, 0);
}

TEST_F(PlotTest, BadUsageExitsWithTwoAndOverwritesNothing) {
  const std::string states = file("s.csv", "k,t,q1,u1\n0,0,1,2\n1,8,1,2\n");
  const std::vector<test::Arguments> all{
      {states, "--output", path("a.jpg")},
      {states},
      {"label=" + states, "--output", states},
      {states, "--output", path("a.png"), "--zoom", "3:1"},
      {states, "--output", path("a.png"), "--show", "g1"},
      {states, "--output", path("a.png"), "--from", "9"},
      {path("none.csv"), "--output", path("a.png")},
      {SPRAG_SOURCE_DIR "/scenes/two_stops_beam.toml", "--output", path("a.png")}};
  for (const test::Arguments& arguments : all) {
    const Ended ended = run(PLOT, arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err, "");
  }
  EXPECT_EQ(read_text(states).substr(0, 9), "k,t,q1,u1");
}

}  // namespace
}  // namespace sprag::plot
