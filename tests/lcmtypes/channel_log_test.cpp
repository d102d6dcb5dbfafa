#include "lcmtypes/channel_log.h"

#include <gtest/gtest.h>

#include <lcm/lcm-cpp.hpp>
#include <random>

#include "mechanics/csv.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using test::read_text;
using test::TemporaryDirectory;
using test::write_text;

constexpr std::size_t head_size = 28;

std::vector<ChannelRecord> read_all(ChannelLogReader& reader) {
  std::vector<ChannelRecord> records;
  for (ChannelRecord record; reader.next(record);) records.push_back(record);
  return records;
}

class ChannelLogTest : public testing::Test {
 protected:
  /// Three records of 5, 0 and 3 bytes on channels A, SPRAG_CONTACTS and LCM_SELF_TEST.
  std::string three_records() {
    const auto file = directory_ / "three.lcmlog";
    const std::vector<std::uint8_t> data = {1, 2, 3, 4, 5};
    ChannelLogWriter writer(file);
    writer.write(1000, "A", data);
    writer.write(2000, "SPRAG_CONTACTS", {});
    writer.write(3000, "LCM_SELF_TEST", std::span(data).first(3));
    EXPECT_TRUE(writer.close());
    return read_text(file);
  }

  std::optional<LogDamage> damage(const std::string& bytes, std::size_t expected_records) {
    ChannelLogReader reader(write_text(directory_ / "damaged.lcmlog", bytes));
    EXPECT_EQ(read_all(reader).size(), expected_records);
    ChannelRecord record;
    EXPECT_FALSE(reader.next(record));
    return reader.damage();
  }

  TemporaryDirectory directory_;
};

TEST_F(ChannelLogTest, BytesAreThoseOfTheFormat) {
  const std::string expected(
      "\xED\xA1\xDA\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x03\xE8\0\0\0\x01\0\0\0\x05"
      "A\x01\x02\x03\x04\x05",
      head_size + 6);
  EXPECT_EQ(three_records().substr(0, expected.size()), expected);
}

TEST_F(ChannelLogTest, RandomRecordsComeBackAndLiblcmReadsThem) {
  const unsigned seed = 11;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::vector<ChannelRecord> records;
  for (int i = 0; i < 300; ++i) {
    ChannelRecord record{i, static_cast<std::int64_t>(random() >> 2U), "C", {}};
    record.channel.append(random() % 60, 'x');
    record.data.resize(i == 150 ? 300000 : random() % 2000);
    for (std::uint8_t& byte : record.data) byte = static_cast<std::uint8_t>(random());
    records.push_back(record);
  }
  const auto file = directory_ / "random.lcmlog";
  ChannelLogWriter writer(file);
  for (const ChannelRecord& record : records)
    EXPECT_TRUE(writer.write(record.utime, record.channel, record.data));
  ASSERT_TRUE(writer.close());

  ChannelLogReader reader(file);
  const auto back = read_all(reader);
  EXPECT_FALSE(reader.damage());
  lcm::LogFile lcm_log(file.string(), "r");
  ASSERT_EQ(back.size(), records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(back[i].number, records[i].number);
    EXPECT_EQ(back[i].utime, records[i].utime);
    EXPECT_EQ(back[i].channel, records[i].channel);
    EXPECT_EQ(back[i].data, records[i].data);
    const lcm::LogEvent* event = lcm_log.readNextEvent();
    ASSERT_NE(event, nullptr);
    EXPECT_EQ(event->eventnum, records[i].number);
    EXPECT_EQ(event->timestamp, records[i].utime);
    EXPECT_EQ(event->channel, records[i].channel);
    const auto* data = static_cast<const std::uint8_t*>(event->data);
    EXPECT_EQ(std::vector<std::uint8_t>(data, data + event->datalen), records[i].data);
  }
}

TEST_F(ChannelLogTest, ReadsWhatLiblcmWrites) {
  const auto file = directory_ / "lcm.lcmlog";
  std::vector<std::uint8_t> data = {9, 8, 7};
  {
    lcm::LogFile log(file.string(), "w");
    lcm::LogEvent event{0, 123456789, "SPRAG_TRUTH", 3, data.data()};
    ASSERT_EQ(log.writeEvent(&event), 0);
  }
  ChannelLogReader reader(file);
  const auto records = read_all(reader);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].utime, 123456789);
  EXPECT_EQ(records[0].channel, "SPRAG_TRUTH");
  EXPECT_EQ(records[0].data, data);
  EXPECT_FALSE(reader.damage());
}

TEST_F(ChannelLogTest, EveryCutDeliversTheWholeRecordsAndNamesTheBrokenOne) {
  const std::string whole = three_records();
  const std::vector<std::size_t> starts = {0, head_size + 6, 2 * head_size + 6 + 14, whole.size()};
  ASSERT_EQ(whole.size(), 3 * head_size + 6 + 14 + 13 + 3);
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    std::size_t records = 0;
    while (records < 3 && starts[records + 1] <= length) ++records;
    const auto found = damage(whole.substr(0, length), records);
    const bool clean = starts[records] == length;
    ASSERT_EQ(!found, clean) << length;
    if (!clean) {
      EXPECT_EQ(found->offset, starts[records]) << length;
      EXPECT_EQ(found->what, "truncated record") << length;
    }
  }
}

TEST_F(ChannelLogTest, LostSyncIsReportedWhereItHappens) {
  std::string bytes = three_records();
  bytes[head_size + 6] = 'x';
  auto found = damage(bytes, 1);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->offset, head_size + 6);
  EXPECT_EQ(found->what, "sync word missing");

  found = damage(three_records() + "junk", 3);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->what, "sync word missing");
  EXPECT_TRUE(damage("not a log at all, but some text that somebody wrote", 0));
  EXPECT_FALSE(damage("", 0));
}

TEST_F(ChannelLogTest, AbsurdLengthsAreNotBelieved) {
  const auto with = [this](std::size_t offset, std::string_view length) {
    std::string bytes = three_records();
    return damage(bytes.replace(head_size + 6 + offset, 4, length), 1);
  };
  using namespace std::string_view_literals;
  for (const auto length :
       {"\0\0\0\0"sv, "\xff\xff\xff\xff"sv, "\0\0\x03\xe8"sv, "\x7f\xff\xff\xff"sv}) {
    const auto found = with(20, length);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->offset, head_size + 6);
    EXPECT_TRUE(found->what.starts_with("channel length")) << found->what;
  }
  for (const auto length : {"\xff\xff\xff\xff"sv, "\x80\0\0\0"sv, "\x7f\xff\xff\xff"sv})
    EXPECT_TRUE(with(24, length)->what.starts_with("data length"));
  EXPECT_EQ(with(24, "\x10\0\0\0"sv)->what, "truncated record");  // 256 MiB: possible, not there
}

TEST_F(ChannelLogTest, FilesThatCannotBeReadAreInputErrors) {
  EXPECT_THROW(ChannelLogReader(directory_ / "absent.lcmlog"), InputError);
  EXPECT_THROW(ChannelLogReader(directory_ / ""), InputError);
}

TEST_F(ChannelLogTest, WriterReportsThatTheDiskIsFull) {
  ChannelLogWriter writer("/dev/full");
  const std::vector<std::uint8_t> data(100000);
  EXPECT_FALSE(writer.write(0, "A", data));
  EXPECT_NE(writer.error().find("No space left"), std::string::npos);
  EXPECT_FALSE(writer.close());
  EXPECT_FALSE(ChannelLogWriter(directory_ / "absent" / "x.lcmlog").good());
}

}  // namespace
}  // namespace sprag
