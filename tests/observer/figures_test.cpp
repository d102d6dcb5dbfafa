// Limits between normal and abnormal figures of a live observer.
#include "observer/figures.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

namespace sprag {
namespace {

constexpr std::int64_t one_millisecond = 1'000'000;

TEST(LiveFigures, PromptReportIsNotDelayed) {
  LiveFigures figures;
  figures.events.events = 360;
  figures.integration.late_events = 222;
  figures.rollbacks.rollbacks = 180;
  for (int i = 0; i < 360; ++i)
    figures.integration.event_latency.add(2 * one_millisecond + 10'000 * i);
  nlohmann::ordered_json report;
  write_json(figures, report);
  EXPECT_EQ(report["late_events"], 222) << "the key of old";
  EXPECT_EQ(report["rollbacks"]["count"], 180) << "the key of old";
  EXPECT_EQ(report["delayed_events"]["count"], 0);
  EXPECT_EQ(report["delayed_events"]["of_events"], 360);
  std::ostringstream out;
  print(figures, false, out);
  EXPECT_EQ(
      out.str(),
      "ticks 0 settled, 0 unsettled; missed deadlines 0 of 0; events 360, lost 0, skipped 0\n");
  print(figures, true, out);
  EXPECT_NE(out.str().find("222 of 360, rollbacks for them: 180 (normal"), std::string::npos)
      << out.str();
  EXPECT_NE(out.str().find("(not normal): 0"), std::string::npos) << out.str();
}

TEST(LiveFigures, DelayedEventsAreCounted) {
  for (const std::int64_t usual : {1 * one_millisecond, 50 * one_millisecond}) {
    Histogram latency;
    for (int i = 0; i < 300; ++i) latency.add(usual + 1000 * i);
    EXPECT_EQ(delayed(latency).count, 0);
    for (int i = 0; i < 7; ++i) latency.add(20 * usual + 20 * one_millisecond);
    EXPECT_EQ(delayed(latency).count, 7);
    EXPECT_GE(delayed(latency).after, 10 * one_millisecond);
    EXPECT_GE(delayed(latency).after, 4 * usual);
  }
  EXPECT_EQ(delayed({}).count, 0);
}

}  // namespace
}  // namespace sprag
