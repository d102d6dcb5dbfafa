// The core of listen: lines, the device's clock, edges to events as those of a recording.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
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
  void problem(std::int64_t number, const std::string& text, const std::string& why) override {
    problems.push_back(std::to_string(number) + ": " + text + ": " + why);
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

std::string table_of(const std::vector<Row>& rows, double offset, const std::string& end = "\n") {
  std::string text = "Time [s]";
  for (std::size_t i = 0; i < rows[0].levels.size(); ++i) text += ",C" + std::to_string(i + 1);
  for (const Row& row : rows) {
    text += end + text_of(row.t + offset);
    for (const int level : row.levels) text += level != 0 ? ",1" : ",0";
  }
  return text + end;
}

/// The end of a line, as of any system.
std::string random_end(Random& random) {
  return std::array{"\n", "\r\n", "\r"}[static_cast<std::size_t>(random.integer(0, 2))];
}

void take_in_pieces(Random& random, Intake& intake, std::string_view bytes) {
  while (!bytes.empty()) {
    const auto size = std::min<std::size_t>(
        bytes.size(), static_cast<std::size_t>(random.integer(1, random.chance(0.5) ? 7 : 400)));
    intake.take(bytes.substr(0, size), 0.0);
    bytes.remove_prefix(size);
  }
  intake.finish();
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
    Kept kept;
    Intake intake(options, kept);
    take_in_pieces(random, intake, table_of(rows, 100.0, random_end(random)));
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

TEST(ListenPropertyTest, DamagedLinesAreNamedByTheirNumberAndTheOthersCount) {
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
    const std::string end = random_end(random);
    std::string clean, dirty;
    std::vector<int> bad;
    double t = 100.0;
    std::array<int, 2> levels{0, 0};
    for (int i = 0; i < 80; ++i) {
      if (random.chance(0.3)) {
        dirty += random.chance(0.5) ? end : "";
        dirty += damaged[static_cast<std::size_t>(
                     random.integer(0, static_cast<int>(damaged.size()) - 1))] +
                 end;
        bad.push_back(static_cast<int>(std::ranges::count(dirty, end.back())));
      }
      t += random.uniform(0.001, 0.1);
      const int contact = random.integer(0, 1);
      int& level = levels[static_cast<std::size_t>(contact)];
      level = 1 - level;
      const std::string line =
          text_of(t) + "," + std::to_string(contact + 1) + "," + std::to_string(level) + end;
      clean += line;
      dirty += line;
    }
    Kept of_clean, of_dirty;
    Intake first(options, of_clean), second(options, of_dirty);
    take_in_pieces(random, first, clean);
    take_in_pieces(random, second, dirty);
    EXPECT_EQ(of_clean.sessions, of_dirty.sessions);
    EXPECT_EQ(second.counts().bad_lines, std::ssize(bad));
    ASSERT_EQ(of_dirty.problems.size(), bad.size());
    for (std::size_t i = 0; i < bad.size(); ++i)
      EXPECT_TRUE(of_dirty.problems[i].starts_with(std::to_string(bad[i]) + ": "));
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

using Lines = std::vector<std::pair<double, const char*>>;  // arrival, bytes
using Sessions = std::vector<std::vector<ContactEvent>>;

/// An intake and what it gave from these lines.
struct Taken : Kept {
  explicit Taken(const IntakeOptions& options, const Lines& lines = {}) : intake(options, *this) {
    for (const auto& [arrival, bytes] : lines) intake.take(bytes, arrival);
  }
  Intake intake;
};

void expect_said(const Texts& texts, const std::string& part) {
  ASSERT_EQ(texts.size(), 1U);
  EXPECT_NE(texts[0].find(part), std::string::npos) << texts[0];
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
  const Taken taken(with_input(), {{0.0,
                                    "Time [ms],hit,ax\n5,0,1\n7,0,-2.5\n8.3,1,\n9,1,3\n"
                                    "9.3,0, \n11,0,4e-1\n"}});
  ASSERT_EQ(taken.inputs.size(), 1U);
  EXPECT_EQ(taken.inputs[0].t0, 5e-3);
  EXPECT_EQ(taken.inputs[0].dt, 2e-3);
  EXPECT_EQ(taken.inputs[0].samples, (Samples{{0, 10.0}, {1, -25.0}, {2, 30.0}, {3, 4.0}}));
  EXPECT_EQ(taken.sessions, (Sessions{{{8.3e-3, 0, closes}, {9.3e-3, 0, opens}}}));
  EXPECT_EQ(taken.problems, Texts{});
  EXPECT_EQ(taken.intake.counts().samples, 4);
  EXPECT_EQ(taken.intake.counts().missing_samples, 0);
}

TEST(ListenInputTest, SamplesThatAreNotInTheirPlaceAreNamedAndMissingOnesCounted) {
  const Taken taken(with_input(), {{0.0,
                                    "Time [ms],hit,ax\n0,0,0\n2.19,0,1\n4.3,0,2\n6,0,x\n"
                                    "6,0,3\n6.1,1,4\n14,1,7\n"}});
  ASSERT_EQ(taken.inputs.size(), 1U);
  EXPECT_EQ(taken.inputs[0].samples, (Samples{{0, 0.0}, {1, 10.0}, {3, 30.0}, {7, 70.0}}));
  ASSERT_EQ(taken.problems.size(), 3U);
  EXPECT_EQ(taken.problems[0].substr(0, 41), "4: 4.3,0,2: the sample is 0.15 of an inte");
  EXPECT_EQ(taken.problems[1], "5: 6,0,x: the sample of 'ax' is not a number");
  EXPECT_EQ(taken.problems[2], "7: 6.1,1,4: there is a sample of this time or a later one already");
  EXPECT_EQ(taken.intake.counts().bad_samples, 2);
  EXPECT_EQ(taken.intake.counts().missing_samples, 4);
  expect_said(taken.notices, "missing before line 6 (1 of them)");
  // The level of a line whose sample is refused is used.
  EXPECT_EQ(taken.sessions, (Sessions{{{6.1e-3, 0, closes}}}));
}

TEST(ListenInputTest, SamplesAreOnTheTimeOfTheMachine) {
  IntakeOptions options = with_input();
  options.input.clock = {0.5, 1.01};
  options.input.dt = 2e-3 / 1.01;
  std::string rows = "time,hit,ax\n";
  for (int k = 0; k < 1000; ++k) rows += text_of(0.5 + 2e-3 * k) + ",0,1\n";
  const Taken taken(options, {{0.0, rows.c_str()}});
  EXPECT_NEAR(taken.inputs[0].t0, 0.0, 1e-9);
  EXPECT_EQ(taken.inputs[0].samples.size(), 1000U);
  EXPECT_EQ(taken.intake.counts().bad_samples, 0);
}

TEST(ListenInputTest, ARestartBeginsTheSamplesAnew) {
  const Taken taken(with_input(),
                    {{0.0, "time,hit,ax\n5,0,1\n5.002,0,2\n1,0,3\n1.002,0,4\n1.004,0,5\n"}});
  ASSERT_EQ(taken.sessions.size(), 2U);
  ASSERT_EQ(taken.inputs.size(), 2U);
  EXPECT_EQ(taken.inputs[0].samples, (Samples{{0, 10.0}, {1, 20.0}}));
  EXPECT_EQ(taken.inputs[1].t0, 1.0);
  EXPECT_EQ(taken.inputs[1].samples, (Samples{{0, 30.0}, {1, 40.0}, {2, 50.0}}));
}

TEST(ListenTest, ARestartOfACounterIsNoWrap) {
  IntakeOptions options = plain(1.0);
  options.clock.unit = parse_decimal("1e-6").value();
  options.clock.counter_bits = 32;
  Taken taken(options, {{10.0, "3000000000,1,1\n3000010000,1,0\n"}, {12.0, "100000,1,1\n"}});
  EXPECT_EQ(taken.sessions.size(), 1U) << "one line may be damaged";
  taken.intake.take("200000,1,0\n", 12.1);
  ASSERT_EQ(taken.sessions.size(), 2U);
  EXPECT_EQ(taken.sessions[0].size(), 2U);
  EXPECT_EQ(taken.sessions[1], (std::vector<ContactEvent>{{0.1, 0, closes}, {0.2, 0, opens}}));
  EXPECT_EQ(taken.intake.counts().wraps, 0);
  expect_said(taken.notices, "restarted");
}

TEST(ListenTest, AWrapWithoutCounterBitsIsNamedAsSuch) {
  IntakeOptions options = plain();
  options.clock.unit = parse_decimal("1e-6").value();
  expect_said(Taken(options, {{0.0, "4294960000,1,1\n100,1,0\n200,1,1\n"}}).notices,
              "--counter-bits 32");
}

TEST(ListenTest, OneWrongTimeIsSkippedAndTwoThatAgreeAreARestart) {
  // The second line is torn: 5.2.
  const Taken taken(
      plain(),
      {{0.0, "5,1,1\n"}, {0.0, "2,1,0\n"}, {0.0, "6,1,0\n"}, {0.0, "1,1,1\n"}, {0.0, "1.5,1,0\n"}});
  EXPECT_EQ(
      taken.problems,
      Texts{"2: 2,1,0: the time is 3 s before that of the line before, and no other line agrees"});
  EXPECT_EQ(taken.sessions,
            (Sessions{{{5.0, 0, closes}, {6.0, 0, opens}}, {{1.0, 0, closes}, {1.5, 0, opens}}}));
  EXPECT_EQ(taken.intake.counts().sessions, 2);
  EXPECT_EQ(taken.intake.edge_counts(0).sustained, 2);
}

TEST(ListenTest, ATimeInTheFutureIsSkippedUnlessTheNextOneAgrees) {
  const Taken taken(plain(1.0), {{1.0, "5,1,1\n"},
                                 {1.5, "55.5,1,0\n"},
                                 {1.6, "5.6,1,0\n"},
                                 {2.0, "80,1,1\n"},
                                 {2.1, "80.1,1,0\n"}});
  expect_said(taken.problems, "2: 55.5,1,0:");
  EXPECT_EQ(taken.sessions,
            (Sessions{{{5.0, 0, closes}, {5.6, 0, opens}, {80.0, 0, closes}, {80.1, 0, opens}}}));
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
  const Taken taken(plain(), {{0.0, "time_ms,contact,level\n7000,1,1\n7001,1,0\n"},
                              {0.0, "time_ms,contact,level\n6990,1,1\n"}});
  EXPECT_EQ(taken.sessions, (Sessions{{{7.0, 0, closes}, {7.001, 0, opens}}, {{6.99, 0, closes}}}));
}

TEST(ListenTest, TheOffsetIsOfTheFirstClock) {
  IntakeOptions options = plain();
  options.clock.offset = parse_decimal("81250.5").value();
  const Taken taken(options, {{0.0, "81251,1,1\n81251.25,1,0\n3,1,1\n3.5,1,0\n"}});
  EXPECT_EQ(taken.sessions,
            (Sessions{{{0.5, 0, closes}, {0.75, 0, opens}}, {{3.0, 0, closes}, {3.5, 0, opens}}}));
  expect_said(taken.notices, "--offset");
}

TEST(ListenTest, TheWatermarkLagsUntilAPulseIsKnown) {
  IntakeOptions options = plain(1.0);
  options.rules.pulse_shorter_than = 0.01;
  options.clock.latency = 0.002;
  Taken taken(options, {{1.0, "1,1,0\n"}});
  EXPECT_EQ(taken.watermark(), 1.0);
  taken.intake.take("2,1,1\n", 2.0);
  EXPECT_LT(taken.watermark(), 2.0);
  EXPECT_GT(taken.watermark(), 2.0 - 1e-12);
  taken.intake.pass(2.009);
  EXPECT_TRUE(taken.sessions[0].empty());
  taken.intake.pass(2.013);
  EXPECT_EQ(taken.sessions, (Sessions{{{2.0, 0, closes}}}));
  EXPECT_NEAR(taken.watermark(), 2.011, 1e-9);
  taken.intake.take("2.1,1,0\n2.5,1,1\n2.505,1,0\n", 2.505);
  EXPECT_EQ(taken.sessions[0].back(), (ContactEvent{2.5, 0, pulse}));
  EXPECT_EQ(taken.watermark(), 2.505);
}

TEST(ListenTest, AStalledSourceStopsTheWatermarkAndIsNamed) {
  IntakeOptions options = plain(1.0);
  options.stall = 0.5;
  Taken taken(options, {{10.0, "1,1,1\n"}});
  for (double now = 10.0; now < 12.0; now += 0.01) taken.intake.pass(now);
  EXPECT_NEAR(taken.watermark(), 1.45, 0.011);
  expect_said(taken.notices, "watermark stops");
  taken.intake.take("3.1,1,0\n", 12.1);
  EXPECT_EQ(taken.notices.back(), "lines arrive again");
  EXPECT_EQ(taken.watermark(), 3.1);
  EXPECT_EQ(taken.sessions[0].size(), 2U);
  EXPECT_EQ(taken.intake.counts().stalls, 1);
}

TEST(ListenTest, AnEdgeOlderThanTheWatermarkIsNamed) {
  IntakeOptions options = plain(1.0);
  options.clock.latency = 0.01;
  Taken taken(options, {{10.0, "1,1,1\n"}});
  taken.intake.pass(10.5);
  taken.intake.take("1.2,1,0\n", 10.5);
  EXPECT_EQ(taken.intake.counts().late_edges, 1);
  expect_said(taken.problems, "--latency");
}

TEST(ListenTest, EdgesAreStampedOnArrival) {
  IntakeOptions options = plain(1.0);
  options.stamp_arrival = true;
  Taken taken(options, {{0.25, "1,1\n"}});
  taken.intake.pass(0.5);
  EXPECT_EQ(taken.watermark(), 0.5);
  taken.intake.take("1,", 0.75);
  taken.intake.take("0\n", 0.875);
  EXPECT_EQ(taken.sessions, (Sessions{{{0.25, 0, closes}, {0.875, 0, opens}}}));
}

TEST(ListenTest, ANewConnectionBeginsANewSession) {
  Taken taken(plain(1.0), {{1.5, "1,1,1\n1.5,1,"}});
  taken.intake.disconnect();
  EXPECT_EQ(taken.problems, Texts{"2: 1.5,1,: the line is not complete"});
  for (double now = 1.5; now < 5.0; now += 0.1) taken.intake.pass(now);
  EXPECT_EQ(taken.watermark(), 1.0);
  taken.intake.take("5,1,1\n", 5.0);
  taken.intake.take("5.5,1,0\n", 5.5);
  ASSERT_EQ(taken.sessions.size(), 2U);
  EXPECT_EQ(taken.sessions[1], (std::vector<ContactEvent>{{5.0, 0, closes}, {5.5, 0, opens}}));
}

TEST(ListenTest, LinesAreReadInManyFormats) {
  struct Case {
    const char* text;
    std::vector<ContactEvent> events;
    std::function<void(IntakeOptions&)> change = [](IntakeOptions&) {};
  };
  const std::vector<ContactEvent> one{{1.5, 1, closes}}, two{{0.5, 0, closes}, {0.75, 0, opens}};
  const auto gpio = [](IntakeOptions& options) {
    options.lines.levels = {"1=17", "2=STOP LEFT"};
    options.clock.offset = parse_decimal("2116").value();
  };
  const std::vector<Case> cases{
      {"1.5,2,1\n", one},
      {"1.5;2;1\r\n", one},
      {"1,5;2;1\r\n", one},
      {"1.5\t2\t1\r", one},
      {"  1.5   2 1 \n", one},
      {"# comment\n; comment\n\n\"1.5\",\"2\",\"1\"\n", one},
      {"Level,Contact,Time (ms)\n1,2,1500\n", one},
      {"contact,time_us,level,note\n2,1500000,1,x\n", one},
      {"2,1.5\n",
       {{1.5, 1, pulse}},
       [](IntakeOptions& options) {
         options.lines.names = {"contact", "time"};
       }},
      {"1500,2,0.2\n1600,2,3.3\n",
       {{1.6, 1, closes}},
       [](IntakeOptions& options) {
         options.clock.unit = parse_decimal("1e-3").value();
         options.lines.threshold = 1.0;
       }},
      // sigrok-cli -O csv:time=true:label=channel:dedup=true
      {"; CSV generated by libsigrok 0.5.2\n; from Demo device on Fri Nov  7 12:00:00 2025\n"
       "; Channels (4/8): D0, D1, D2, D3\n; Samplerate: 1 MHz\nTime,D0,D1,D2,D3\n"
       "1000000,0,0,0,0\n1500000,0,1,0,1\n1600000,0,1,0,1\n",
       one,
       [](IntakeOptions& options) {
         options.lines.levels = {"1=D0", "2=D3"};
         options.clock.unit = parse_decimal("1e-6").value();
       }},
      // As tools/gpiomon.c of libgpiod 1.6 and 2.2 print them; the second with and without --chip.
      {"event:  RISING EDGE offset: 17 timestamp: [    2116.500000000]\n"
       "event: FALLING EDGE offset: 17 timestamp: [    2116.750000000]\n",
       two, gpio},
      {"event:  RISING EDGE offset: 17 timestamp: [2116.500000000]\n"
       "event: FALLING EDGE offset: 17 timestamp: [2116.750000000]\n",
       two, gpio},
      {"2116.500000000\trising\tgpiochip0 17\n2116.750000000\tfalling\tgpiochip0 17\n", two, gpio},
      {"2116.500000000\trising\tgpiochip0 27 \"STOP LEFT\"\n"
       "2116.625000000\trising\tgpiochip0 17 \"GPIO17\"\n"
       "2116.750000000\tfalling\t\"STOP LEFT\"\n"
       "2116.875000000\tfalling\tgpiochip0 17 \"GPIO17\"\n",
       {{0.5, 1, closes}, {0.625, 0, closes}, {0.75, 1, opens}, {0.875, 0, opens}},
       gpio},
      // A contact that pulls its line down; the first edge, of its opening, is no event.
      {"2116.250000000\trising\tgpiochip0 17\n2116.500000000\tfalling\tgpiochip0 17\n"
       "2116.750000000\trising\tgpiochip0 17\n",
       two,
       [&](IntakeOptions& options) {
         gpio(options);
         options.inverted = true;
       }},
      // The first line is an edge, unlike a first row of levels, which is the state at the start.
      {"2116.5\trising\tgpiochip0 17\n2116.75\tfalling\tgpiochip0 17\n",
       {{0.5, 0, pulse}},
       [&](IntakeOptions& options) {
         gpio(options);
         options.impacts = Edge::rising;
       }}};
  for (const Case& of : cases) {
    SCOPED_TRACE(of.text);
    IntakeOptions options = plain();
    options.lines.contacts = 2;
    of.change(options);
    Taken taken(options, {{0.0, of.text}});
    taken.intake.finish();
    EXPECT_EQ(taken.sessions, Sessions{of.events});
    EXPECT_EQ(taken.problems, Texts{});
  }
}

TEST(ListenTest, ARowOfUnitsIsUsed) {
  IntakeOptions options = plain();
  options.lines.levels = {"1=Channel A"};
  options.lines.threshold = 2.5;
  const auto taken = [&](const char* text) { return Taken(options, {{0.0, text}}).sessions; };
  const Sessions events{{{1.5, 0, closes}}};
  const char* const usual = "Time,Channel A\n(ms),(V)\n\n1000,0.1\n1500,4.9\n";
  EXPECT_EQ(taken(usual), events);
  expect_said(Taken(options, {{0.0, usual}}).notices, "times are in ms, as the row of units says");
  EXPECT_EQ(taken("Time,Channel A\nms,V\n\n1000,0.1\n1500,4.9\n"), events);
  EXPECT_EQ(taken("Time (us),Channel A\n[ms],[V]\n\n1000,0.1\n1500,4.9\n"), events);
  options.clock.unit = parse_decimal("2e-3").value();
  EXPECT_EQ(taken(usual), (Sessions{{{3.0, 0, closes}}})) << "--unit counts";
}

TEST(ListenTest, LinesThatCannotBeUsedAreNamed) {
  const auto with_levels = [](const Texts& levels) {
    IntakeOptions options = plain();
    options.lines.levels = levels;
    return options;
  };
  const IntakeOptions channel = with_levels({"1=Channel A"}), gpio = with_levels({"1=17"});
  const struct {
    IntakeOptions options;
    const char *text, *why;
  } cases[] = {{plain(), "contact,level\n", "--stamp arrival"},
               {plain(), "time,time2,level\n", "--time NAME"},
               {with_levels({"1=D1"}), "Time,D0\n", "the columns are 'Time', 'D0'"},
               {plain(), "time [min],contact,level\n", "--unit"},
               {with_input(), "time,hit\n1,0\n", "there is no column 'ax' (--input)"},
               {channel, "Time,Channel A\n(div),(V)\n",
                "times are in div; say how long that is: --unit SECONDS"},
               {channel, "Time,Channel A\n0,0\n(ms),(V)\n", "the time is not a number"},
               {gpio, "1.5\trising\tgpiochip0 5\n", "--level CONTACT=LINE"},
               {plain(), "1.5\trising\tgpiochip0 17\n", "--level CONTACT=LINE"},
               {gpio, "noon\trising\tgpiochip0 17\n", "no time"},
               {gpio, "event: LOST EDGE offset: 17 timestamp: [ 1.5]\n", "no edge"}};
  for (const auto& [options, text, why] : cases) {
    const Taken taken(options, {{0.0, text}});
    ASSERT_FALSE(taken.problems.empty()) << text;
    EXPECT_NE(taken.problems[0].find(why), std::string::npos) << taken.problems[0];
  }
}

TEST(ListenTest, OptionsThatDoNotFitAreBadUsage) {
  const auto why = [](const Texts& levels, const Texts& names = {}, const char* input = "") {
    IntakeOptions options = with_input();
    options.lines.contacts = 3;
    options.lines.levels = levels;
    options.lines.names = names;
    options.lines.input = input;
    try {
      Taken taken(options);
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  EXPECT_EQ(why({"a", "x=1", "b"}), "none");
  EXPECT_EQ(why({"3=a", "1=x=1"}), "none");
  EXPECT_EQ(why({"4=a"}), "--level a is for contact 4; the scene has 3 contacts, counted from 1");
  EXPECT_EQ(why({"1=a", "1=b"}), "--level b is a second --level for contact 1");
  const struct {
    Texts levels;
    const char* part;
  } cases[] = {{{"0=a"}, "is for contact 0"},
               {{"99999999999999999999=a"}, "the scene has 3"},
               {{"a", "b", "c", "d"}, "is for contact 4"},
               {{"1=a", "b"}, "must all be alike"}};
  for (const auto& [levels, part] : cases)
    EXPECT_NE(why(levels).find(part), std::string::npos) << why(levels);
  EXPECT_NE(why({}, {"a", "b"}), "none");
  EXPECT_NE(why({"1=hit"}, {"time", "hit"}, "ax"), "none");
  EXPECT_NE(why({"1=hit"}, {"time", "hit", "ax", "ax"}, "ax"), "none");
  EXPECT_EQ(why({"1=hit"}, {"time", "hit", "ax"}, "ax"), "none");
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

}  // namespace
}  // namespace sprag
