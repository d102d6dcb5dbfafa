// Consistency of the reports of identify on random records: headline, text, table,
// JSON, exit code and the written scene must agree.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using nlohmann::json;

std::string digits(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

/// A record, the scene to compare with, and the settings.
struct DrawnRecord {
  std::string kind;
  std::string machine, scene;  ///< texts
  double duration;
  std::size_t most;           ///< events
  double jitter;              ///< of the times
  double given_jitter = 0.0;  ///< to the program; 0: none
  test::Arguments of_identify = {};
  int lost = 0, spurious = 0;
};

std::string ball_text(double drag, double restitution, const std::string& more = "") {
  return "[system]\nM = [[1.0]]\nC = [[" + digits(drag) +
         "]]\nK = [[0.0]]\n[[force]]\ndirection = [1.0]\nconstant = -9.81\n[impact]\nlaw = "
         "\"newton\"\nrestitution = " +
         digits(restitution) + "\n[[contact]]\ndirection = [1.0]\n" + more +
         "[master]\nq = [0.4]\n[replica]\n";
}

std::string rattle_text(double k, double restitution, double clearance) {
  return "[system]\nM = [[0.2]]\nK = [[" + digits(k) +
         "]]\nC = [[0.3]]\n[excitation]\ninfluence = 1.0\namplitude = 0.5e-3\nfrequency = 160.0\n"
         "[impact]\nlaw = \"newton\"\nrestitution = " +
         digits(restitution) +
         "\n[[contact]]\ndirection = [1.0]\nclearance = " + digits(clearance) +
         "\nmount = \"frame\"\n[[contact]]\ndirection = [-1.0]\nclearance = 0.5e-3\n"
         "mount = \"frame\"\n[master]\n[replica]\n";
}

std::string oscillator_text(double k, double restitution, double frequency) {
  return "[system]\nM = [[1.0]]\nK = [[" + digits(k) +
         "]]\nC = [[0.6]]\n[[force]]\ndirection = [1.0]\namplitude = 20.0\nfrequency = " +
         digits(frequency) + "\n[impact]\nrestitution = " + digits(restitution) +
         "\n[[contact]]\ndirection = [1.0]\nclearance = 0.01\n[master]\n[replica]\n";
}

std::string text_without_scale(double k, double restitution) {
  return "[system]\nM = [[1.0]]\nC = [[0.05]]\nK = [[" + digits(k) +
         "]]\n[impact]\nrestitution = " + digits(restitution) +
         "\n[[contact]]\ndirection = [1.0]\n[master]\nq = [0.2]\n[replica]\n";
}

std::vector<DrawnRecord> drawn_records(Random& draw) {
  using test::Arguments;
  const double e = draw.uniform(0.85, 0.95), drag = draw.uniform(0.08, 0.2);
  const std::string right = ball_text(drag, e), near = ball_text(1.1 * drag, 0.98 * e);
  const Arguments both{"--free", "impact.restitution,system.C"};
  const double k = 0.2 * std::pow(2.0 * 3.14159 * draw.uniform(3.0, 8.0), 2);
  const double c = draw.uniform(0.3e-3, 0.5e-3), r = draw.uniform(0.5, 0.7);
  const std::string rattle = rattle_text(k, r, c), harder = rattle_text(k, 1.05 * r, c);
  const std::string oscillator = oscillator_text(draw.uniform(350.0, 450.0), 0.7, 30.0);
  const double soft = draw.uniform(100.0, 300.0);
  const auto ball = [](const char* kind, const std::string& machine, const std::string& scene,
                       double jitter, double given, const Arguments& more = {}, int lost = 0,
                       int spurious = 0, std::size_t most = 24) {
    return DrawnRecord{kind, machine, scene, 8.0, most, jitter, given, more, lost, spurious};
  };
  const auto rattled = [&](const char* kind, const std::string& scene, double jitter,
                           const Arguments& more) {
    return DrawnRecord{kind, rattle, scene, 3.0, 60, jitter, 0.0, more};
  };
  const std::string wrong = text_without_scale(1.02 * soft, 0.95);
  DrawnRecord free{"no scale", text_without_scale(soft, 0.95), wrong, 20.0, 20, 1e-4};
  free.of_identify = {"--free", "system.K"};
  return {ball("ball, right, exact", right, right, 0.0, 0.0),
          ball("ball, right, jitter", right, right, 3e-4, 3e-4),
          ball("ball, near, jitter not given", right, near, 3e-4, 0.0, both),
          ball("ball, right, one lost", right, right, 1e-4, 1e-4, {}, 1),
          ball("ball, right, one spurious", right, right, 1e-4, 1e-4, both, 0, 1),
          ball("ball, jitter given too small", right, right, 2e-3, 1e-4, both),
          ball("ball, slight mistake", right, ball_text(drag, 1.0004 * e), 3e-4, 3e-4, both),
          ball("ball without drag", ball_text(0.0, e), ball_text(0.1, 0.98 * e), 5e-4, 5e-4,
               {"--free", "impact.restitution,system.C", "--within", "system.C=4"}, 0, 0, 16),
          rattled("rattle, accepted all the same", harder, 1e-5,
                  {"--free", "system.K", "--within", "0.05", "--accept"}),
          rattled("rattle, beyond the range", rattle_text(1.2 * k, r, c), 1e-5,
                  {"--free", "system.K", "--within", "0.02"}),
          {"oscillator, near a periodic orbit", oscillator, oscillator, 12.0, 60, 1e-4, 1e-4},
          free,
          ball("too few", right, right, 0.0, 0.0, {}, 0, 0, 3)};
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

bool has(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

int count_of(const std::string& text, const std::string& what) {
  int count = 0;
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

/// The row of this name in the table of parameters; empty if there is none.
std::string row_of(const std::string& text, const std::string& name) {
  const auto table = text.find("\nparameter ");
  if (table == std::string::npos) return "";
  for (const std::string& line : lines_of(text.substr(table))) {
    if (line.starts_with(name + " ")) return line;
  }
  return "";
}

class ReportConsistencyTest : public test::ProgramTest {
 protected:
  void write(const DrawnRecord& record, Random& draw) {
    test::write_text(path("scene.toml"), record.scene);
    auto events = test::events_of(parse_scene(record.machine, "machine.toml"), record.duration);
    if (events.size() > record.most) events.resize(record.most);
    for (int i = 0; i < record.lost; ++i) events.erase(events.begin() + 7 + 5 * i);
    double last = 0.0;
    for (ContactEvent& event : events) {
      event.t = last = std::max(last, event.t + record.jitter * draw.normal());
    }
    for (int i = 0; i < record.spurious; ++i) {
      const auto after = events.begin() + 9 + 4 * i;
      const double t = after->t + 0.4 * ((after + 1)->t - after->t);
      events.insert(after + 1, {t, after->contact, ContactEventKind::pulse});
    }
    EventsWriter writer(path("events.csv"));
    for (const ContactEvent& event : events) writer.write(event);
    ASSERT_TRUE(writer.close());
  }

  Ended reported(const char* program, const DrawnRecord& record, test::Arguments more) {
    test::Arguments arguments{path("events.csv"), path("scene.toml"), "--report",
                              path("report.json")};
    if (record.given_jitter > 0.0) {
      arguments.insert(arguments.end(), {"--jitter", digits(record.given_jitter)});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::filesystem::remove(path("report.json"));
    Ended ended = run(program, arguments);
    report_ = json::parse(test::read_text(path("report.json")), nullptr, false);
    return ended;
  }

  void check_identify(const DrawnRecord& record);
  void check_verdict(const Ended& ended);
  void check_parameters(const std::string& text);
  void check_causes(const std::string& text);
  void check_written(const Ended& ended);

  json report_;
};

void ReportConsistencyTest::check_identify(const DrawnRecord& record) {
  test::Arguments more = record.of_identify;
  more.insert(more.end(), {"--output", path("fitted.toml"), "--events", path("mended.csv")});
  std::filesystem::remove(path("fitted.toml"));
  const Ended ended = reported(IDENTIFY, record, more);
  SCOPED_TRACE("identify, " + record.kind + ":\n" + ended.out + ended.err);
  if (ended.code == 1) {
    EXPECT_TRUE(ended.out.empty());
    EXPECT_FALSE(ended.err.empty());
    EXPECT_FALSE(std::filesystem::exists(path("fitted.toml")));
    return;
  }
  std::cout << "identify, " << record.kind << ": " << std::string(report_["verdict"]) << '\n';
  check_verdict(ended);
  check_parameters(ended.out);
  check_causes(ended.out);
  check_written(ended);
}

// Exit code, JSON and each sentence give the same verdict.
void ReportConsistencyTest::check_verdict(const Ended& ended) {
  const bool fits = report_["fits"], accepted = report_["accepted"];
  const std::string text = ended.out, headline = lines_of(text).at(0);
  EXPECT_EQ(ended.code, accepted ? 0 : 3);
  EXPECT_EQ(report_["exit"], ended.code);
  EXPECT_TRUE(headline.ends_with(": " + std::string(report_["verdict"])));
  EXPECT_EQ(has(headline, "the events fit"), fits);
  EXPECT_EQ(has(headline, "no fit") || has(headline, "no unique fit"), !fits);
  EXPECT_EQ(has(headline, "taken as an effective model"), accepted && !fits);
  EXPECT_EQ(count_of(text, "the events fit"), fits ? 1 : 0);
  EXPECT_EQ(report_["problem"] == "none", fits);
  EXPECT_EQ(report_.contains("reason"), !fits);
  if (!fits) {
    EXPECT_EQ(lines_of(text).at(1), std::string(report_["reason"]));
  }
  EXPECT_FALSE(has(text, "nan"));
  EXPECT_FALSE(has(text, "inf"));
  if (fits) {
    EXPECT_GE(report_["used_share"].get<double>(), 0.9);
    EXPECT_FALSE(has(text, "wrong"));
    EXPECT_FALSE(has(text, "does not predict"));
  }
  const bool converged = report_["problem"] != "no_convergence";
  EXPECT_EQ(has(text, "\nparameter "), converged);
  EXPECT_EQ(has(text, "Start at t = "), accepted);
  EXPECT_EQ(report_["start"].is_null(), !accepted);
  for (const char* number : {"scatter", "chi2", "predicted"}) {
    EXPECT_EQ(report_[number].is_null(), !converged) << number;
  }
  if (!converged) return;
  const std::string found = short_number(report_["scatter"], 3) + " s as found.";
  if (report_["jitter_told"].get<bool>()) {
    const std::string given = short_number(report_["jitter"], 3) + " s as specified, scatter ";
    EXPECT_TRUE(has(text, ", jitter " + given + found)) << text;
  } else if (!has(text, "exact times (scatter")) {
    EXPECT_TRUE(has(text, (fits ? ", jitter " : ", scatter ") + found)) << text;
  }
  EXPECT_EQ(has(text, "s as specified"), report_["jitter_told"].get<bool>());
  if (report_["jitter_told"].get<bool>() && fits) {
    EXPECT_LE(report_["chi2"].get<double>(), report_["largest_chi2"].get<double>());
  }
  EXPECT_EQ(count_of(text, "Missing: "), static_cast<int>(report_["missing"].size()));
  EXPECT_EQ(count_of(text, "Spurious: "), static_cast<int>(report_["spurious"].size()));
}

// A parameter that is not determined has no value anywhere; a determined one has the same value
// everywhere.
void ReportConsistencyTest::check_parameters(const std::string& text) {
  int determined = 0;
  for (const auto& of : report_["parameters"]) {
    const std::string key = of["parameter"], row = row_of(text, key);
    if (of["determined"] == true) {
      ++determined;
      EXPECT_FALSE(has(row, "not determined")) << row;
      EXPECT_LE(of["low"].get<double>(), of["value"].get<double>());
      EXPECT_LE(of["value"].get<double>(), of["high"].get<double>());
      const bool at_bound = of["at_bound"];
      EXPECT_EQ(has(row, "(95 %)"), at_bound) << row;
      EXPECT_EQ(has(row, " +- "), !at_bound) << row;
      EXPECT_EQ(of["sigma"].is_null(), at_bound);
      continue;
    }
    EXPECT_TRUE(row.empty() || has(row, "not determined")) << row;
    EXPECT_FALSE(has(row, "+-") || has(row, "%")) << row;
    for (const char* number : {"value", "sigma", "low", "high"}) {
      EXPECT_TRUE(of[number].is_null()) << key << ' ' << number;
    }
  }
  if (report_["problem"] == "no_convergence") {
    EXPECT_EQ(determined, 0);
  }
  if (report_["fits"] == false || report_["parameters"].empty()) return;
  const std::string headline = lines_of(text).at(0);
  const int others = static_cast<int>(report_["parameters"].size()) - determined;
  const std::string found = std::to_string(determined) + " parameter";
  EXPECT_EQ(has(headline, found + " as found") || has(headline, found + "s as found"),
            determined > 0);
  EXPECT_EQ(has(headline, "determine none of the parameters"), determined == 0);
  EXPECT_EQ(has(headline, std::to_string(others) + " not determined"),
            others > 0 && determined > 0);
}

// Causes are given only of a fit, and agree with its values.
void ReportConsistencyTest::check_causes(const std::string& text) {
  const bool none = has(text, "No single parameter and no pair");
  const bool as_is = has(text, "The scene as it is explains");
  const bool alone = has(text, " alone explain");
  EXPECT_LE(none + as_is + alone, 1);
  EXPECT_EQ(none || as_is || alone, report_.contains("simplest"));
  if (report_["fits"] == false) {
    EXPECT_FALSE(none || as_is || alone);
  }
  if (has(text, "the events fit the scene as it is")) {
    EXPECT_FALSE(none || alone);
  }
  if (as_is) {
    for (const auto& of : report_["parameters"]) {
      if (of["sigma"].is_null()) continue;
      const double off = std::abs(of["value"].get<double>() - of["nominal"].get<double>());
      const double rounding = 1e-9 * std::abs(of["nominal"].get<double>()) + 1e-12;
      EXPECT_LE(off, 6.0 * of["sigma"].get<double>() + rounding) << of.dump();
    }
  }
  if (!alone) return;
  for (const auto& cause : report_["simplest"].at(0)) {
    EXPECT_EQ(cause["determined"], true);
    EXPECT_TRUE(has(text, std::string(cause["parameter"]) + " "));
  }
}

// The written scene contains exactly the fitted values.
void ReportConsistencyTest::check_written(const Ended& ended) {
  ASSERT_EQ(std::filesystem::exists(path("fitted.toml")), ended.code == 0);
  EXPECT_EQ(has(ended.err, "fitted.toml is not written: the events do not fit"), ended.code != 0);
  if (ended.code != 0) return;
  const Scene fitted = read_scene(path("fitted.toml"));
  const Scene scene = read_scene(path("scene.toml"));
  const auto& listed = fitted.prior.parameters.keys;
  for (const auto& of : report_["parameters"]) {
    const std::string key = of["parameter"];
    SCOPED_TRACE(key);
    const bool determined = of["determined"];
    const bool is_listed = std::find(listed.begin(), listed.end(), key) != listed.end();
    EXPECT_EQ(is_listed, determined && of["sigma"].is_number());
    const double nominal = of["nominal"], value = determined ? of["value"].get<double>() : nominal;
    const double tolerance = determined ? 1e-9 * std::abs(value) + 1e-12 : 0.0;
    // A factor is 1 in the written scene.
    if (key == "system.K") {
      EXPECT_NEAR(fitted.model.K(0, 0), value * scene.model.K(0, 0),
                  tolerance * scene.model.K(0, 0));
    } else if (key == "system.C") {
      EXPECT_NEAR(fitted.model.C(0, 0), value * scene.model.C(0, 0), tolerance);
    } else if (quantity(key) != "phase") {
      EXPECT_NEAR(parameter_of(fitted, key).nominal, value, tolerance);
    }
  }
  if (report_["fits"] == false) {
    EXPECT_EQ(fitted.prior.jitter, report_["scatter"]);
  }
  const std::string mended = test::read_text(path("mended.csv"));
  EXPECT_TRUE(mended.starts_with("t,contact,closed,note\n"));
  EXPECT_EQ(count_of(mended, ",1,lost\n"), static_cast<int>(report_["missing"].size()));
  EXPECT_EQ(count_of(mended, ",1,spurious\n"), static_cast<int>(report_["spurious"].size()));
}

TEST_F(ReportConsistencyTest, ReportsAreConsistent) {
  const unsigned seed = 49;
  std::cout << "seed " << seed << '\n';
  Random draw(seed);
  for (const DrawnRecord& record : drawn_records(draw)) {
    write(record, draw);
    check_identify(record);
  }
}

}  // namespace
}  // namespace sprag
