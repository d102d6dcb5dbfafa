// The core of listen: lines, the device's clock, edges to events as those of a recording.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "command_line/program.h"
#include "sprag/detail/import/recorded_edges.h"
#include "tests/support/random.h"
#include "tools/listen/arrival_scatter.h"
#include "tools/listen/intake.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using Texts = std::vector<std::string>;

constexpr double unpaced = std::numeric_limits<double>::infinity();

/// Keeps all that an intake gives, and checks that the watermark keeps its promise.
class Kept : public IntakeSink {
 public:
  void events(std::span<const ContactEvent> given, double watermark) override {
    EXPECT_GE(watermark, watermark_);
    for (const ContactEvent& event : given) {
      EXPECT_GT(event.t, watermark_) << "an event that was promised before";
      EXPECT_LE(event.t, watermark);
      sessions.back().push_back(event);
    }
    watermark_ = watermark;
  }
  void start_input(double t0, double dt) override { inputs.push_back({t0, dt, {}}); }
  void sample(std::int64_t k, double value) override {
    inputs.back().samples.push_back({k, value});
  }
  void new_session() override {
    sessions.emplace_back();
    watermark_ = -1.0;
  }
  void problem(const LineProblem& problem) override {
    problems.push_back(std::to_string(problem.number) + ": " + problem.text + ": " + problem.why);
  }
  void notice(const std::string& text) override { notices.push_back(text); }

  struct Input {
    double t0, dt;
    std::vector<std::pair<std::int64_t, double>> samples;
  };

  std::vector<std::vector<ContactEvent>> sessions{{}};
  std::vector<Input> inputs;  // one for each session with samples
  Texts problems, notices;
  double watermark() const { return watermark_; }

 private:
  double watermark_ = -1.0;
};

std::string seeded(std::uint64_t seed) { return "seed " + std::to_string(seed); }

struct Row {
  double t;
  std::vector<int> levels;
};

std::string text_of(double t) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9f", t);
  return text;
}

/// Rows of levels that bounce, on a grid of 0.5 ms, so that times equal limits.
std::vector<Row> random_rows(Random& random, int contacts, int count) {
  std::vector<Row> rows;
  Row row{random.integer(-100, 100) / 2e3, std::vector<int>(static_cast<std::size_t>(contacts))};
  for (int& level : row.levels) level = random.integer(0, 1);
  for (int i = 0; i < count; ++i) {
    rows.push_back(row);
    row.t = std::round(2e3 * row.t +
                       (random.chance(0.6) ? random.integer(1, 8) : random.integer(1, 400))) /
            2e3;
    int& level = row.levels[static_cast<std::size_t>(random.integer(0, contacts - 1))];
    if (random.chance(0.9)) level = 1 - level;
  }
  return rows;
}

std::string table_of(const std::vector<Row>& rows, double offset) {
  std::string text = "Time [s]";
  for (std::size_t i = 0; i < rows[0].levels.size(); ++i) text += ",C" + std::to_string(i + 1);
  for (const Row& row : rows) {
    text += "\n" + text_of(row.t + offset);
    for (const int level : row.levels) text += level != 0 ? ",1" : ",0";
  }
  return text + "\n";
}

IntakeOptions random_options(Random& random, int contacts) {
  IntakeOptions options;
  options.lines.contacts = contacts;
  for (int i = 1; i <= contacts; ++i) {
    options.lines.levels.push_back(std::to_string(i) + "=C" + std::to_string(i));
  }
  options.inverted = random.chance(0.5);
  options.impacts = std::array{Edge::closed, Edge::closed, Edge::rising, Edge::falling,
                               Edge::both}[static_cast<std::size_t>(random.integer(0, 4))];
  if (random.chance(0.7)) options.rules.debounce = 0.5e-3 * random.integer(1, 6);
  if (random.chance(0.7) && options.impacts == Edge::closed)
    options.rules.pulse_shorter_than = 0.5e-3 * random.integer(1, 12);
  if (random.chance(0.3)) options.rules.duration = 0.5e-3 * random.integer(0, 4000);
  options.clock.offset = parse_decimal("100").value();
  return options;
}

/// The events of all rows together, and their counts for each contact.
struct Recorded {
  std::vector<ContactEvent> events;
  std::vector<EdgeCounts> counts;
};

Recorded offline(const std::vector<Row>& rows, const IntakeOptions& options) {
  Recorded result;
  for (int contact = 0; contact < options.lines.contacts; ++contact) {
    LevelEdges levels(0.5, options.inverted);
    std::vector<double> closings, openings, impacts;
    for (const Row& row : rows) {
      const bool first = !levels.high();
      const LevelChange change = levels.take(row.levels[static_cast<std::size_t>(contact)]);
      const bool rises = change == LevelChange::rises, falls = change == LevelChange::falls;
      if (options.impacts == Edge::closed) {
        if (rises || (first && *levels.high())) closings.push_back(row.t);
        if (falls) openings.push_back(row.t);
      } else if ((rises && options.impacts != Edge::falling) ||
                 (falls && options.impacts != Edge::rising)) {
        impacts.push_back(row.t);
      }
    }
    const RecordedEvents made = events_of(contact, {closings, openings, impacts}, options.rules);
    result.events.insert(result.events.end(), made.events.begin(), made.events.end());
    result.counts.push_back(made.counts);
  }
  std::ranges::stable_sort(result.events, {}, &ContactEvent::t);
  return result;
}

void expect_same(const Kept& kept, const Intake& intake, const Recorded& recorded) {
  ASSERT_EQ(kept.sessions.size(), 1U);
  EXPECT_EQ(kept.sessions[0], recorded.events);
  for (int contact = 0; contact < std::ssize(recorded.counts); ++contact) {
    const EdgeCounts& expected = recorded.counts[static_cast<std::size_t>(contact)];
    const EdgeCounts counts = intake.edge_counts(contact);
    EXPECT_EQ(counts.pulses, expected.pulses);
    EXPECT_EQ(counts.sustained, expected.sustained);
    EXPECT_EQ(counts.merged, expected.merged);
    EXPECT_EQ(counts.before_start, expected.before_start);
    EXPECT_EQ(counts.after_duration, expected.after_duration);
  }
}

TEST(ListenPropertyTest, BytesInAnyPiecesGiveTheEventsOfARecording) {
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    const int contacts = random.integer(1, 3);
    IntakeOptions options = random_options(random, contacts);
    options.clock.speed = unpaced;
    const std::vector<Row> rows = random_rows(random, contacts, 120);
    const std::string table = table_of(rows, 100.0);
    Kept kept;
    Intake intake(options, kept);
    for (std::size_t at = 0; at < table.size();) {
      const auto size = static_cast<std::size_t>(random.chance(0.5) ? random.integer(1, 7)
                                                                    : random.integer(1, 400));
      intake.take(std::string_view(table).substr(at, size), 0.0);
      at += size;
    }
    intake.finish();
    expect_same(kept, intake, offline(rows, options));
    EXPECT_EQ(intake.counts().bad_lines, 0);
    if (testing::Test::HasFailure()) break;
  }
}

// The watermark runs ahead of the lines by this host's clock, and no edge comes too late.
TEST(ListenPropertyTest, PacedLinesWithDelaysGiveTheEventsOfARecording) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    const int contacts = random.integer(1, 3);
    IntakeOptions options = random_options(random, contacts);
    options.clock.latency = 0.05;
    options.stall = 0.3;
    const std::vector<Row> rows = random_rows(random, contacts, 120);
    const double rate = 1.0 + 5e-3 * random.uniform(-1.0, 1.0);
    const std::string table = table_of(rows, 100.0);
    Kept kept;
    Intake intake(options, kept);
    std::string_view rest = table;
    const auto take_line = [&](double arrival) {
      const std::size_t size = rest.find('\n') + 1;
      intake.take(rest.substr(0, size), arrival);
      rest.remove_prefix(size);
    };
    double now = 0.0;
    take_line(now);
    for (const Row& row : rows) {
      const double arrival = std::max(now, 7.0 + row.t * rate + random.uniform(0.0, 0.03));
      for (; now < arrival; now += random.uniform(0.0, 0.02)) intake.pass(now);
      now = arrival;
      take_line(now);
    }
    intake.finish();
    expect_same(kept, intake, offline(rows, options));
    EXPECT_EQ(intake.counts().late_edges, 0);
    EXPECT_TRUE(kept.problems.empty()) << kept.problems[0];
    if (testing::Test::HasFailure()) break;
  }
}

TEST(ListenPropertyTest, LinesEndInAnyWayAndKeepTheirNumbers) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    std::string bytes;
    std::vector<std::pair<std::int64_t, std::string>> expected, got;
    const std::string end =
        std::array{"\n", "\r\n", "\r"}[static_cast<std::size_t>(random.integer(0, 2))];
    for (std::int64_t number = 1; number <= 50; ++number) {
      const std::string text(
          static_cast<std::size_t>(random.chance(0.2) ? 0 : random.integer(1, 9)), 'x');
      if (!text.empty()) expected.emplace_back(number, text);
      bytes += text + end;
    }
    LineSplitter splitter;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto size = static_cast<std::size_t>(random.integer(1, 12));
      splitter.take(
          std::string_view(bytes).substr(at, size),
          [&](std::string_view text) { got.emplace_back(splitter.number(), text); },
          [](std::string_view) { ADD_FAILURE(); });
      at += size;
    }
    EXPECT_EQ(got, expected);
    if (testing::Test::HasFailure()) break;
  }
}

TEST(ListenPropertyTest, DamagedLinesAreNamedAndTheOthersCount) {
  const Texts damaged{"garbage",
                      "1,2",
                      "1,1,x",
                      "\x01\x02\xff",
                      "1e999999,1,1",
                      "nan,1,1",
                      "100,0,1",
                      "100,3,1",
                      "100,1,0.5",
                      ",,,",
                      "100;1;2;3",
                      "100,1,1,1",
                      "-",
                      "inf,1,0",
                      "time",
                      std::string(5000, '7')};
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    IntakeOptions options;
    options.lines.contacts = 2;
    options.clock.speed = unpaced;
    std::string clean, dirty;
    std::int64_t bad = 0;
    double t = 100.0;
    std::array<int, 2> levels{0, 0};
    for (int i = 0; i < 80; ++i) {
      if (random.chance(0.3)) {
        dirty += damaged[static_cast<std::size_t>(
                     random.integer(0, static_cast<int>(damaged.size()) - 1))] +
                 "\n";
        ++bad;
      }
      t += random.uniform(0.001, 0.1);
      const int contact = random.integer(0, 1);
      int& level = levels[static_cast<std::size_t>(contact)];
      level = 1 - level;
      const std::string line =
          text_of(t) + "," + std::to_string(contact + 1) + "," + std::to_string(level) + "\n";
      clean += line;
      dirty += line;
    }
    Kept of_clean, of_dirty;
    Intake first(options, of_clean), second(options, of_dirty);
    first.take(clean, 0.0);
    first.finish();
    second.take(dirty, 0.0);
    second.finish();
    EXPECT_EQ(of_clean.sessions, of_dirty.sessions);
    EXPECT_EQ(second.counts().bad_lines, bad);
    EXPECT_EQ(of_dirty.problems.size(), static_cast<std::size_t>(bad));
    EXPECT_EQ(first.counts().bad_lines, 0);
    EXPECT_EQ(of_clean.sessions[0].size(), 80U);
    if (testing::Test::HasFailure()) break;
  }
}

// Wraps every 71.6 minutes, at a paced device with edges every 20 minutes and repeated levels
// between them.
TEST(ListenPropertyTest, ACounterWrapsAnyNumberOfTimes) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    const bool paced = random.chance(0.5);
    IntakeOptions options;
    options.clock.speed = paced ? 1.0 : unpaced;
    options.clock.unit = parse_decimal("1e-6").value();
    options.clock.counter_bits = 32;
    Kept kept;
    Intake intake(options, kept);
    std::vector<ContactEvent> expected;
    const std::uint64_t start = static_cast<std::uint64_t>(random.uniform(0.0, 4.29e9));
    std::uint64_t count = start;
    int level = 0;
    std::int64_t wraps = 0;
    for (int i = 0; i < 60; ++i) {
      const bool edge = random.chance(0.5);
      if (edge) {
        level = 1 - level;
        expected.push_back({1e-6 * static_cast<double>(count), 0, level != 0 ? closes : opens});
      }
      const double arrival = 1e-6 * static_cast<double>(count - start) + random.uniform(0.0, 0.04);
      intake.take(
          std::to_string(count % (std::uint64_t{1} << 32)) + ",1," + std::to_string(level) + "\r\n",
          arrival);
      const std::uint64_t next = count + static_cast<std::uint64_t>(random.uniform(1.0, 1.2e9));
      if (i < 59) wraps += static_cast<std::int64_t>((next >> 32) - (count >> 32));
      count = next;
    }
    intake.finish();
    ASSERT_EQ(kept.sessions.size(), 1U);
    ASSERT_EQ(kept.sessions[0].size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(kept.sessions[0][i].kind, expected[i].kind);
      EXPECT_NEAR(kept.sessions[0][i].t, expected[i].t, 1e-9);
    }
    EXPECT_EQ(intake.counts().wraps, wraps);
    EXPECT_TRUE(kept.problems.empty()) << kept.problems[0];
    if (testing::Test::HasFailure()) break;
  }
}

IntakeOptions plain(double speed = unpaced) {
  IntakeOptions options;
  options.clock.speed = speed;
  return options;
}

/// Rows of time, level and acceleration, every 2 ms, in units of 10 m/s^2.
IntakeOptions with_input() {
  IntakeOptions options = plain();
  options.lines.levels = {"1=hit"};
  options.lines.input = "ax";
  options.input.dt = 2e-3;
  options.input.unit = 10.0;
  return options;
}

using Samples = std::vector<std::pair<std::int64_t, double>>;

TEST(ListenInputTest, RowsWithANumberAreSamplesAndTheOthersEdges) {
  Kept kept;
  Intake intake(with_input(), kept);
  intake.take("Time [ms],hit,ax\n5,0,1\n7,0,-2.5\n8.3,1,\n9,1,3\n9.3,0, \n11,0,4e-1\n", 0.0);
  intake.finish();
  ASSERT_EQ(kept.inputs.size(), 1U);
  EXPECT_EQ(kept.inputs[0].t0, 5e-3);
  EXPECT_EQ(kept.inputs[0].dt, 2e-3);
  EXPECT_EQ(kept.inputs[0].samples, (Samples{{0, 10.0}, {1, -25.0}, {2, 30.0}, {3, 4.0}}));
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{8.3e-3, 0, closes}, {9.3e-3, 0, opens}}));
  EXPECT_TRUE(kept.problems.empty()) << kept.problems[0];
  EXPECT_EQ(intake.counts().samples, 4);
  EXPECT_EQ(intake.counts().missing_samples, 0);
}

TEST(ListenInputTest, SamplesThatAreNotInTheirPlaceAreNamedAndMissingOnesCounted) {
  Kept kept;
  Intake intake(with_input(), kept);
  intake.take(
      "Time [ms],hit,ax\n"
      "0,0,0\n2.19,0,1\n4.3,0,2\n6,0,x\n6,0,3\n6.1,1,4\n14,1,7\n",
      0.0);
  intake.finish();
  ASSERT_EQ(kept.inputs.size(), 1U);
  EXPECT_EQ(kept.inputs[0].samples, (Samples{{0, 0.0}, {1, 10.0}, {3, 30.0}, {7, 70.0}}));
  ASSERT_EQ(kept.problems.size(), 3U);
  EXPECT_EQ(kept.problems[0].substr(0, 41), "4: 4.3,0,2: the sample is 0.15 of an inte");
  EXPECT_EQ(kept.problems[1], "5: 6,0,x: the sample of 'ax' is not a number");
  EXPECT_EQ(kept.problems[2], "7: 6.1,1,4: there is a sample of this time or a later one already");
  EXPECT_EQ(intake.counts().bad_samples, 2);
  EXPECT_EQ(intake.counts().missing_samples, 4);
  ASSERT_EQ(kept.notices.size(), 1U);
  EXPECT_NE(kept.notices[0].find("missing before line 6 (1 of them)"), std::string::npos)
      << kept.notices[0];
  // The level of a line whose sample is refused is used.
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{6.1e-3, 0, closes}}));
}

// The clock of the lines is 1 % fast and reads 0.5 s at t = 0.
TEST(ListenInputTest, SamplesAreOnTheTimeOfTheMachine) {
  IntakeOptions options = with_input();
  options.input.clock = {0.5, 1.01};
  options.input.dt = 2e-3 / 1.01;
  Kept kept;
  Intake intake(options, kept);
  std::string rows = "time,hit,ax\n";
  for (int k = 0; k < 1000; ++k) rows += text_of(0.5 + 2e-3 * k) + ",0,1\n";
  intake.take(rows, 0.0);
  ASSERT_EQ(kept.inputs.size(), 1U);
  EXPECT_NEAR(kept.inputs[0].t0, 0.0, 1e-9);
  EXPECT_EQ(kept.inputs[0].samples.size(), 1000U);
  EXPECT_EQ(intake.counts().bad_samples, 0);
}

TEST(ListenInputTest, ARestartBeginsTheSamplesAnew) {
  Kept kept;
  Intake intake(with_input(), kept);
  intake.take("time,hit,ax\n5,0,1\n5.002,0,2\n1,0,3\n1.002,0,4\n1.004,0,5\n", 0.0);
  ASSERT_EQ(kept.sessions.size(), 2U);
  ASSERT_EQ(kept.inputs.size(), 2U);
  EXPECT_EQ(kept.inputs[0].samples, (Samples{{0, 10.0}, {1, 20.0}}));
  EXPECT_EQ(kept.inputs[1].t0, 1.0);
  EXPECT_EQ(kept.inputs[1].samples, (Samples{{0, 30.0}, {1, 40.0}, {2, 50.0}}));
}

TEST(ListenInputTest, ColumnsWithoutTheInputAreRefused) {
  IntakeOptions options = with_input();
  options.lines.names = {"time", "hit"};
  Kept kept;
  EXPECT_THROW((Intake{options, kept}), UsageError);
  options.lines.names = {"time", "hit", "ax", "ax"};
  EXPECT_THROW((Intake{options, kept}), UsageError);
  options.lines.names.clear();
  Intake intake(options, kept);
  intake.take("time,hit\n1,0\n", 0.0);
  ASSERT_EQ(kept.problems.size(), 2U);
  EXPECT_NE(kept.problems[0].find("there is no column 'ax' (--input)"), std::string::npos);
}

// Its count would also fit a wrap, which would be half an hour in the future.
TEST(ListenTest, ARestartOfACounterIsNoWrap) {
  IntakeOptions options = plain(1.0);
  options.clock.unit = parse_decimal("1e-6").value();
  options.clock.counter_bits = 32;
  Kept kept;
  Intake intake(options, kept);
  intake.take("3000000000,1,1\n3000010000,1,0\n", 10.0);
  intake.take("100000,1,1\n", 12.0);
  EXPECT_EQ(kept.sessions.size(), 1U) << "one line may be damaged";
  intake.take("200000,1,0\n", 12.1);
  intake.finish();
  ASSERT_EQ(kept.sessions.size(), 2U);
  EXPECT_EQ(kept.sessions[0].size(), 2U);
  EXPECT_EQ(kept.sessions[1], (std::vector<ContactEvent>{{0.1, 0, closes}, {0.2, 0, opens}}));
  EXPECT_EQ(intake.counts().wraps, 0);
  ASSERT_EQ(kept.notices.size(), 1U);
  EXPECT_NE(kept.notices[0].find("restarted"), std::string::npos) << kept.notices[0];
}

TEST(ListenTest, AWrapWithoutCounterBitsIsNamedAsSuch) {
  IntakeOptions options = plain();
  options.clock.unit = parse_decimal("1e-6").value();
  Kept kept;
  Intake intake(options, kept);
  intake.take("4294960000,1,1\n100,1,0\n200,1,1\n", 0.0);
  ASSERT_EQ(kept.notices.size(), 1U);
  EXPECT_NE(kept.notices[0].find("--counter-bits 32"), std::string::npos) << kept.notices[0];
}

TEST(ListenTest, OneWrongTimeIsSkippedAndTwoThatAgreeAreARestart) {
  Kept kept;
  Intake intake(plain(), kept);
  intake.take("5,1,1\n", 0.0);
  intake.take("2,1,0\n", 0.0);  // torn: 5.2
  intake.take("6,1,0\n", 0.0);
  EXPECT_EQ(
      kept.problems,
      Texts{"2: 2,1,0: the time is 3 s before that of the line before, and no other line agrees"});
  intake.take("1,1,1\n", 0.0);
  intake.take("1.5,1,0\n", 0.0);
  intake.finish();
  EXPECT_EQ(kept.problems.size(), 1U);
  EXPECT_EQ(kept.sessions,
            (std::vector<std::vector<ContactEvent>>{{{5.0, 0, closes}, {6.0, 0, opens}},
                                                    {{1.0, 0, closes}, {1.5, 0, opens}}}));
  EXPECT_EQ(intake.counts().sessions, 2);
  EXPECT_EQ(intake.edge_counts(0).sustained, 2);
}

TEST(ListenTest, ATimeInTheFutureIsSkippedUnlessTheNextOneAgrees) {
  Kept kept;
  Intake intake(plain(1.0), kept);
  intake.take("5,1,1\n", 1.0);
  intake.take("55.5,1,0\n", 1.5);
  intake.take("5.6,1,0\n", 1.6);
  ASSERT_EQ(kept.problems.size(), 1U);
  EXPECT_EQ(kept.problems[0].substr(0, 12), "2: 55.5,1,0:");
  intake.take("80,1,1\n", 2.0);
  intake.take("80.1,1,0\n", 2.1);
  intake.finish();
  EXPECT_EQ(kept.problems.size(), 1U);
  EXPECT_EQ(kept.sessions[0],
            (std::vector<ContactEvent>{
                {5.0, 0, closes}, {5.6, 0, opens}, {80.0, 0, closes}, {80.1, 0, opens}}));
}

// Lines that waited in a buffer before this program read them, and one that arrives sooner.
TEST(ListenTest, LinesThatWaitedAreAllTaken) {
  Kept kept;
  Intake intake(plain(1.0), kept);
  std::vector<ContactEvent> expected;
  for (int i = 1; i <= 8; ++i) {
    expected.push_back({0.2 * i, 0, i % 2 == 1 ? closes : opens});
    intake.take(text_of(0.2 * i) + (i % 2 == 1 ? ",1,1\n" : ",1,0\n"), i < 8 ? 1.4 : 1.63);
  }
  intake.finish();
  EXPECT_TRUE(kept.problems.empty()) << kept.problems[0];
  EXPECT_EQ(kept.sessions[0].size(), expected.size());
}

TEST(ListenTest, AWrongUnitIsFound) {
  for (const auto& [unit, said] :
       {std::pair("1e-6", false), std::pair("1", true), std::pair("1e-9", true)}) {
    IntakeOptions options = plain(1.0);
    options.clock.unit = parse_decimal(unit).value();
    Kept kept;
    Intake intake(options, kept);
    for (int i = 0; i < 100; ++i) intake.take(std::to_string(50000 * i) + ",1,0\n", 0.05 * i);
    const auto about_the_rate = [](const std::string& text) {
      return text.find("times as fast") != std::string::npos;
    };
    EXPECT_EQ(std::ranges::count_if(kept.notices, about_the_rate), said ? 1 : 0) << unit;
  }
}

TEST(ListenTest, AHeaderThatIsRepeatedConfirmsARestartAtOnce) {
  Kept kept;
  Intake intake(plain(), kept);
  intake.take("time_ms,contact,level\n7000,1,1\n7001,1,0\n", 0.0);
  intake.take("time_ms,contact,level\n6990,1,1\n", 0.0);
  ASSERT_EQ(kept.sessions.size(), 2U);
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{7.0, 0, closes}, {7.001, 0, opens}}));
  EXPECT_EQ(kept.sessions[1], (std::vector<ContactEvent>{{6.99, 0, closes}}));
}

TEST(ListenTest, TheOffsetIsOfTheFirstClock) {
  IntakeOptions options = plain();
  options.clock.offset = parse_decimal("81250.5").value();
  Kept kept;
  Intake intake(options, kept);
  intake.take("81251,1,1\n81251.25,1,0\n3,1,1\n3.5,1,0\n", 0.0);
  EXPECT_EQ(kept.sessions,
            (std::vector<std::vector<ContactEvent>>{{{0.5, 0, closes}, {0.75, 0, opens}},
                                                    {{3.0, 0, closes}, {3.5, 0, opens}}}));
  ASSERT_EQ(kept.notices.size(), 1U);
  EXPECT_NE(kept.notices[0].find("--offset"), std::string::npos);
}

TEST(ListenTest, TheWatermarkLagsUntilAPulseIsKnown) {
  IntakeOptions options = plain(1.0);
  options.rules.pulse_shorter_than = 0.01;
  options.clock.latency = 0.002;
  Kept kept;
  Intake intake(options, kept);
  intake.take("1,1,0\n", 1.0);
  EXPECT_EQ(kept.watermark(), 1.0);
  intake.take("2,1,1\n", 2.0);
  EXPECT_LT(kept.watermark(), 2.0);
  EXPECT_GT(kept.watermark(), 2.0 - 1e-12);
  intake.pass(2.009);
  EXPECT_TRUE(kept.sessions[0].empty());
  intake.pass(2.013);
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{2.0, 0, closes}}));
  EXPECT_NEAR(kept.watermark(), 2.011, 1e-9);
  intake.take("2.1,1,0\n2.5,1,1\n2.505,1,0\n", 2.505);
  EXPECT_EQ(kept.sessions[0].back(), (ContactEvent{2.5, 0, pulse}));
  EXPECT_EQ(kept.watermark(), 2.505);
}

TEST(ListenTest, AStalledSourceStopsTheWatermarkAndIsNamed) {
  IntakeOptions options = plain(1.0);
  options.stall = 0.5;
  Kept kept;
  Intake intake(options, kept);
  intake.take("1,1,1\n", 10.0);
  for (double now = 10.0; now < 12.0; now += 0.01) intake.pass(now);
  EXPECT_NEAR(kept.watermark(), 1.45, 0.011);
  ASSERT_EQ(kept.notices.size(), 1U);
  EXPECT_NE(kept.notices[0].find("watermark stops"), std::string::npos);
  intake.take("3.1,1,0\n", 12.1);
  EXPECT_EQ(kept.notices.back(), "lines arrive again");
  EXPECT_EQ(kept.watermark(), 3.1);
  EXPECT_EQ(kept.sessions[0].size(), 2U);
  EXPECT_EQ(intake.counts().stalls, 1);
}

TEST(ListenTest, AnEdgeOlderThanTheWatermarkIsNamed) {
  IntakeOptions options = plain(1.0);
  options.clock.latency = 0.01;
  Kept kept;
  Intake intake(options, kept);
  intake.take("1,1,1\n", 10.0);
  intake.pass(10.5);
  intake.take("1.2,1,0\n", 10.5);
  EXPECT_EQ(intake.counts().late_edges, 1);
  ASSERT_EQ(kept.problems.size(), 1U);
  EXPECT_NE(kept.problems[0].find("--latency"), std::string::npos) << kept.problems[0];
}

TEST(ListenTest, EdgesAreStampedOnArrival) {
  IntakeOptions options = plain(1.0);
  options.stamp_arrival = true;
  Kept kept;
  Intake intake(options, kept);
  intake.take("1,1\n", 0.25);
  intake.pass(0.5);
  EXPECT_EQ(kept.watermark(), 0.5);
  intake.take("1,", 0.75);
  intake.take("0\n", 0.875);
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{0.25, 0, closes}, {0.875, 0, opens}}));
}

TEST(ListenTest, ANewConnectionBeginsANewSession) {
  Kept kept;
  Intake intake(plain(1.0), kept);
  intake.take("1,1,1\n1.5,1,", 1.5);
  intake.disconnect();
  EXPECT_EQ(kept.problems, Texts{"2: 1.5,1,: the line is not complete"});
  for (double now = 1.5; now < 5.0; now += 0.1) intake.pass(now);
  EXPECT_EQ(kept.watermark(), 1.0);
  intake.take("5,1,1\n", 5.0);
  intake.take("5.5,1,0\n", 5.5);
  ASSERT_EQ(kept.sessions.size(), 2U);
  EXPECT_EQ(kept.sessions[1], (std::vector<ContactEvent>{{5.0, 0, closes}, {5.5, 0, opens}}));
}

TEST(ListenTest, LinesAreReadInManyFormats) {
  struct Case {
    const char* text;
    IntakeOptions options;
    std::vector<ContactEvent> events;
  };
  const auto with = [](auto change) {
    IntakeOptions options = plain();
    options.lines.contacts = 2;
    change(options);
    return options;
  };
  const auto same = with([](IntakeOptions&) {});
  const auto channels = with([](IntakeOptions& options) {
    options.lines.levels = {"1=D0", "2=D3"};
  });
  const std::vector<ContactEvent> one{{1.5, 1, closes}};
  const std::vector<Case> cases{
      {"1.5,2,1\n", same, one},
      {"1.5;2;1\r\n", same, one},
      {"1,5;2;1\r\n", same, one},
      {"1.5\t2\t1\r", same, one},
      {"  1.5   2 1 \n", same, one},
      {"# comment\n; comment\n\n\"1.5\",\"2\",\"1\"\n", same, one},
      {"Level,Contact,Time (ms)\n1,2,1500\n", same, one},
      {"contact,time_us,level,note\n2,1500000,1,x\n", same, one},
      {"2,1.5\n",
       with([](IntakeOptions& options) {
         options.lines.names = {"contact", "time"};
       }),
       {{1.5, 1, pulse}}},
      {"1500,2,0.2\n1600,2,3.3\n",
       with([](IntakeOptions& options) {
         options.clock.unit = parse_decimal("1e-3").value();
         options.lines.threshold = 1.0;
       }),
       {{1.6, 1, closes}}},
      // sigrok-cli -O csv:time=true:label=channel:dedup=true
      {"; CSV generated by libsigrok 0.5.2\n; from Demo device on Fri Nov  7 12:00:00 2025\n"
       "; Channels (4/8): D0, D1, D2, D3\n; Samplerate: 1 MHz\nTime,D0,D1,D2,D3\n"
       "1000000,0,0,0,0\n1500000,0,1,0,1\n1600000,0,1,0,1\n",
       with([&](IntakeOptions& options) {
         options.lines.levels = channels.lines.levels;
         options.clock.unit = parse_decimal("1e-6").value();
       }),
       one}};
  for (const Case& of : cases) {
    SCOPED_TRACE(of.text);
    Kept kept;
    Intake intake(of.options, kept);
    intake.take(of.text, 0.0);
    EXPECT_EQ(kept.sessions[0], of.events);
    EXPECT_TRUE(kept.problems.empty()) << kept.problems[0];
  }
}

// Oscilloscopes print one below the names of the columns.
TEST(ListenTest, ARowOfUnitsIsUsed) {
  IntakeOptions options = plain();
  options.lines.levels = {"1=Channel A"};
  options.lines.threshold = 2.5;
  const std::string header = "Time,Channel A\n", rows = "\n1000,0.1\n1500,4.9\n";
  const std::vector<ContactEvent> events{{1.5, 0, closes}};
  const auto taken = [&](const std::string& text) {
    Kept kept;
    Intake intake(options, kept);
    intake.take(text, 0.0);
    return kept;
  };
  const Kept of_row = taken(header + "(ms),(V)\n" + rows);
  EXPECT_EQ(of_row.sessions[0], events);
  EXPECT_TRUE(of_row.problems.empty()) << of_row.problems[0];
  ASSERT_EQ(of_row.notices.size(), 1U);
  EXPECT_EQ(of_row.notices[0], "times are in ms, as the row of units says");
  EXPECT_EQ(taken(header + "ms,V\n" + rows).sessions[0], events);
  EXPECT_EQ(taken("Time (us),Channel A\n[ms],[V]\n" + rows).sessions[0], events);

  const Kept unknown = taken(header + "(div),(V)\n" + rows);
  ASSERT_EQ(unknown.problems.size(), 1U);
  EXPECT_NE(unknown.problems[0].find("times are in div; say how long that is: --unit SECONDS"),
            std::string::npos);
  const Kept late = taken(header + "0,0\n(ms),(V)\n");
  ASSERT_EQ(late.problems.size(), 1U);
  EXPECT_NE(late.problems[0].find("the time is not a number"), std::string::npos);

  // --unit counts.
  options.clock.unit = parse_decimal("2e-3").value();
  const Kept given = taken(header + "(ms),(V)\n1000,0.1\n1500,4.9\n");
  EXPECT_EQ(given.sessions[0], (std::vector<ContactEvent>{{3.0, 0, closes}}));
}

TEST(ListenTest, HeadersThatCannotBeUsedAreNamed) {
  const auto why = [](const std::string& text, auto change) {
    IntakeOptions options = plain();
    change(options);
    Kept kept;
    Intake intake(options, kept);
    intake.take(text, 0.0);
    return kept.problems.empty() ? "none" : kept.problems[0];
  };
  const auto unchanged = [](IntakeOptions&) {};
  EXPECT_NE(why("contact,level\n", unchanged).find("--stamp arrival"), std::string::npos);
  EXPECT_NE(why("time,time2,level\n", unchanged).find("--time NAME"), std::string::npos);
  EXPECT_NE(why("Time,D0\n", [](IntakeOptions& options) { options.lines.levels = {"1=D1"}; })
                .find("the columns are 'Time', 'D0'"),
            std::string::npos);
  EXPECT_NE(why("time [min],contact,level\n", unchanged).find("--unit"), std::string::npos);
}

TEST(ListenTest, OptionsThatDoNotFitAreBadUsage) {
  Kept kept;
  IntakeOptions options = plain();
  options.lines.levels = {"2=D1"};
  EXPECT_THROW(Intake(options, kept), UsageError);
  options = plain();
  options.lines.names = {"a", "b"};
  EXPECT_THROW(Intake(options, kept), UsageError);
  const auto why = [&](const Texts& levels) -> std::string {
    options = plain();
    options.lines.contacts = 3;
    options.lines.levels = levels;
    try {
      Intake(options, kept);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_EQ(why({"a", "x=1", "b"}), "none");
  EXPECT_EQ(why({"3=a", "1=x=1"}), "none");
  EXPECT_EQ(why({"4=a"}), "--level a is for contact 4; the scene has 3 contacts, counted from 1");
  EXPECT_NE(why({"0=a"}).find("is for contact 0"), std::string::npos);
  EXPECT_NE(why({"99999999999999999999=a"}).find("the scene has 3"), std::string::npos);
  EXPECT_NE(why({"a", "b", "c", "d"}).find("is for contact 4"), std::string::npos);
  EXPECT_EQ(why({"1=a", "1=b"}), "--level b is a second --level for contact 1");
  EXPECT_NE(why({"1=a", "b"}).find("must all be alike"), std::string::npos);
}

TEST(ListenTest, TheScatterOfArrivalIsMeasured) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seeded(seed));
    Random random(seed);
    const double width = random.log_uniform(1e-5, 1e-2);
    ArrivalScatter timed, untimed;
    for (int i = 0; i < 2000; ++i) {
      const double t = 0.05 * i;
      timed.add_timed(t + 1000.0, 1.0001 * t + random.uniform(0.0, width));
      untimed.add_untimed(t + random.uniform(0.0, width), i % 100 != 0);
    }
    const double sigma = width / std::sqrt(12.0);
    ASSERT_TRUE(timed.result() && untimed.result());
    EXPECT_NEAR(timed.result()->sigma, sigma, 0.1 * sigma);
    EXPECT_TRUE(timed.result()->timed);
    EXPECT_NEAR(untimed.result()->sigma, sigma, 0.2 * sigma);
    EXPECT_FALSE(untimed.result()->timed);
  }
  ArrivalScatter few;
  for (int i = 0; i < 10; ++i) few.add_timed(i, i);
  EXPECT_FALSE(few.result());
}

/// What an intake makes of lines of gpiomon on two contacts.
std::vector<ContactEvent> events_of_gpiomon(const std::string& text, bool inverted = false) {
  IntakeOptions options;
  options.lines.contacts = 2;
  options.lines.levels = {"1=17", "2=STOP LEFT"};
  options.inverted = inverted;
  options.clock.offset = parse_decimal("2116").value();
  options.clock.speed = unpaced;
  Kept kept;
  Intake intake(options, kept);
  intake.take(text, 0.0);
  intake.finish();
  EXPECT_EQ(kept.sessions.size(), 1U);
  EXPECT_EQ(intake.counts().bad_lines, 0);
  return kept.sessions.empty() ? std::vector<ContactEvent>{} : kept.sessions[0];
}

// As tools/gpiomon.c of libgpiod 1.6 and 2.2 print them; the second with and without --chip.
TEST(ListenTest, LinesOfGpiomonAreRead) {
  const std::vector<ContactEvent> events{{0.5, 0, closes}, {0.75, 0, opens}};
  EXPECT_EQ(events_of_gpiomon("event:  RISING EDGE offset: 17 timestamp: [    2116.500000000]\n"
                              "event: FALLING EDGE offset: 17 timestamp: [    2116.750000000]\n"),
            events);
  EXPECT_EQ(events_of_gpiomon("event:  RISING EDGE offset: 17 timestamp: [2116.500000000]\n"
                              "event: FALLING EDGE offset: 17 timestamp: [2116.750000000]\n"),
            events);
  EXPECT_EQ(events_of_gpiomon("2116.500000000\trising\tgpiochip0 17\n"
                              "2116.750000000\tfalling\tgpiochip0 17\n"),
            events);
  const std::vector<ContactEvent> both{
      {0.5, 1, closes}, {0.625, 0, closes}, {0.75, 1, opens}, {0.875, 0, opens}};
  EXPECT_EQ(events_of_gpiomon("2116.500000000\trising\tgpiochip0 27 \"STOP LEFT\"\n"
                              "2116.625000000\trising\tgpiochip0 17 \"GPIO17\"\n"
                              "2116.750000000\tfalling\t\"STOP LEFT\"\n"
                              "2116.875000000\tfalling\tgpiochip0 17 \"GPIO17\"\n"),
            both);
  // A contact that pulls its line down; the first edge, of its opening, is no event.
  EXPECT_EQ(events_of_gpiomon("2116.250000000\trising\tgpiochip0 17\n"
                              "2116.500000000\tfalling\tgpiochip0 17\n"
                              "2116.750000000\trising\tgpiochip0 17\n",
                              true),
            events);
}

// The first line is an edge, unlike a first row of levels, which is the state at the start.
TEST(ListenTest, TheFirstLineOfGpiomonIsAnImpact) {
  IntakeOptions options = plain();
  options.lines.levels = {"1=17"};
  options.impacts = Edge::rising;
  Kept kept;
  Intake intake(options, kept);
  intake.take("0.5\trising\tgpiochip0 17\n0.75\tfalling\tgpiochip0 17\n", 0.0);
  intake.finish();
  ASSERT_EQ(kept.sessions.size(), 1U);
  EXPECT_EQ(kept.sessions[0], (std::vector<ContactEvent>{{0.5, 0, pulse}}));
}

TEST(ListenTest, LinesOfGpiomonThatCannotBeUsedAreNamed) {
  const auto problem = [](const std::string& line, const Texts& levels) {
    LineOptions options;
    options.levels = levels;
    return LineParser(options).parse(line).problem;
  };
  const Texts levels{"1=17"};
  EXPECT_NE(problem("1.5\trising\tgpiochip0 5", levels).find("--level CONTACT=LINE"),
            std::string::npos);
  EXPECT_NE(problem("1.5\trising\tgpiochip0 17", {}).find("--level CONTACT=LINE"),
            std::string::npos);
  EXPECT_NE(problem("noon\trising\tgpiochip0 17", levels).find("no time"), std::string::npos);
  EXPECT_NE(problem("event: LOST EDGE offset: 17 timestamp: [ 1.5]", levels).find("no edge"),
            std::string::npos);
}

}  // namespace
}  // namespace sprag
