// Would catch an events file that does not round-trip bit for bit, and a damaged one that is read
// as if it were complete.
#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "sprag/detail/files/events_writer.h"
#include "tests/files/scene_texts.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using test::TemporaryDirectory;
using test::write_text;

class EventsFileTest : public testing::Test {
 protected:
  EventsFile read(std::string_view rows, int contacts = 3) {
    return read_events(
        write_text(directory_ / "events.csv", "t,contact,closed\n" + std::string(rows)), contacts);
  }

  TemporaryDirectory directory_;
};

TEST_F(EventsFileTest, WritesDocumentedFormat) {
  const auto file = directory_ / "events.csv";
  EventsWriter writer(file);
  writer.write({0.1, 0, pulse});
  writer.write({1.0, 11, closes});
  writer.write({1e-9, 11, opens});
  EXPECT_TRUE(writer.close());
  EXPECT_EQ(test::read_text(file),
            "t,contact,closed\n0.10000000000000001,1,1\n0.10000000000000001,1,0\n1,12,1\n"
            "1.0000000000000001e-09,12,0\n");
}

// Readers take lost and suspect events, and skip spurious ones.
TEST_F(EventsFileTest, NotedEventsAreReadBack) {
  const auto file = directory_ / "noted.csv";
  NotedEventsWriter writer(file);
  writer.write({0.5, 0, pulse}, EventNote::none);
  writer.write({0.75, 0, pulse}, EventNote::spurious);
  writer.write({1.0, 0, pulse}, EventNote::lost);
  writer.write({1.5, 1, closes}, EventNote::suspect);
  EXPECT_TRUE(writer.close());
  EXPECT_EQ(test::read_text(file),
            "t,contact,closed,note\n0.5,1,1,\n0.5,1,0,\n0.75,1,1,spurious\n0.75,1,0,spurious\n"
            "1,1,1,lost\n1,1,0,lost\n1.5,2,1,suspect\n");
  const EventsFile back = read_events(file, 2);
  EXPECT_FALSE(back.damage);
  EXPECT_TRUE(back.skipped.empty());
  const std::vector<ContactEvent> expected{{0.5, 0, pulse}, {1.0, 0, pulse}, {1.5, 1, closes}};
  EXPECT_EQ(back.events, expected);
}

TEST_F(EventsFileTest, RandomSequencesRoundTripBitForBit) {
  const unsigned seed = 20140918;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  for (int run = 0; run < 50; ++run) {
    std::vector<ContactEvent> events;
    ContactSet chi = 0;
    double t = 0.0;
    for (int i = 0; i < 200; ++i) {
      if (random() % 3 != 0) t += std::generate_canonical<double, 53>(random);
      const int contact = static_cast<int>(random() % max_contacts);
      const auto kind = contains(chi, contact) ? opens : (random() % 2 != 0 ? pulse : closes);
      // A contact that closes and opens at the same instant is a pulse by definition.
      if (kind == opens && !events.empty() && events.back().t == t) continue;
      events.push_back({t, contact, kind});
      chi = after(chi, events.back());
    }
    const auto file = directory_ / "events.csv";
    EventsWriter writer(file);
    for (const ContactEvent& event : events) writer.write(event);
    ASSERT_TRUE(writer.close());
    const EventsFile result = read_events(file, max_contacts);
    EXPECT_EQ(result.events, events);
    EXPECT_TRUE(result.skipped.empty());
    EXPECT_FALSE(result.damage);
  }
}

TEST_F(EventsFileTest, ValidRowsAreRead) {
  using Events = std::vector<ContactEvent>;
  const std::string header = "t,contact,closed\n";
  for (const auto& [text, events] : std::vector<std::pair<std::string, Events>>{
           // A pulse, with rows of other contacts in between.
           {header + "1,1,1\n1,2,1\n1,3,1\n1,1,0\n1,3,0\n2,2,0\n",
            {{1.0, 0, pulse}, {1.0, 1, closes}, {1.0, 2, pulse}, {2.0, 1, opens}}},
           {header + "1,1,1\n1,1,0\n1,1,1\n1,1,0\n", {{1.0, 0, pulse}, {1.0, 0, pulse}}},
           // Opening and closing at one instant is none.
           {header + "1,1,1\n2,1,0\n2,1,1\n3,1,0\n",
            {{1.0, 0, closes}, {2.0, 0, opens}, {2.0, 0, closes}, {3.0, 0, opens}}},
           // Plus signs and a byte order mark, blanks and empty lines, the line ends of Windows.
           {"\xEF\xBB\xBF" + header + "+0.5,+1,+1\n 1.5e+0,1,0\n",
            {{0.5, 0, closes}, {1.5, 0, opens}}},
           {"t,contact,closed\r\n1, 2 ,1\r\n\r\n2,2,0\r\n\r\n",
            {{1.0, 1, closes}, {2.0, 1, opens}}}}) {
    const EventsFile result = read_events(write_text(directory_ / "events.csv", text), 3);
    EXPECT_EQ(result.events, events) << text;
    EXPECT_TRUE(result.skipped.empty()) << text;
    EXPECT_FALSE(result.damage) << text;
  }
}

TEST_F(EventsFileTest, ContradictoryRowsAreSkipped) {
  const auto result = read(
      "1,1,1\n"
      "0.5,2,1\n"  // line 3: backwards
      "2,1,1\n"    // line 4: closed already
      "2,2,0\n"    // line 5: open already
      "3,1,0\n");
  EXPECT_EQ(result.events, (std::vector<ContactEvent>{{1.0, 0, closes}, {3.0, 0, opens}}));
  EXPECT_FALSE(result.damage);
  ASSERT_EQ(result.skipped.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(result.skipped[i].line, i + 3);
  EXPECT_EQ(result.skipped[0].what, "time goes backwards");
  EXPECT_EQ(result.skipped[1].what, "contact closes, but is closed already");
  EXPECT_EQ(result.skipped[2].what, "contact opens, but is open already");
}

// Such a file belongs to another machine, or counts contacts from 0.
TEST_F(EventsFileTest, AContactOrAFlagOutOfRangeIsAnError) {
  const auto error_of = [&](const std::string& row) {
    return message_of([&] { read("1,1,1\n" + row); }, (directory_ / "events.csv").string());
  };
  const std::string allowed = "; must be in 1..3, the contacts of the scene, counted from 1";
  EXPECT_EQ(error_of("2,0,1\n"), ":3:3: contact is 0" + allowed);
  EXPECT_EQ(error_of("2.5, 61,1\n"), ":3:6: contact is 61" + allowed);
  EXPECT_EQ(error_of("2,4,1\n"), ":3:3: contact is 4" + allowed);
  EXPECT_EQ(error_of("2,-9223372036854775808,1\n"),
            ":3:3: contact is -9223372036854775808" + allowed);
  EXPECT_EQ(error_of("2,1,2\n"),
            ":3:5: closed is 2; must be 1 (the contact closes) or 0 (it opens)");
  EXPECT_EQ(error_of("0.5,2,-1\n"),
            ":3:7: closed is -1; must be 1 (the contact closes) or 0 (it opens)");
}

TEST_F(EventsFileTest, DisproportionateGapIsImplausible) {
  std::string rows;
  for (int i = 1; i <= 10; ++i) {
    rows += std::to_string(i) + ",1,1\n" + std::to_string(i) + ",1,0\n";
  }
  EXPECT_FALSE(read(rows).implausible);
  EXPECT_FALSE(read(rows + "2000,1,1\n").implausible);
  const auto late = read(rows + "2011,1,1\n2012,1,0\n");
  ASSERT_TRUE(late.implausible);
  EXPECT_EQ(late.implausible->t, 2011.0);
  EXPECT_EQ(late.implausible->problem.line, 22U);
  EXPECT_EQ(late.events.size(), 12U);
  std::string at_once, epoch;
  for (int i = 1; i <= 10; ++i) at_once += "1e6," + std::to_string(i) + ",1\n";
  for (int i = 1; i <= 10; ++i)
    epoch += std::to_string(10000000 + i) + ",1," + std::to_string(i % 2) + "\n";
  EXPECT_FALSE(read(at_once, 10).implausible);
  ASSERT_TRUE(read(epoch, 10).implausible);
  EXPECT_EQ(read(epoch, 10).implausible->problem.line, 2U);
  // A few rows are not enough evidence.
  EXPECT_FALSE(read("0,1,1\n1e9,1,0\n").implausible);
  EXPECT_FALSE(read("0.01,1,1\n50,1,0\n").implausible);
  EXPECT_TRUE(read("0.01,1,1\n1e3,1,0\n").implausible);
}

TEST_F(EventsFileTest, DamageEndsReadingAndKeepsEarlierRows) {
  for (const char* bad :
       {"x,1,1\n", "2,1\n", "2,1,0,7\n", "2,one,0\n", "2,1.5,0\n", "nan,1,0\n", "inf,1,0\n",
        "-1,1,0\n", "1e999,1,0\n", "0x2,1,0\n", "2,1,0 0\n", "2,,0\n", " \n",
        "2,1,99999999999999999999\n", "+-2,1,0\n", "++2,1,0\n", "+,1,0\n", "2,+-1,0\n"}) {
    const auto result = read("1,1,1\n" + std::string(bad) + "3,1,0\n");
    SCOPED_TRACE(bad);
    EXPECT_EQ(result.events, (std::vector<ContactEvent>{{1.0, 0, closes}}));
    ASSERT_TRUE(result.damage);
    EXPECT_EQ(result.damage->line, 3U);
    EXPECT_NE(result.damage->what.find("garbled"), std::string::npos);
  }
}

TEST_F(EventsFileTest, EveryTruncationIsCompleteOrReported) {
  const std::string whole = "t,contact,closed\n1.5,1,1\n1.5,1,0\n2.25,2,1\n";
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto result = read_events(write_text(directory_ / "cut.csv", whole.substr(0, length)), 3);
    EXPECT_EQ(!result.damage, length > 0 && whole[length - 1] == '\n') << length;
  }
}

TEST_F(EventsFileTest, WrongHeaderEmptyFileAndZerosAreDamageAtLineOne) {
  for (const std::string& text :
       {std::string{}, std::string("1,1,1\n"), std::string("t,contact\n"), std::string(64, '\0')}) {
    const auto result = read_events(write_text(directory_ / "events.csv", text), 1);
    ASSERT_TRUE(result.damage);
    EXPECT_EQ(result.damage->line, 1U);
    EXPECT_TRUE(result.events.empty());
  }
}

TEST_F(EventsFileTest, CarriageReturnAloneEndsLine) {
  const std::string lines = "t,contact,closed\r1,2,1\r\r2,2,0";
  const auto whole = read_events(write_text(directory_ / "events.csv", lines + "\r"), 2);
  ASSERT_EQ(whole.events.size(), 2U);
  EXPECT_EQ(whole.events.back().t, 2.0);
  EXPECT_FALSE(whole.damage);

  const auto cut = read_events(write_text(directory_ / "events.csv", lines), 2);
  EXPECT_EQ(cut.events.size(), 1U);
  ASSERT_TRUE(cut.damage);
  EXPECT_EQ(cut.damage->line, 4U);
  EXPECT_TRUE(cut.damage->what.starts_with("truncated")) << cut.damage->what;
}

TEST_F(EventsFileTest, FilesThatCannotBeReadAreInputErrors) {
  EXPECT_THROW(read_events(directory_ / "absent.csv", 1), InputError);
  EXPECT_THROW(read_events(directory_ / "", 1), InputError);
}

TEST(EventsWriterTest, KeepsErrorOfFullDisk) {
  EventsWriter writer("/dev/full");
  writer.write({0.0, 0, pulse});
  EXPECT_TRUE(writer.good());
  EXPECT_FALSE(writer.flush());
  EXPECT_EQ(writer.error(), "/dev/full: No space left on device");
  EXPECT_FALSE(writer.close());
}

}  // namespace
}  // namespace sprag
