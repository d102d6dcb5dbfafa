// report: figures that it computes, HTML without markup of others, and the program with real files
// of machines other than the paper's beam.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>

#include "sprag/detail/identification/verdict.h"
#include "tests/support/program_test.h"
#include "tools/report/analysis.h"
#include "tools/report/html.h"
#include "tools/report/sections.h"

namespace sprag::report {
namespace {

using test::Arguments;
using test::read_text;
using test::write_text;

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

Residuals unit_residuals(std::vector<double> values) {
  Residuals residuals;
  for (const double value : values) {
    residuals.t.push_back(static_cast<double>(residuals.t.size()));
    residuals.value.push_back(value);
    residuals.sigma.push_back(1.0);
    residuals.contact.push_back(1);
  }
  return residuals;
}

// The test of sigma passes in 95 % of the runs with a right sigma, and in few others.
TEST(ReportAnalysis, ConsistencyRefutesAWrongSigma) {
  constexpr unsigned seed = 29;
  std::cout << "seed " << seed << '\n';
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  constexpr int runs = 4000;
  for (const std::size_t n : {10u, 60u, 400u}) {
    int right = 0, too_small = 0;
    for (int run = 0; run < runs; ++run) {
      std::vector<double> values(n);
      for (double& value : values) value = normal(engine);
      right += consistency(unit_residuals(values))->holds() ? 1 : 0;
      for (double& value : values) value *= 2.0;
      too_small += consistency(unit_residuals(values))->holds() ? 1 : 0;
    }
    EXPECT_NEAR(right, 0.95 * runs, 4.0 * std::sqrt(0.95 * 0.05 * runs) + 0.002 * runs) << n;
    EXPECT_LT(too_small, n == 10u ? 0.4 * runs : 0.01 * runs) << n;
  }
  EXPECT_FALSE(consistency(unit_residuals(std::vector<double>(fewest_residuals - 1, 1.0))));
}

class ReportTest : public test::ProgramTest {
 protected:
  std::string file(const std::string& name, const std::string& text) {
    return write_text(path(name), text);
  }
  plot::Table table(const std::string& name, const std::string& text) {
    return plot::read_table(file(name, text));
  }

  /// Runs a scene with jitter of event times and returns the files of the run.
  Arguments run_files(const std::string& scene_name, double jitter, const std::string& duration);

  Ended report(Arguments files, const Arguments& more = {}) {
    files.insert(files.end(), {"--output", path("r.html")});
    files.insert(files.end(), more.begin(), more.end());
    return run(REPORT, files);
  }
  std::string page() const { return read_text(path("r.html")); }

  std::string scene_;
};

Arguments ReportTest::run_files(const std::string& scene_name, double jitter,
                                const std::string& duration) {
  const std::string text = read_text(SPRAG_SOURCE_DIR "/scenes/" + scene_name + ".toml");
  scene_ = file("scene.toml", text + "\n[events]\njitter = " + std::to_string(jitter) + "\n");
  const auto expect_done = [this](const std::string& program, const Arguments& arguments) {
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 0) << ended.err;
  };
  expect_done(MASTER_SIM, {scene_, "--duration", duration, "--speed", "max", "--no-lcm", "--tick",
                           "0.01", "--events", path("exact.csv"), "--states", path("machine.csv")});
  // Pulses, which take two rows, get one error.
  constexpr unsigned seed = 11;
  std::cout << "seed " << seed << '\n';
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  std::string rows = "t,contact,closed\n";
  const plot::Table exact = plot::read_table(path("exact.csv"));
  double late = 0.0;
  for (std::size_t k = 0; k < exact.column("t")->size(); ++k) {
    const bool closed = (*exact.column("closed"))[k] > 0.5;
    if (closed) late = jitter * normal(engine);
    char row[64];
    std::snprintf(row, sizeof row, "%.12f,%d,%d\n", (*exact.column("t"))[k] + late,
                  static_cast<int>((*exact.column("contact"))[k]), closed ? 1 : 0);
    rows += row;
  }
  file("events.csv", rows);
  expect_done(OBSERVER,
              {scene_, "--replay", path("events.csv"), "--duration", duration, "--tick", "0.01",
               "--states", path("states.csv"), "--impacts", path("impacts.csv"), "--predict", "0.5",
               "--predictions", path("predictions.csv"), "--report", path("observer.json")});
  expect_done(SYNC_LOGGER, {scene_, "--truth", path("machine.csv"), "--estimate",
                            path("states.csv"), "--csv", path("V.csv")});
  return {scene_,
          path("events.csv"),
          path("states.csv"),
          path("impacts.csv"),
          path("predictions.csv"),
          path("machine.csv"),
          path("V.csv"),
          path("observer.json")};
}

/// No script, nothing that is loaded, one element of each identifier, and closed elements.
void expect_self_contained(const std::string& html) {
  for (const char* part : {"<script", "<link", "<img", "<iframe", "<object", "http://", "https://",
                           "@import", "javascript:", "onload", "<?xml", "<!ENTITY"}) {
    EXPECT_FALSE(has(html, part)) << part;
  }
  EXPECT_EQ(count_of(html, "<svg"), count_of(html, "</svg>"));
  EXPECT_EQ(count_of(html, "<table"), count_of(html, "</table>"));
  EXPECT_EQ(count_of(html, "<section"), count_of(html, "</section>"));
  EXPECT_TRUE(html.ends_with("</html>\n"));
  std::vector<std::string> identifiers;
  for (const std::string& begin : {std::string(" id=\""), std::string(" id='")}) {
    for (std::size_t at = html.find(begin); at != std::string::npos;
         at = html.find(begin, at + 1)) {
      const std::size_t from = at + begin.size();
      identifiers.push_back(html.substr(from, html.find(begin.back(), from) - from));
    }
  }
  std::sort(identifiers.begin(), identifiers.end());
  EXPECT_EQ(std::adjacent_find(identifiers.begin(), identifiers.end()), identifiers.end());
}

TEST_F(ReportTest, PulsesAreOneEvent) {
  const auto events = reported_events(
      table("e.csv", "t,contact,closed\n1,1,1\n1,1,0\n2,2,1\n2,1,1\n2,1,0\n3,2,0\n"));
  ASSERT_EQ(events.size(), 4u);
  EXPECT_EQ(events[0].kind, plot::impact_kind);
  EXPECT_EQ(events[1].kind, plot::closes_kind);
  EXPECT_EQ(events[1].contact, 2);
  EXPECT_EQ(events[2].kind, plot::impact_kind);
  EXPECT_EQ(events[3].kind, plot::opens_kind);
  const auto of_impacts = reported_events(table("i.csv", "t,contact,kind\n1,2,opens\n"));
  ASSERT_EQ(of_impacts.size(), 1u);
  EXPECT_EQ(of_impacts[0].kind, plot::opens_kind);
}

TEST_F(ReportTest, SpuriousRowsOfAMendedFileAreLeftOut) {
  const plot::Table mended =
      table("m.csv",
            "t,contact,closed,note\n1,1,1,\n1,1,0,\n2,1,1,spurious\n2,1,0,spurious\n3,1,1,lost\n"
            "3,1,0,lost\n");
  EXPECT_EQ(reported_events(mended).size(), 2u);
  EXPECT_EQ(mended.left_out, 2u);
}

TEST_F(ReportTest, InnovationsAreThoseOfEachReportedClosing) {
  const Residuals all =
      innovations(table("s.csv",
                        "k,t,q1,u1,closing_t,closing_contact,filter_gap,sigma_filter_gap\n"
                        "0,0,0,0,-1,0,0,0\n1,1,0,0,0.5,2,0.25,0.5\n2,2,0,0,0.5,2,0.25,0.5\n"
                        "3,3,0,0,2.5,1,1,0\n"));
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all.t, (std::vector<double>{0.5, 2.5}));
  EXPECT_EQ(all.contact, (std::vector<int>{2, 1}));
  const Residuals unit = normalized(all);
  EXPECT_EQ(unit.value, (std::vector<double>{0.5})) << "without a sigma there is none";
}

TEST_F(ReportTest, PredictionsAreComparedWithTheNextEvent) {
  const plot::Table predictions = table("p.csv",
                                        "made_at,certain_until,t,contact,kind,sigma_t\n"
                                        "0.5,1,,,,\n"
                                        "1.5,3,2.1,1,impact,0.3\n"
                                        "1.5,3,2.9,2,impact,0.4\n"
                                        "2.5,4,3.2,1,impact,0.1\n"
                                        "3.5,5,4.5,1,opens,0.1\n"
                                        "5.5,6,5.9,1,impact,0.1\n");
  const std::vector<ReportedEvent> events{{1.0, 1, plot::impact_kind},
                                          {2.0, 1, plot::closes_kind},
                                          {3.0, 2, plot::impact_kind},
                                          {4.0, 1, plot::opens_kind}};
  const PredictionCheck check = check_predictions(predictions, events, 0.4);
  EXPECT_EQ(check.none, 1u);
  EXPECT_EQ(check.others, 1u) << "of contact 1 where contact 2 was next";
  EXPECT_EQ(check.open_end, 1u);
  ASSERT_EQ(check.errors.size(), 2u);
  EXPECT_NEAR(check.errors.value[0], -0.1, 1e-12);
  EXPECT_NEAR(check.errors.sigma[0], 0.5, 1e-12) << "with the jitter";
  EXPECT_EQ(check.errors.t[1], 4.0);
}

TEST_F(ReportTest, TextIsEscapedInOnePlace) {
  EXPECT_EQ(escaped("<b a='1' c=\"2\">&amp;\n\x1b"),
            "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp;amp;\\n\\x1b");
  const std::string svg =
      "<?xml version='1.0'?>\n<svg \n width=\"9\" viewBox=\"0 0 9 7\"\n>\n<title>Gnuplot</title>"
      "<circle id='gpDot'/><use xlink:href='#gpDot' id='b'/><g fill=\"url(#b)\"/>"
      "<text> id='x' href='#y</text></svg>\n";
  EXPECT_EQ(inline_svg(svg, "p1_", "a \"label\""),
            "<svg viewBox=\"0 0 9 7\" role=\"img\" aria-label=\"a &quot;label&quot;\">"
            "<circle id='p1_gpDot'/><use xlink:href='#p1_gpDot' id='p1_b'/>"
            "<g fill=\"url(#p1_b)\"/><text> id='x' href='#y</text></svg>");
  EXPECT_THROW(inline_svg("no picture", "p", ""), std::runtime_error);
}

// A rig of two masses: every section, with the figures of the files.
TEST_F(ReportTest, ReportOfARunHasEverySection) {
  const Arguments files = run_files("lab_rig", 2e-5, "12");
  const Ended ended = report(files, {"--report", path("own.json")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.err, "") << "gnuplot warns of nothing";
  const std::string html = page();
  expect_self_contained(html);
  for (const char* title :
       {"Machine and scene", "What was measured", "Motion", "Predicted and measured events",
        "Impact velocities", "Error energy V and bound B", "Inconsistencies",
        "Files, versions and command lines"}) {
    EXPECT_TRUE(has(html, std::string("<h2>") + title + "</h2>")) << title;
  }
  EXPECT_EQ(count_of(html, "<svg"), 5u);
  EXPECT_TRUE(has(html, "general system M, C, K"));
  EXPECT_TRUE(has(html, "4.5 Hz"));
  EXPECT_TRUE(has(html, ">gap g ["));
  const auto figures = nlohmann::json::parse(read_text(path("observer.json")));
  EXPECT_EQ(figures["confidence"]["inconsistencies"], 0);
  const std::size_t closings = count_of(read_text(path("events.csv")), ",1,1\n");
  EXPECT_TRUE(has(html, "None of the " + std::to_string(closings) +
                            " closings contradicts the filter&#39;s estimate."));
  EXPECT_TRUE(has(html, "<td>events taken</td><td class=\"number\">" + figures["events"].dump() +
                            "</td>") ||
              has(html, "<td>events taken</td><td>" + figures["events"].dump() + "</td>"));
  const plot::Table V = plot::read_table(path("V.csv"));
  EXPECT_TRUE(has(html, rounded(V.column("V")->back(), 4)));
  EXPECT_TRUE(has(html, "sprag observer " + scene_ + " --replay ")) << "the command line";
  EXPECT_TRUE(has(html, "innovations are within 2 sigma"));
  EXPECT_TRUE(has(html, "Sigma passes this test."));
  EXPECT_FALSE(has(html, "<h2>Identification</h2>"));
  const auto own = nlohmann::json::parse(read_text(path("own.json")));
  EXPECT_EQ(own["sections"].size(), 8u);
  // The same files give the same page.
  ASSERT_EQ(report(files).code, 0);
  EXPECT_EQ(page(), html);
}

// With a sigma that is too small the test of sigma fails.
TEST_F(ReportTest, AWrongSigmaIsReported) {
  Arguments files = run_files("lab_rig", 2e-5, "12");
  const plot::Table states = plot::read_table(path("states.csv"));
  const auto index = static_cast<std::size_t>(
      std::find(states.names.begin(), states.names.end(), "sigma_filter_gap") -
      states.names.begin());
  std::string text;
  for (const std::string& name : states.names) text += (text.empty() ? "" : ",") + name;
  for (std::size_t k = 0; k < states.columns[0].size(); ++k) {
    std::string row;
    for (std::size_t i = 0; i < states.names.size(); ++i) {
      const double value = states.columns[i][k] * (i == index ? 0.3 : 1.0);
      char cell[40];
      std::snprintf(cell, sizeof cell, "%s%.17g", i > 0 ? "," : "\n", value);
      row += cell;
    }
    text += row;
  }
  files[2] = file("wrong.csv", text + "\n");
  ASSERT_EQ(report(files).code, 0);
  EXPECT_TRUE(has(page(), "less certain than it claims"));
}

// Rounding errors are no test of sigma.
TEST_F(ReportTest, SigmaOfExactTimesIsNotTested) {
  Arguments files = run_files("lab_rig", 0.0, "5");
  files[0] = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  ASSERT_EQ(report(files).code, 0);
  EXPECT_TRUE(has(page(), "Whether sigma is right is not tested."));
  EXPECT_FALSE(has(page(), "this test"));
}

TEST_F(ReportTest, ReportOfAnIdentificationHasParametersAndResiduals) {
  run_files("lab_rig", 2e-5, "30");
  const std::string nominal = read_text(scene_);
  const auto at = nominal.find("restitution = 0.6");
  ASSERT_NE(at, std::string::npos);
  std::string wrong = nominal;
  wrong.replace(at, 17, "restitution = 0.55");
  const std::string scene = file("wrong.toml", wrong);
  for (const bool as_report : {true, false}) {
    const Arguments arguments{path("events.csv"), scene, "--free",
                              "impact.restitution,system.K,system.C"};
    Arguments all = arguments;
    if (as_report) {
      all.insert(all.end(), {"--report", path("identify.json")});
    } else {
      all.emplace_back("--json");
    }
    const Ended identified = run(IDENTIFY, all);
    ASSERT_EQ(identified.code, 0) << identified.out << identified.err;
    if (!as_report) file("identify.json", identified.out);
    const Ended ended = report({scene, path("events.csv"), path("identify.json")});
    ASSERT_EQ(ended.code, 0) << ended.err;
    const std::string html = page();
    expect_self_contained(html);
    EXPECT_TRUE(has(html, "<strong>The events fit, with 3 parameters as found.</strong>"));
    EXPECT_TRUE(has(html, "predicts the impacts of the last fifth within"));
    EXPECT_EQ(count_of(html, "<svg"), 3u) << "intervals, correlations and residuals";
    EXPECT_TRUE(has(html, "Fitted values with 95 % intervals"));
    EXPECT_TRUE(has(html, "impact.restitution"));
    EXPECT_TRUE(has(html, ">1.00<")) << "the diagonal of the correlations";
    EXPECT_TRUE(has(html, "residuals are within 2 sigma"));
    EXPECT_FALSE(has(html, "<h2>Motion</h2>"));
    EXPECT_EQ(has(html, "sprag identify "), as_report) << "--json has no command line";
  }
}

TEST(RoundedToSigma, ShowsTwoDigitsOfSigma) {
  EXPECT_EQ(rounded_to_sigma(0.650071234, 6e-5), "0.650071");
  EXPECT_EQ(rounded_to_sigma(1.1457, 0.26), "1.15");
  EXPECT_EQ(rounded_to_sigma(-1.1457, 0.1), "-1.15");
  EXPECT_EQ(rounded_to_sigma(1.000200012345, 1e-9), "1.000200012") << "no more than ten digits";
  EXPECT_EQ(rounded_to_sigma(3e-6, 7.2e-6), "3e-06");
  EXPECT_EQ(rounded_to_sigma(-0.0, 1.0), "0");
  EXPECT_EQ(rounded_to_sigma(0.123456789, 0.0), "0.123457");
}

TEST_F(ReportTest, RefusedIdentificationHasItsReason) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string json = file(
      "i.json",
      R"({"program": "identify", "version": "9", "scene": "other", "verdict": "the events do not fit",
          "fits": false, "problem": "wrong_model", "reason": "They scatter.", "parameters": [],
          "missing": [{"t": 3.25, "contact": 1}], "exit": 3})");
  ASSERT_EQ(report({scene, json}).code, 0);
  const std::string html = page();
  EXPECT_TRUE(has(html, "class=\"verdict bad\""));
  EXPECT_TRUE(has(html, "<strong>The events do not fit.</strong> They scatter."));
  EXPECT_TRUE(has(html, "The identification was of the scene other"));
  EXPECT_TRUE(has(html, "3.25"));
  EXPECT_TRUE(has(html, "lost: the machine has an impact there"));
}

TEST_F(ReportTest, InconsistenciesAreListedWithTheirTimes) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string json =
      file("o.json",
           R"({"program": "observer", "version": "9", "settled_tick": 10, "confidence": {
          "inconsistencies": 7, "first_inconsistencies": [
          {"t": 4.75, "contact": 1, "suspicion": "missing event", "known_loss": true,
           "square_over_variance": 123.0}]}, "degraded": [{"from": 4.5, "to": 4.875}], "exit": 0})");
  ASSERT_EQ(report({scene, json}).code, 0);
  const std::string html = page();
  EXPECT_TRUE(has(html, "gate failed 7 times, first at t = 4.75 s, contact 1"));
  EXPECT_TRUE(has(html, "<td class=\"number\">4.75</td>"));
  EXPECT_TRUE(has(html, "<td>missing event</td>"));
  EXPECT_TRUE(has(html, "The first 1 of 7."));
  EXPECT_TRUE(has(html, "4.875"));
}

// Names with markup, terminal escapes and commands in every text that a report shows.
TEST_F(ReportTest, HostileNamesAreText) {
  const std::string evil = "</title><script>alert(1)</script>&#x27;\"'`touch ran`\n\x1b[31m]]>";
  const std::string scene =
      file("a.toml", "name = " + nlohmann::json(evil).dump() +
                         "\n[system]\nM = [[1]]\nC = [[1]]\nK = [[1]]\n[[contact]]\n"
                         "direction = [1]\n[impact]\nrestitution = 0.5\n");
  const std::string states = file("s.csv",
                                  "k,t,q1,u1,B,sigma_q1,<script>x,sigma_<script>x\n"
                                  "0,0,1,2,1,1,1,1\n1,8,3,4,1,1,2,1\n");
  const nlohmann::json identified{
      {"program", "identify"},
      {"version", evil},
      {"command", {evil, "--free", evil}},
      {"scene", evil},
      {"verdict", evil},
      {"fits", false},
      {"problem", evil},
      {"reason", evil},
      {"parameters",
       {{{"parameter", evil},
         {"unit", evil},
         {"determined", true},
         {"value", 1.0},
         {"nominal", 2.0}},
        {{"parameter", "b"}, {"determined", true}, {"value", 1.0}, {"nominal", 2.0}}}},
      {"correlations", {{1.0, 0.5}, {0.5, 1.0}}},
      {"held", evil}};
  const nlohmann::json observed{
      {"program", "observer"},
      {"version", evil},
      {"skipped", {{evil, 3}}},
      {"confidence",
       {{"inconsistencies", 2},
        {"first_inconsistencies", {{{"t", 1.0}, {"contact", 1}, {"suspicion", evil}}}}}}};
  const std::string i = file("i.json", identified.dump());
  const std::string name = "<img src=x onerror=alert(1)>.json";
  file(name, observed.dump());
  const Ended ended = report({scene, evil + "=" + states, i, path(name)}, {"--title", evil});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const std::string html = page();
  expect_self_contained(html);
  EXPECT_FALSE(has(html, "<img"));
  EXPECT_FALSE(has(html, "\x1b"));
  EXPECT_FALSE(has(html, "alert(1)</script>"));
  EXPECT_TRUE(has(html, "<h1>&lt;/title&gt;&lt;script&gt;alert(1)"));
  EXPECT_FALSE(std::filesystem::exists(path("ran")));
}

// Reports of another version or of another program may have any JSON.
TEST_F(ReportTest, AnyJsonIsAReportOrRefused) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string o =
      file("o.json",
           R"({"program":"observer","events":"many","skipped":[1],"degraded":{"a":1},"command":7,
          "confidence":{"inconsistencies":"x","first_inconsistencies":[3,{"t":"x"}],"bound":[]}})");
  const std::string i =
      file("i.json",
           R"({"program":"identify","verdict":3,"parameters":[1,{"parameter":4,"determined":true},
          {"value":"x"}],"correlations":[[1],[2,"x"],3],"residuals":{"t":[1,"x",3],"contact":[-1,2,99],
          "residual":[1,2,3],"sigma":[0,null,1]},"missing":7,"drift":{"value":1},"others":3})");
  EXPECT_EQ(report({scene, o, i}).code, 0);
  struct Case {
    const char *text, *expected;
  };
  for (const Case& of : {Case{"{", "is no complete JSON"}, Case{"{\"a\": 1}", "has no key program"},
                         Case{"{\"program\": 3}", "has no key program"},
                         Case{"{\"program\": \"\xff\"}", "is no complete JSON"},
                         Case{"a,b\n1,2\n", "the header begins neither"}, Case{"", "the header"}}) {
    const std::string bad = file("bad.json", of.text);
    std::filesystem::remove(path("r.html"));
    const Ended ended = report({scene, bad});
    EXPECT_EQ(ended.code, 2) << of.text << ended.err;
    EXPECT_TRUE(has(ended.err, bad)) << ended.err;
    EXPECT_TRUE(has(ended.err, of.expected)) << ended.err;
    EXPECT_TRUE(has(ended.err, "expected a scene, a CSV of states")) << ended.err;
    EXPECT_FALSE(std::filesystem::exists(path("r.html")));
  }
}

TEST_F(ReportTest, BadUsageExitsWithTwoAndKeepsAnOldReport) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string states = file("s.csv", "k,t,q1,q2,u1,u2,B\n0,0,1,2,0,0,1\n1,8,1,2,0,0,1\n");
  file("r.html", "old");
  struct Case {
    Arguments files, more;
    std::string expected;
  };
  for (const Case& of :
       {Case{{scene, path("none.csv")}, {}, path("none.csv")},
        Case{{scene, path("none.json")}, {}, "expected a scene, a CSV of states"},
        Case{{scene}, {}, "no file of a run is given"}, Case{{states}, {}, "no scene is given"},
        Case{{scene, scene, states}, {}, "is a second scene"},
        Case{{"lab_rog", states}, {}, "did you mean lab_rig?"},
        Case{{scene, states}, {"--from", "9"}, "nothing to show"},
        Case{{scene, states}, {"--format", "doc"}, "choose html or pdf"}}) {
    const Ended ended = report(of.files, of.more);
    EXPECT_EQ(ended.code, 2) << of.expected << ": " << ended.err;
    EXPECT_TRUE(has(ended.err, of.expected)) << ended.err;
    EXPECT_EQ(page(), "old");
  }
  const Ended other = run(REPORT, {scene, states, "--output", path("r.doc")});
  EXPECT_EQ(other.code, 2);
  EXPECT_TRUE(has(other.err, "must end in .html or .pdf")) << other.err;
  const Ended same = run(REPORT, {scene, states, "--output", states, "--format", "html"});
  EXPECT_EQ(same.code, 2);
  EXPECT_TRUE(has(same.err, "are the same file")) << same.err;
  // States of another machine.
  const std::string foreign = file("f.csv", "k,t,q1,u1,B\n0,0,1,2,1\n1,8,1,2,1\n");
  const Ended wrong = report({scene, foreign});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_TRUE(has(wrong.err, "has 1 coordinates; the scene has 2")) << wrong.err;
  EXPECT_EQ(page(), "old");
}

TEST_F(ReportTest, ADamagedFileIsShownUpToTheDamage) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string states =
      file("s.csv", "k,t,q1,q2,u1,u2,B\n0,0,1,2,0,0,1\n1,8,1,2,0,0,1\n2,9,1\n");
  const Ended ended = report({scene, states});
  EXPECT_EQ(ended.code, 1);
  EXPECT_TRUE(has(ended.err, states + ": damaged from line 4 on")) << ended.err;
  EXPECT_TRUE(has(page(), "damaged from line 4 on"));
  EXPECT_TRUE(has(page(), "states of an estimate, 2 rows"));
}

TEST_F(ReportTest, PdfIsMadeByChromium) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const std::string states = file("s.csv", "k,t,q1,q2,u1,u2,B\n0,0,1,2,0,0,1\n1,8,1,2,0,0,1\n");
  // With gnuplot alone in the PATH.
  const std::string gnuplot = "/usr/bin/gnuplot";
  if (!std::filesystem::exists(gnuplot)) GTEST_SKIP() << "no gnuplot in /usr/bin";
  std::filesystem::create_directory(path("bin"));
  std::filesystem::create_symlink(gnuplot, path("bin/gnuplot"));
  const Ended none = run("/usr/bin/env",
                         {"PATH=" + path("bin"), REPORT, scene, states, "--output", path("r.pdf")});
  EXPECT_EQ(none.code, 1);
  EXPECT_TRUE(has(none.err, "install Debian's package chromium")) << none.err;
  EXPECT_FALSE(std::filesystem::exists(path("r.pdf")));
  // A program that fails.
  file("bin/chromium", "#!/bin/sh\nexit 3\n");
  std::filesystem::permissions(path("bin/chromium"), std::filesystem::perms::owner_all);
  const Ended failed = run(
      "/usr/bin/env", {"PATH=" + path("bin"), REPORT, scene, states, "--output", path("r.pdf")});
  EXPECT_EQ(failed.code, 1);
  EXPECT_TRUE(has(failed.err, "chromium has failed to convert")) << failed.err;
  if (!std::filesystem::exists("/usr/bin/chromium")) GTEST_SKIP() << "no chromium";
  const Ended ended = run(REPORT, {scene, states, "--format", "pdf", "--output", path("a name")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(read_text(path("a name")).substr(0, 5), "%PDF-");
}

}  // namespace
}  // namespace sprag::report
