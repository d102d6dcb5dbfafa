// Times of records and messages on a contact clock become the machine's where they are read.
#include <gtest/gtest.h>

#include "lcmtypes/contact_log.h"
#include "recording/recorded_events.h"
#include "recording/recording.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/files/events_writer.h"
#include "tests/support/random.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using test::TemporaryDirectory;
using test::write_text;

constexpr ContactClock fast{.offset = 3.0, .rate = 1.0002};

// Pulses and sustained contacts of two contacts, 5 ms to 0.5 s apart.
std::vector<ContactEvent> drawn_events(std::uint64_t seed) {
  Random random(seed);
  std::vector<ContactEvent> events;
  ContactSet closed = 0;
  double t = 0.0;
  for (int i = 0; i < 300; ++i) {
    t += random.log_uniform(5e-3, 0.5);
    const int contact = random.integer(0, 1);
    const ContactEventKind kind = contains(closed, contact) ? opens
                                  : random.chance(0.7)      ? pulse
                                                            : closes;
    events.push_back({t, contact, kind});
    closed = after(closed, events.back());
  }
  return events;
}

std::vector<ContactEvent> by_clock(std::vector<ContactEvent> events, const ContactClock& clock) {
  for (ContactEvent& event : events) event.t = clock_time(clock, event.t);
  return events;
}

void expect_near(const std::vector<ContactEvent>& a, const std::vector<ContactEvent>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].contact, b[i].contact);
    EXPECT_EQ(a[i].kind, b[i].kind);
    ASSERT_NEAR(a[i].t, b[i].t, 1e-12 * (1.0 + b[i].t));
  }
}

class ContactClockTest : public testing::Test {
 protected:
  std::filesystem::path csv(const std::vector<ContactEvent>& events) {
    EventsWriter writer(directory_ / "events.csv");
    for (const ContactEvent& event : events) writer.write(event);
    EXPECT_TRUE(writer.close());
    return directory_ / "events.csv";
  }
  std::filesystem::path log(const std::vector<ContactEvent>& events) {
    write_contact_log(directory_ / "events.lcmlog", events, 2, events.back().t + 1.0, std::nullopt);
    return directory_ / "events.lcmlog";
  }
  static RecordedEvents read(const std::filesystem::path& file, const ContactClock& clock,
                             double end = 1e9) {
    return read_recorded_events(file, 2, end, AfterLoss::used, std::nullopt, clock);
  }

  TemporaryDirectory directory_;
};

TEST_F(ContactClockTest, RecordsHaveTheMachinesTime) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const std::vector<ContactEvent> events = drawn_events(seed);
    const std::vector<ContactEvent> recorded = by_clock(events, fast);
    for (const auto& file : {csv(recorded), log(recorded)}) {
      const RecordedEvents read_back = read(file, fast);
      expect_near(read_back.events, events);
      EXPECT_TRUE(read_back.problems.empty());
      EXPECT_EQ(read_back.begins, 0.0);
      // The end is the machine's time.
      const double end = events[100].t + 1e-6;
      EXPECT_EQ(read(file, fast, end).events.size(), 101U);
      // Without a clock nothing changes.
      EXPECT_EQ(read(file, {}).events, recorded);
    }
  }
}

TEST_F(ContactClockTest, EventsBeforeTheStartAreLeftOutAndReported) {
  const std::vector<ContactEvent> recorded{{1.0, 0, pulse},  {2.0, 0, closes}, {2.5, 1, pulse},
                                           {2.75, 0, opens}, {2.8, 1, closes}, {3.5, 1, opens},
                                           {4.0, 0, pulse}};
  const RecordedEvents of_file = read(csv(recorded), {.offset = 3.0, .rate = 1.0});
  const std::vector<ContactEvent> expected{{0.0, 1, closes}, {0.5, 1, opens}, {1.0, 0, pulse}};
  EXPECT_EQ(of_file.events, expected);
  ASSERT_EQ(of_file.problems.size(), 1U);
  EXPECT_NE(of_file.problems[0].find("4 events before the machine's t = 0, by clock.offset = 3"),
            std::string::npos)
      << of_file.problems[0];
}

TEST_F(ContactClockTest, GapsOfARecordAreTheMachines) {
  const auto file =
      write_text(directory_ / "cut.csv", "t,contact,closed\n4,1,1\n4,1,0\n5,1,0\n6,1,1\n6,1,0\n");
  const RecordedEvents as_recorded = read(file, {}), by_machine = read(file, {3.0, 2.0});
  ASSERT_EQ(as_recorded.gaps.size(), 1U);
  ASSERT_EQ(by_machine.gaps.size(), 1U);
  EXPECT_EQ(by_machine.gaps[0].from, (as_recorded.gaps[0].from - 3.0) / 2.0);
  EXPECT_EQ(by_machine.gaps[0].to, (as_recorded.gaps[0].to - 3.0) / 2.0);
}

TEST(ContactClock, MessagesHaveTheMachinesTime) {
  ContactMessage message;
  message.speed = 2.0;
  message.horizon = 7.0;
  message.contacts = 1;
  message.records = 2;
  message.records_total = 2;
  message.record[0] = {4.0, 0, closes};
  message.record[1] = {5.0, 0, opens};
  message.record[2] = {9.0, 0, pulse};  // not used
  ContactMessage same = message;
  to_machine_time({}, same);
  EXPECT_EQ(same.record, message.record);
  EXPECT_EQ(same.horizon, 7.0);
  to_machine_time({.offset = 3.0, .rate = 2.0}, message);
  EXPECT_EQ(message.speed, 1.0);
  EXPECT_EQ(message.horizon, 2.0);
  EXPECT_EQ(message.record[0].t, 0.5);
  EXPECT_EQ(message.record[1].t, 1.0);
  EXPECT_EQ(message.record[2].t, 9.0);
  message.horizon = 1.0;
  to_machine_time({.offset = 3.0, .rate = 1.0}, message);
  EXPECT_EQ(message.horizon, 0.0);
}

// A true clock changes no bit of a time.
TEST(ContactClock, ATrueClockIsExact) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double t = (random.chance(0.5) ? 1.0 : -1.0) * random.log_uniform(1e-300, 1e300);
    EXPECT_EQ(machine_time({}, t), t);
    EXPECT_EQ(clock_time({}, t), t);
  }
  EXPECT_NEAR(machine_time(fast, clock_time(fast, 12.5)), 12.5, 1e-14);
}

}  // namespace
}  // namespace sprag
