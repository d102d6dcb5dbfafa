// The compiler's optimization may change rounding errors, but never an event.
#include <cmath>
#include <sstream>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

struct Event {
  double t = 0.0;
  int contact = 0, kind = 0;
};

std::vector<Event> parse(const std::string& text) {
  std::vector<Event> events;
  std::istringstream stream(text);
  for (Event event; stream >> event.t >> event.contact >> event.kind;) events.push_back(event);
  return events;
}

class OptimizationLevelTest : public EndToEnd {
 protected:
  void expect_same_events(const std::string& name, const std::string& duration,
                          std::size_t at_least) {
    Process& optimized = start_command({MASTER_EVENTS, scene(name), duration});
    Process& plain = start_command({MASTER_EVENTS_UNOPTIMIZED, scene(name), duration});
    const Ended a = end_of(optimized);
    const Ended b = end_of(plain);
    ASSERT_EQ(a.code, 0);
    ASSERT_EQ(b.code, 0);
    const std::vector<Event> first = parse(a.out);
    const std::vector<Event> second = parse(b.out);
    EXPECT_GE(first.size(), at_least);
    ASSERT_EQ(first.size(), second.size());
    for (std::size_t i = 0; i < first.size(); ++i) {
      EXPECT_EQ(first[i].contact, second[i].contact) << "event " << i;
      EXPECT_EQ(first[i].kind, second[i].kind) << "event " << i << " at t = " << first[i].t;
      EXPECT_NEAR(first[i].t, second[i].t, 1e-11) << "event " << i;
    }
  }
};

TEST_F(OptimizationLevelTest, PaperBeamHasTheSameEvents) {
  expect_same_events("paper_beam", "15", 15);
}

TEST_F(OptimizationLevelTest, ChatterHasTheSameEvents) {
  expect_same_events("paper_beam_chatter", "12", 50);
}

}  // namespace
}  // namespace sprag::test
