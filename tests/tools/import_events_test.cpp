// The parts of listen that read numbers, times and columns, and the rules for bounces and pulses.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/import/clock_time.h"
#include "sprag/detail/import/column_file.h"
#include "sprag/detail/import/decimal.h"
#include "sprag/detail/import/import.h"
#include "sprag/detail/import/levels.h"
#include "sprag/detail/import/unit.h"
#include "tools/import_events/choice.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using Texts = std::vector<std::string>;

double in_unit(const char* value, const char* offset, const char* unit) {
  return difference_in(parse_decimal(value).value(), parse_decimal(offset).value(),
                       parse_unit(unit).value());
}

template <class Function>
std::string message_of(const Function& function) {
  try {
    function();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "no error";
}

Texts texts(const Column& column) {
  Texts result;
  for (const Cell& cell : column.cells) result.emplace_back(cell.text);
  return result;
}

Texts lines(const std::vector<RowProblem>& problems) {
  Texts result;
  for (const RowProblem& problem : problems) result.push_back(to_text(problem));
  return result;
}

TEST(DecimalTest, NumbersReadAsTheDoubleThatIsNearest) {
  for (const char* text : {"0", "1", "-12", "0.1", "123.456", "3.6100000000000003", ".5", "5.",
                           "2.5e-3", "1E10", "7.0000000000000001e-2", "-0.30000000000000004",
                           "4.9406564584124654e-300", "1.7976931348623157e300"}) {
    EXPECT_EQ(in_unit(text, "0", "s"), std::strtod(text, nullptr)) << text;
  }
  EXPECT_EQ(in_unit("+1.5E+00", "0", "s"), 1.5);
  EXPECT_FALSE(std::signbit(in_unit("-0", "0", "s")));
}

TEST(DecimalTest, InvalidNumbersAreRefused) {
  for (const char* text : {"", "-", ".", "e5", "1e", "1e+-5", "1.2.3", "1,5", "nan", "inf", "0x10",
                           "1 2", "--1", "1e400", "1e99999999999", "12s"}) {
    EXPECT_FALSE(parse_decimal(text)) << text;
  }
  EXPECT_FALSE(parse_decimal(std::string(5000, '1')));
  EXPECT_FALSE(parse_decimal("1.234,5", DecimalMark::point_or_comma));
  EXPECT_EQ(difference_in(parse_decimal("1,5", DecimalMark::point_or_comma).value(), {}, {1, 0}),
            1.5);
}

TEST(DecimalTest, UnitsAreSecondsExactly) {
  EXPECT_EQ(in_unit("1.5", "0", "s"), 1.5);
  EXPECT_EQ(in_unit("1.7", "0", "ms"), 1.7e-3);
  EXPECT_EQ(in_unit("123.4", "0", "us"), 123.4e-6);
  EXPECT_EQ(in_unit("17", "0", "ns"), 17e-9);
  EXPECT_EQ(in_unit("7", "0", "60"), 420.0);
  EXPECT_EQ(in_unit("480001", "1", "2.5e-8"), 0.012);
  EXPECT_FALSE(parse_unit("0") || parse_unit("-1") || parse_unit("min") || parse_unit("inf") ||
               parse_unit(""));
}

TEST(DecimalTest, LargeClockValuesAreExact) {
  // Neither the stamp nor the offset is exact in a double.
  EXPECT_EQ(in_unit("1732190400123456789", "1732190400000000000", "ns"), 0.123456789);
  EXPECT_EQ(in_unit("1732190400123456789", "1732190400123456788", "ns"), 1e-9);
  EXPECT_EQ(in_unit("1732190400.123456789", "1732190400", "s"), 0.123456789);
  EXPECT_EQ(in_unit("1732190400123.456789", "1.7321904e12", "ms"), 0.123456789);
  EXPECT_EQ(in_unit("1732190400", "1732190400.000001", "s"), -1e-6);
}

TEST(DecimalTest, TermsOfVeryDifferentSizeAreNearlyExact) {
  EXPECT_EQ(in_unit("1e-60", "1732190400.5", "s"), -1732190400.5);
  EXPECT_EQ(in_unit("1e60", "1732190400.5", "s"), 1e60);
  EXPECT_DOUBLE_EQ(
      in_unit("12345678901234567890.1234567890123456", "0", "1.2345678901234567890123"),
      12345678901234567890.1234567890123456 * 1.2345678901234567890123);
  EXPECT_TRUE(std::isinf(in_unit("1e300", "0", "1e300")));
  EXPECT_EQ(in_unit("1e-300", "0", "1e-300"), 0.0);
}

TEST(UnitTest, IsTakenFromColumnName) {
  const struct {
    const char* name;
    const char* unit;
  } cases[] = {{"Impact [ms]", "ms"},   {"Impact (ms)", "ms"},    {"impact [ s ]", "s"},
               {"[us] off", "us"},      {"t in ms", "ms"},        {"t / ns", "ns"},
               {"Zeit/ms", "ms"},       {"on_ms", "ms"},          {"t [\xC2\xB5s]", "us"},
               {"t (\xCE\xBCs)", "us"}, {"t [rig 2] [ms]", "ms"}, {"t (seconds)", "s"}};
  for (const auto& [name, unit] : cases) {
    const auto found = unit_in(name);
    ASSERT_TRUE(found && found->seconds) << name;
    EXPECT_EQ(found->seconds->exponent, parse_unit(unit)->exponent) << name;
  }
  for (const char* name : {"t", "ms", "impacts", "hits", "t [rig A]", "t [m]", "off (2)", "in",
                           "a_b", "[", "(]", ""}) {
    EXPECT_FALSE(unit_in(name)) << name;
  }
  for (const char* name : {"t [min]", "t (h)", "t in ticks"}) {
    ASSERT_TRUE(unit_in(name)) << name;
    EXPECT_FALSE(unit_in(name)->seconds) << name;
  }
}

TEST(UnitTest, IsTakenFromHeaderOrRequired) {
  const ColumnFile file = parse_columns("a [ms],b [ms],c [us],d,e [min]\n", "f");
  const auto pair = [](std::size_t on, std::size_t off) {
    return std::vector<ContactColumns>{{.contact = 0, .impacts = {}, .on = on, .off = off}};
  };
  const auto exponent = [&](std::optional<Decimal> given, std::size_t on, std::size_t off) {
    return choose_unit(given, file, pair(on, off), "f").seconds.exponent;
  };
  EXPECT_EQ(exponent({}, 0, 1), -3);
  EXPECT_EQ(exponent({}, 2, 2), -6);
  EXPECT_EQ(exponent({}, 3, 3), 0);
  EXPECT_EQ(exponent(Decimal{1, -9}, 0, 2), -9);
  EXPECT_EQ(choose_unit({}, file, pair(0, 1), "f").remark,
            "f: times in ms, as column 'a [ms]' says");
  EXPECT_EQ(choose_unit(parse_unit("0.001"), file, pair(0, 3), "f").remark, "");
  EXPECT_EQ(choose_unit(parse_unit("s"), file, pair(0, 3), "f").remark,
            "f: column 'a [ms]' says ms; --unit says something else, and counts");
  const std::string asked = "--unit s, ms, us, ns or a number of seconds";
  for (const std::pair<std::size_t, std::size_t> of : {std::pair(0, 2), {0, 3}, {3, 0}, {0, 4}}) {
    EXPECT_TRUE(message_of([&] { exponent({}, of.first, of.second); }).ends_with(asked));
  }
}

TEST(ColumnFileTest, CarriageReturnAloneEndsLine) {
  const ColumnFile file = parse_columns("# a Mac\rt,u\r1,2\r\r3\r5,6\r", "f");
  ASSERT_EQ(file.columns.size(), 2U);
  EXPECT_EQ(texts(file.columns[0]), (Texts{"1", "5"}));
  EXPECT_EQ(texts(file.columns[1]), (Texts{"2", "6"}));
  EXPECT_EQ(lines(file.problems), Texts{"5: has 1 field; the header has 2"});
}

TEST(ColumnFileTest, SeparatorIsRecognizedFromTheHeader) {
  const struct {
    const char* text;
    char separator;
    Texts names;
  } cases[] = {{"a,b\n1.5,2\n", ',', {"a", "b"}},
               {"a;b, c\n1.5;2\n", ';', {"a", "b, c"}},
               {"a\tb;c\n1.5\t2\n", '\t', {"a", "b;c"}},
               {"\"a;x\",b\n1.5,2\n", ',', {"a;x", "b"}},
               {"  a  , \"b \"\"q\"\"\" \n 1.5\t, 2 \n", ',', {"a", "b \"q\""}}};
  for (const auto& expected : cases) {
    SCOPED_TRACE(expected.text);
    const ColumnFile file = parse_columns(expected.text, "f");
    EXPECT_EQ(file.separator, expected.separator);
    ASSERT_EQ(file.columns.size(), 2U);
    EXPECT_EQ(Texts({file.columns[0].name, file.columns[1].name}), expected.names);
    EXPECT_EQ(texts(file.columns[0]), Texts{"1.5"});
    EXPECT_EQ(texts(file.columns[1]), Texts{"2"});
    EXPECT_TRUE(file.problems.empty());
  }
  EXPECT_EQ(parse_columns("a;b,c\n1,2;3\n", "f", ',').columns[1].name, "c");
  EXPECT_EQ(parse_separator("tab"), '\t');
  EXPECT_EQ(parse_separator(";"), ';');
  EXPECT_FALSE(parse_separator("x"));
}

TEST(ColumnFileTest, CommonExportFormatsAreRead) {
  const std::string text =
      "\xEF\xBB\xBF# a logger\r\n\r\nleft;right\r\n\"1,5\"; 2 \r\n# half way\r\n;3\r\n4;\r\n "
      "\r\n;\r\n5;6";
  const ColumnFile file = parse_columns(text, "f");
  ASSERT_EQ(file.columns.size(), 2U);
  EXPECT_EQ(file.columns[0].name, "left");
  EXPECT_EQ(texts(file.columns[0]), (Texts{"1,5", "4", "5"}));
  EXPECT_EQ(texts(file.columns[1]), (Texts{"2", "3", "6"}));
  EXPECT_EQ(file.columns[0].cells[0].line, 4U);
  EXPECT_EQ(file.columns[1].cells[2].line, 10U);
  EXPECT_TRUE(file.problems.empty());
}

TEST(ColumnFileTest, RowsThatDoNotMatchHeaderAreReported) {
  const ColumnFile file = parse_columns("a,b\n1,2\n3\n4,5,6\n\"7,8\n9,10\n", "f");
  EXPECT_EQ(lines(file.problems),
            (Texts{"3: has 1 field; the header has 2", "4: has 3 fields; the header has 2",
                   "5: a quote is not closed"}));
  EXPECT_EQ(texts(file.columns[0]), (Texts{"1", "9"}));
}

TEST(ColumnFileTest, FilesWithoutAHeaderAreRefused) {
  const auto error = [](const char* text) {
    return message_of([&] { parse_columns(text, "f.csv"); });
  };
  EXPECT_EQ(error(""), "f.csv:1: there is no header with the columns' names");
  EXPECT_EQ(error("# only this\n"), "f.csv:1: there is no header with the columns' names");
  EXPECT_TRUE(error("# c\n0.5;1,5\n").starts_with("f.csv:2: must be the header")) << error("0.5\n");
  EXPECT_TRUE(error("\"a,b\n").starts_with("f.csv:1: a quote in the header"));
  EXPECT_TRUE(error("\xFF\xFEt").starts_with("f.csv:1: is UTF-16"));
}

TEST(ColumnFileTest, UnknownNamesAreReportedWithExistingOnes) {
  const ColumnFile file = parse_columns("impact,rise,fall,rise\n", "f.csv");
  EXPECT_EQ(file.find("fall", "f.csv"), 2U);
  EXPECT_EQ(message_of([&] { (void)file.find("impcat", "f.csv"); }),
            "f.csv: there is no column 'impcat' (did you mean 'impact'?); the columns are "
            "'impact', 'rise', 'fall', 'rise'");
  EXPECT_EQ(message_of([&] { (void)file.find("zzzzz", "f.csv"); }),
            "f.csv: there is no column 'zzzzz'; the columns are 'impact', 'rise', 'fall', 'rise'");
  EXPECT_TRUE(message_of([&] {
                (void)file.find("rise", "f.csv");
              }).starts_with("f.csv: there is more than one column 'rise'"));
}

class ChoiceTest : public testing::Test {
 protected:
  static constexpr auto impacts = ColumnRole::impacts;
  static constexpr auto on = ColumnRole::on;
  static constexpr auto off = ColumnRole::off;

  std::vector<ContactColumns> choose(const std::vector<ColumnOption>& options,
                                     int contacts = 3) const {
    return choose_columns(options, file_, contacts, "f.csv");
  }
  std::string error(const std::vector<ColumnOption>& options, int contacts = 3) const {
    return message_of([&] { (void)choose(options, contacts); });
  }

  ColumnFile file_ = parse_columns("a,b,c,d,x=1\n", "f.csv");
};

TEST_F(ChoiceTest, ContactsAreCountedInTheOrderGiven) {
  const auto chosen = choose({{on, "a"}, {impacts, "b"}, {off, "c"}, {on, "d"}, {off, "x=1"}});
  ASSERT_EQ(chosen.size(), 3U);
  EXPECT_TRUE(chosen[0].contact == 0 && chosen[0].on == 0U && chosen[0].off == 2U);
  EXPECT_TRUE(chosen[1].contact == 1 && chosen[1].impacts == 1U && !chosen[1].on);
  EXPECT_TRUE(chosen[2].contact == 2 && chosen[2].on == 3U && chosen[2].off == 4U);
}

TEST_F(ChoiceTest, ContactsMayBeNumbered) {
  const auto chosen = choose({{off, "3=d"}, {impacts, "1=x=1"}, {on, "3=a"}});
  ASSERT_EQ(chosen.size(), 2U);
  EXPECT_TRUE(chosen[0].contact == 0 && chosen[0].impacts == 4U);
  EXPECT_TRUE(chosen[1].contact == 2 && chosen[1].on == 0U && chosen[1].off == 3U);
}

TEST_F(ChoiceTest, SingleColumnIsImpactsOfSingleContact) {
  const ColumnFile one = parse_columns("t\n", "f.csv");
  const auto chosen = choose_columns({}, one, 1, "f.csv");
  ASSERT_EQ(chosen.size(), 1U);
  EXPECT_EQ(chosen[0].impacts, 0U);
  EXPECT_THROW((void)choose_columns({}, one, 2, "f.csv"), UsageError);
  EXPECT_TRUE(error({}, 1).starts_with("f.csv has 5 columns and the scene has 1 contact;"));
}

TEST_F(ChoiceTest, OptionsThatContradictEachOtherAreRefused) {
  EXPECT_EQ(error({{impacts, "4=a"}}),
            "--impacts a is for contact 4; the scene has 3 contacts, counted from 1");
  EXPECT_NE(error({{impacts, "0=a"}}).find("is for contact 0"), std::string::npos);
  EXPECT_NE(error({{impacts, "99999999999999999999=a"}}).find("the scene has 3"),
            std::string::npos);
  EXPECT_NE(error({{impacts, "a"}, {impacts, "b"}}, 1).find("contact 2"), std::string::npos);
  EXPECT_EQ(error({{on, "a"}}), "contact 1 has --on without --off");
  EXPECT_EQ(error({{off, "a"}}), "--off a has no --on");
  EXPECT_EQ(error({{off, "2=a"}}), "contact 2 has --off without --on");
  EXPECT_NE(error({{impacts, "1=a"}, {on, "1=b"}, {off, "1=c"}}).find("must be either"),
            std::string::npos);
  EXPECT_NE(error({{impacts, "1=a"}, {impacts, "1=b"}}).find("a second --impacts for contact 1"),
            std::string::npos);
  EXPECT_NE(error({{impacts, "1=a"}, {impacts, "b"}}).find("must all be alike"), std::string::npos);
  EXPECT_NE(error({{impacts, "e"}}).find("there is no column 'e'"), std::string::npos);
}

/// Imports a file whose columns are impacts, or with `pairs` alternately on and off.
Import import(const std::string& text, const ImportOptions& options = {}, bool pairs = false) {
  const ColumnFile file = parse_columns(text, "f");
  std::vector<ContactColumns> chosen;
  for (std::size_t i = 0; i < file.columns.size(); i += pairs ? 2 : 1) {
    ContactColumns& contact = chosen.emplace_back();
    contact.contact = static_cast<int>(chosen.size()) - 1;
    if (!pairs) contact.impacts = i;
    if (pairs) contact.on = i;
    if (pairs) contact.off = i + 1;
  }
  return import_events(file, chosen, options);
}

/// The same with levels, and times in the column 'Time [s]'.
Import import_levels(const std::string& text, const LevelOptions& levels,
                     const ImportOptions& options = {}) {
  ColumnFile file = parse_columns(text, "f");
  std::vector<ContactColumns> chosen;
  for (std::size_t i = 1; i < file.columns.size(); ++i) {
    chosen.push_back({.contact = static_cast<int>(i) - 1, .impacts = {}, .on = {}, .off = {}});
    chosen.back().level = i;
  }
  (void)expand_levels(levels, "f", file, chosen);
  return import_events(file, chosen, options);
}

Import import_pairs(const std::string& text, const ImportOptions& options = {}) {
  return import(text, options, true);
}

using Events = std::vector<ContactEvent>;

TEST(LevelTest, ContactsAreClosedWhileTheirLevelIsHighOrLow) {
  const std::string text =
      "Time [s], Channel 0, Channel 1\n0.0, 1, 0\n0.5, 0, 0\n0.75, 0, 1\n1.0, 1, 1\n1.5, 0, 1\n";
  EXPECT_EQ(import_levels(text, {}).events, (Events{{0.0, 0, closes},
                                                    {0.5, 0, opens},
                                                    {0.75, 1, closes},
                                                    {1.0, 0, closes},
                                                    {1.5, 0, opens}}));
  EXPECT_EQ(import_levels(text, {.inverted = true}).events, (Events{{0.0, 1, closes},
                                                                    {0.5, 0, closes},
                                                                    {0.75, 1, opens},
                                                                    {1.0, 0, opens},
                                                                    {1.5, 0, closes}}));
}

TEST(LevelTest, EdgesMayBeImpacts) {
  const std::string text = "t;Time [s];V\n9;0;0,1\n9;1;3\n9;2;2,9\n9;3;0,2\n9;4;;\n9;5;3,3\n";
  const auto at = [&](Edge edge) {
    LevelOptions levels{.threshold = 1.5, .impacts = edge};
    ColumnFile file = parse_columns(text, "f");
    std::vector<ContactColumns> chosen{{.contact = 0, .impacts = {}, .on = {}, .off = {}}};
    chosen[0].level = 2;
    const auto said = expand_levels(levels, "f", file, chosen);
    EXPECT_EQ(said.size(), edge == Edge::both ? 1U : 0U);
    std::vector<double> times;
    for (const ContactEvent& event : import_events(file, chosen, {}).events) {
      EXPECT_EQ(event.kind, pulse);
      times.push_back(event.t);
    }
    return times;
  };
  EXPECT_EQ(at(Edge::rising), (std::vector<double>{1.0, 5.0}));
  EXPECT_EQ(at(Edge::falling), (std::vector<double>{3.0}));
  EXPECT_EQ(at(Edge::both), (std::vector<double>{1.0, 3.0, 5.0}));
  EXPECT_NE(
      message_of([&] { (void)import_levels("Time,V\n0,0.5\n1,2\n", {}); }).find("--threshold"),
      std::string::npos);
  EXPECT_NE(message_of([&] { (void)import_levels("a,V\n0,0\n1,1\n", {}); }).find("--time"),
            std::string::npos);
}

TEST(LevelTest, LevelsReadAsImpactsAreReported) {
  const auto noticed = [](const std::string& text) {
    const ColumnFile file = parse_columns(text, "f");
    std::vector<ContactColumns> chosen{{.contact = 0, .impacts = 0, .on = {}, .off = {}}};
    return alternating_column(file, chosen).value_or("");
  };
  EXPECT_EQ(noticed("t,c\n0,1\n1,0\n2,1\n3,0\n"), "c");
  EXPECT_EQ(noticed("t,c\n0,1\n1,1\n2,1\n3,0\n"), "");
  EXPECT_EQ(noticed("t,c\n0,1\n1,2\n2,1\n3,0\n"), "");
}

TEST(ClockTimeTest, DatesAndTimesOfDayAreSeconds) {
  const Decimal second{1, 0};
  const auto parsed = [&](const char* text) {
    const auto time = parse_clock_time(text, DecimalMark::point);
    return time ? difference_in(time->value, {}, second) : -1.0;
  };
  EXPECT_EQ(parsed("12.5"), 12.5);
  EXPECT_EQ(parsed("1970-01-02T00:00:00Z"), 86400.0);
  EXPECT_EQ(parsed("2000-03-01 12:34:56.789"), 951914096.789);
  EXPECT_EQ(parsed("2000-03-01T14:34:56,789+02:00"), 951914096.789);
  EXPECT_EQ(parsed("2000/03/01 07:04:56.789 -0530"), 951914096.789);
  EXPECT_EQ(parsed("12:34:56.789"), 45296.789);
  EXPECT_EQ(parsed("0:00:01"), 1.0);
  for (const char* wrong : {"2001-02-29T00:00:00", "2000-03-01", "25:00:00", "12:60:00", "12:34",
                            "12:34:61", "12:34:56x", "2000-03-01T12:34:56+2", "", "12:34:"}) {
    EXPECT_EQ(parsed(wrong), -1.0) << wrong;
  }
  // Nanoseconds of a date are preserved.
  const auto offset = parse_clock_time("2026-05-01T12:00:00Z", DecimalMark::point);
  const auto time = parse_clock_time("2026-05-01T12:00:00.000000001Z", DecimalMark::point);
  EXPECT_EQ(difference_in(time->value, offset->value, second), 1e-9);
}

TEST(ClockTimeTest, TimesOfDayContinueAfterMidnight) {
  ImportOptions options;
  options.offset = parse_clock_time("23:59:59", DecimalMark::point)->value;
  EXPECT_EQ(import("t\n23:59:59.5\n00:00:00.25\n00:00:01\n", options).events,
            (Events{{0.5, 0, pulse}, {1.25, 0, pulse}, {2.0, 0, pulse}}));
}

TEST(ImportTest, ColumnsOfUnequalLengthAreSortedByTime) {
  const Import result = import("a;b\n3,5;1\n2;2\n;0.5\n1;\n");
  EXPECT_EQ(result.events, (Events{{0.5, 1, pulse},
                                   {1.0, 0, pulse},
                                   {1.0, 1, pulse},
                                   {2.0, 0, pulse},
                                   {2.0, 1, pulse},
                                   {3.5, 0, pulse}}));
  ASSERT_EQ(result.figures.size(), 2U);
  EXPECT_EQ(result.figures[0].pulses, 3);
  EXPECT_EQ(result.figures[1].pulses, 3);
  EXPECT_TRUE(result.problems.empty());
}

TEST(ImportTest, CellsWithoutTimeAreReportedAndSkipped) {
  const Import result = import("a,b\n1,x\n2\nnan,2\n\"1,5\",inf\n3,3\n");
  EXPECT_EQ(
      lines(result.problems),
      (Texts{"2: column b: x is not a finite number", "3: has 1 field; the header has 2",
             "4: column a: nan is not a finite number", "5: column a: 1,5 is not a finite number",
             "5: column b: inf is not a finite number"}));
  EXPECT_EQ(result.events,
            (Events{{1.0, 0, pulse}, {2.0, 1, pulse}, {3.0, 0, pulse}, {3.0, 1, pulse}}));
}

TEST(ImportTest, EventsOutsideTheRunAreSkippedAndCounted) {
  const std::string text = "a\n-1\n-0.001\n0\n4\n5\n5.001\n";
  const Import result = import(text, {.duration = 5.0});
  EXPECT_EQ(result.events, (Events{{0.0, 0, pulse}, {4.0, 0, pulse}, {5.0, 0, pulse}}));
  EXPECT_EQ(result.before_start, 2);
  EXPECT_EQ(result.after_duration, 1);
  EXPECT_EQ(result.figures[0].pulses, 3);
  EXPECT_EQ(import(text, {.offset = {4, 0}}).events,
            (Events{{0.0, 0, pulse}, {1.0, 0, pulse}, {in_unit("5.001", "4", "s"), 0, pulse}}));
}

TEST(ImportTest, ARateIsThatOfTheClockOfTheTimes) {
  const std::string text = "a\n4\n6\n7\n";
  EXPECT_EQ(import(text, {.offset = {4, 0}, .rate = 2.0}).events,
            (Events{{0.0, 0, pulse}, {1.0, 0, pulse}, {1.5, 0, pulse}}));
  EXPECT_EQ(import(text, {.rate = 1.0}).events, import(text).events);
}

TEST(ImportTest, ContactsCloseAndOpen) {
  const Import result = import_pairs("on,off\n1,2\n3.5,3.5\n5,\n");
  EXPECT_EQ(result.events,
            (Events{{1.0, 0, closes}, {2.0, 0, opens}, {3.5, 0, pulse}, {5.0, 0, closes}}));
  EXPECT_EQ(result.figures[0].sustained, 2);
  EXPECT_EQ(result.figures[0].pulses, 1);
}

TEST(ImportTest, OneInstantMayOpenAndClose) {
  const Import result = import_pairs("on,off\n1,2\n2,3\n3,3\n");
  EXPECT_EQ(
      result.events,
      (Events{
          {1.0, 0, closes}, {2.0, 0, opens}, {2.0, 0, closes}, {3.0, 0, opens}, {3.0, 0, pulse}}));
  EXPECT_TRUE(result.problems.empty());
}

TEST(ImportTest, AContactThatIsClosedAtTheStartClosesThere) {
  EXPECT_EQ(import_pairs("on,off\n-1,2\n").events, (Events{{0.0, 0, closes}, {2.0, 0, opens}}));
  EXPECT_EQ(import_pairs("on,off\n-1,\n").events, (Events{{0.0, 0, closes}}));
  const Import before = import_pairs("on,off\n-3,-2\n-1,0\n");
  EXPECT_TRUE(before.events.empty());
  EXPECT_EQ(before.before_start, 4);
  EXPECT_EQ(before.figures[0].sustained, 0);
  // The whole length counts, not the part after the start.
  EXPECT_TRUE(import_pairs("on,off\n-1,1\n", {.pulse_shorter_than = 3.0}).events.empty());
}

TEST(ImportTest, AContactThatOutlastsTheDurationStaysClosed) {
  const Import result = import_pairs("on,off\n1,6\n7,8\n", {.duration = 5.0});
  EXPECT_EQ(result.events, (Events{{1.0, 0, closes}}));
  EXPECT_EQ(result.after_duration, 3);
}

TEST(ImportTest, ContradictoryClosingsAndOpeningsAreSkipped) {
  const Import result = import_pairs("on,off\n,0.5\n1,2\n1.5,4\n3,5\n1,\n");
  EXPECT_EQ(result.events,
            (Events{{1.0, 0, closes}, {2.0, 0, opens}, {3.0, 0, closes}, {4.0, 0, opens}}));
  EXPECT_EQ(lines(result.problems),
            (Texts{"2: column off: opens at t = 0.5, but is open already",
                   "4: column on: closes at t = 1.5, but is closed already since t = 1",
                   "5: column off: opens at t = 5, but is open already",
                   "6: column on: closes at t = 1, but is closed already since t = 1"}));
  EXPECT_EQ(lines(import_pairs("on,off\n2,2\n2,2\n").problems),
            (Texts{"3: column on: closes at t = 2, where it has closed already",
                   "3: column off: opens at t = 2, but is open already"}));
  EXPECT_EQ(lines(import("a\n1\n2\n1\n").problems),
            Texts{"4: column a: impact at t = 1, where there is one already"});
}

TEST(ImportTest, BouncesOfImpactsChainFromTheLastOne) {
  const Import result = import("a\n10\n13\n17\n22\n26\n", {.unit = {1, -3}, .debounce = 0.005});
  EXPECT_EQ(result.events, (Events{{0.010, 0, pulse}, {0.022, 0, pulse}}));
  EXPECT_EQ(result.figures[0].merged, 3);
  EXPECT_TRUE(result.problems.empty());
}

TEST(ImportTest, BouncesOfContactsChainFromTheLastOpening) {
  // Gaps of 3, 4 and 5 ms; the last one is not shorter than the limit.
  const Import result = import_pairs("on,off\n100,110\n113,115\n119,150\n155,160\n",
                                     {.unit = {1, -3}, .debounce = 0.005});
  EXPECT_EQ(result.events,
            (Events{{0.100, 0, closes}, {0.150, 0, opens}, {0.155, 0, closes}, {0.160, 0, opens}}));
  EXPECT_EQ(result.figures[0].merged, 2);
  EXPECT_EQ(result.figures[0].sustained, 2);
}

TEST(ImportTest, ABounceMayStayClosed) {
  EXPECT_EQ(import_pairs("on,off\n1,1.01\n1.02,\n", {.debounce = 0.1}).events,
            (Events{{1.0, 0, closes}}));
}

TEST(ImportTest, RepeatedClosingsAndOpeningsAreBounces) {
  const Import result =
      import_pairs("on,off\n100,110\n102,112\n106,130\n", {.unit = {1, -3}, .debounce = 0.005});
  EXPECT_EQ(result.events, (Events{{0.100, 0, closes}, {0.112, 0, opens}}));
  EXPECT_EQ(result.figures[0].merged, 3);
  EXPECT_EQ(lines(result.problems), Texts{"4: column off: opens at t = 0.13, but is open already"});
}

TEST(ImportTest, ShortContactsArePulsesAtTheirClosing) {
  const ImportOptions options{.unit = {1, -3}, .pulse_shorter_than = 0.005};
  const Import result = import_pairs("on,off\n100,104.999\n200,205\n300,305.001\n", options);
  EXPECT_EQ(result.events, (Events{{0.100, 0, pulse},
                                   {0.200, 0, closes},
                                   {0.205, 0, opens},
                                   {0.300, 0, closes},
                                   {0.305001, 0, opens}}));
  EXPECT_EQ(result.figures[0].pulses, 1);
  EXPECT_EQ(result.figures[0].sustained, 2);
}

TEST(ImportTest, SpanOfLimitIsNotShorterDespiteRounding) {
  // In doubles every second of these differences is below 5 ms.
  std::string text = "on,off\n";
  for (int i = 1; i <= 1000; ++i)
    text += std::to_string(13 * i) + "," + std::to_string(13 * i + 5) + "\n";
  const Import limit = import_pairs(text, {.unit = {1, -3}, .pulse_shorter_than = 0.005});
  EXPECT_EQ(limit.figures[0].sustained, 1000);
  const Import above = import_pairs(text, {.unit = {1, -3}, .pulse_shorter_than = 0.005000001});
  EXPECT_EQ(above.figures[0].pulses, 1000);
  EXPECT_EQ(import_pairs(text, {.unit = {1, -3}, .debounce = 0.008}).figures[0].merged, 0);
  EXPECT_EQ(import_pairs(text, {.unit = {1, -3}, .debounce = 0.008000001}).figures[0].merged, 999);
}

TEST(ImportTest, DebouncingPrecedesPulses) {
  const ImportOptions options{.unit = {1, -3}, .debounce = 0.005, .pulse_shorter_than = 0.010};
  // Each part is short, but the whole is not.
  EXPECT_EQ(import_pairs("on,off\n100,104\n106,109\n111,112\n", options).events,
            (Events{{0.100, 0, closes}, {0.112, 0, opens}}));
  EXPECT_EQ(import_pairs("on,off\n100,104\n106,109\n", options).events,
            (Events{{0.100, 0, pulse}}));
}

TEST(ColumnFileTest, FileWithoutHeaderTakesGivenNames) {
  const ColumnFile comma =
      parse_columns("0.5,1\n0.75,0\n", "x.csv", std::nullopt, {"time", "level"});
  ASSERT_EQ(comma.columns.size(), 2U);
  EXPECT_EQ(comma.columns[1].name, "level");
  EXPECT_EQ(texts(comma.columns[0]), (Texts{"0.5", "0.75"}));
  // The number of fields equals the number of names: decimal commas are not separators.
  const ColumnFile decimal = parse_columns("0,5;1\n", "x.csv", std::nullopt, {"time", "level"});
  EXPECT_EQ(texts(decimal.columns[0]), (Texts{"0,5"}));
  const ColumnFile one = parse_columns("0,5\n", "x.csv", std::nullopt, {"time"});
  EXPECT_EQ(texts(one.columns[0]), (Texts{"0,5"}));
  EXPECT_EQ(message_of([] { parse_columns("0.5,1\n", "x.csv", std::nullopt, {"time"}); }),
            "x.csv:1: has 2 fields; --columns names 1 column");
  EXPECT_EQ(message_of([] {
              parse_columns("\n1,2,3\n", "x.csv", std::nullopt, {"a", "b"});
            }),
            "x.csv:2: has 3 fields; --columns names 2 columns");
  EXPECT_NE(message_of([] { parse_columns("1,2\n", "x.csv"); }).find("--columns NAME,..."),
            std::string::npos);
}

}  // namespace
}  // namespace sprag
