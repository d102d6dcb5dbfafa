// Numbers, units and times that listen reads.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "tools/listen/clock_time.h"
#include "tools/listen/decimal.h"
#include "tools/listen/unit.h"

namespace sprag {
namespace {

double in_unit(const char* value, const char* offset, const char* unit) {
  return difference_in(parse_decimal(value).value(), parse_decimal(offset).value(),
                       parse_unit(unit).value());
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
  const auto after = [](const char* time, const char* last) {
    const auto value = [](const char* text) {
      return parse_clock_time(text, DecimalMark::point)->value;
    };
    return difference_in(after_midnight(value(time), value(last)), value("23:59:59"), {1, 0});
  };
  EXPECT_EQ(after("23:59:59.5", "23:59:59"), 0.5);
  EXPECT_EQ(after("00:00:00.25", "23:59:59.5"), 1.25);
  EXPECT_EQ(after("23:59:58", "23:59:59"), -1.0);
}

}  // namespace
}  // namespace sprag
