#include "observer/notices.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <sstream>
#include <thread>

namespace sprag {
namespace {

constexpr std::int64_t one_second = 1'000'000'000;

std::int64_t lines(const std::string& text) { return std::ranges::count(text, '\n'); }

TEST(Notices, CauseIsPrintedAtOnceThenOncePerSecond) {
  Notices notices;
  std::ostringstream out;
  notices.raise(Notice::backwards, 1, 4.5, 2);
  notices.print(0, out);
  EXPECT_EQ(lines(out.str()), 1);
  EXPECT_NE(out.str().find("contact 2 at t = 4.5 "), std::string::npos) << out.str();
  for (int i = 0; i < 10; ++i) notices.raise(Notice::backwards, 1, 5.0 + i, 1);
  notices.print(one_second - 1, out);
  EXPECT_EQ(lines(out.str()), 1);
  notices.print(one_second, out);
  EXPECT_EQ(lines(out.str()), 2);
  EXPECT_NE(out.str().find("contact 1 at t = 5 "), std::string::npos) << out.str();
  EXPECT_NE(out.str().find("(and 9 more)"), std::string::npos) << out.str();
  notices.print(10 * one_second, out);
  EXPECT_EQ(lines(out.str()), 2);
}

TEST(Notices, CausesArePrintedIndependently) {
  Notices notices;
  std::ostringstream out;
  for (std::size_t i = 0; i < notice_kinds; ++i) notices.raise(static_cast<Notice>(i));
  notices.print(0, out);
  EXPECT_EQ(lines(out.str()), static_cast<std::int64_t>(notice_kinds));
}

TEST(Notices, RemainingCasesArePrintedAtTheEnd) {
  Notices notices;
  std::ostringstream out;
  notices.raise(Notice::bad_kind);
  notices.print(0, out);
  notices.raise(Notice::bad_kind);
  notices.print_rest(out);
  EXPECT_EQ(lines(out.str()), 2);
  notices.print_rest(out);
  EXPECT_EQ(lines(out.str()), 2);
}

TEST(Notices, TimesArePrintedInFullPrecision) {
  Notices notices;
  std::ostringstream out;
  notices.raise(Notice::gap, 1, 1700000000.25, 1700000001.5);
  notices.print(0, out);
  EXPECT_NE(out.str().find("1700000000.25 and 1700000001.5"), std::string::npos) << out.str();
}

// For the thread sanitizer.
TEST(Notices, OneThreadRaisesAnotherPrints) {
  Notices notices;
  std::ostringstream out;
  std::atomic<bool> done = false;
  std::thread raising([&] {
    for (int i = 0; i < 100'000; ++i) notices.raise(Notice::contradicting, 1, i, i + 1);
    done = true;
  });
  std::int64_t now = 0;
  while (!done) notices.print(now += one_second, out);
  raising.join();
  notices.print_rest(out);
  std::istringstream read(out.str());
  for (std::string line; std::getline(read, line);) {
    double contact = 0.0, t = 0.0;
    ASSERT_EQ(std::sscanf(line.c_str(), "event of contact %lf at t = %lf", &contact, &t), 2);
    EXPECT_EQ(contact, t + 1.0);
  }
}

}  // namespace
}  // namespace sprag
