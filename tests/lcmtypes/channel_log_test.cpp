// Would catch a log that liblcm reads differently, and damage that loses more records than it
// covers.
#include "lcmtypes/channel_log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <lcm/lcm-cpp.hpp>
#include <random>

#include "tests/support/repetitions.h"
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

  std::vector<LogDamage> damages(const std::string& bytes, std::size_t expected_records) {
    ChannelLogReader reader(write_text(directory_ / "damaged.lcmlog", bytes));
    EXPECT_EQ(read_all(reader).size(), expected_records);
    ChannelRecord record;
    EXPECT_FALSE(reader.next(record));
    return reader.damages();
  }

  /// The only damage.
  LogDamage damage(const std::string& bytes, std::size_t expected_records) {
    const auto found = damages(bytes, expected_records);
    EXPECT_EQ(found.size(), 1U);
    return found.empty() ? LogDamage{} : found.front();
  }

  /// Random records, and the begin of each; the last entry is the file's size.
  std::string random_log(std::mt19937_64& random, std::vector<ChannelRecord>& records,
                         std::vector<std::size_t>& starts) {
    const auto file = directory_ / "random.lcmlog";
    ChannelLogWriter writer(file);
    starts.push_back(0);
    for (int i = 0; i < 100; ++i) {
      ChannelRecord record{i, static_cast<std::int64_t>(random() >> 2U), "C", {}};
      record.channel.append(random() % 60, 'x');
      record.data.resize(i == 50 ? 300000 : random() % 700);
      for (std::uint8_t& byte : record.data) byte = static_cast<std::uint8_t>(random());
      writer.write(record.utime, record.channel, record.data);
      starts.push_back(starts.back() + head_size + record.channel.size() + record.data.size());
      records.push_back(record);
    }
    EXPECT_TRUE(writer.close());
    return read_text(file);
  }

  static bool same(const ChannelRecord& a, const ChannelRecord& b) {
    return a.number == b.number && a.utime == b.utime && a.channel == b.channel && a.data == b.data;
  }

  TemporaryDirectory directory_;
};

TEST_F(ChannelLogTest, BytesMatchTheFormat) {
  const std::string expected(
      "\xED\xA1\xDA\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x03\xE8\0\0\0\x01\0\0\0\x05"
      "A\x01\x02\x03\x04\x05",
      head_size + 6);
  EXPECT_EQ(three_records().substr(0, expected.size()), expected);
}

TEST_F(ChannelLogTest, RandomRecordsRoundTripAndLiblcmReadsThem) {
  std::mt19937_64 random(11);
  std::vector<ChannelRecord> records;
  std::vector<std::size_t> starts;
  const auto file = write_text(directory_ / "copy.lcmlog", random_log(random, records, starts));
  ChannelLogReader reader(file);
  const auto back = read_all(reader);
  EXPECT_TRUE(reader.damages().empty());
  lcm::LogFile lcm_log(file.string(), "r");
  ASSERT_EQ(back.size(), records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    EXPECT_TRUE(same(back[i], records[i])) << i;
    const lcm::LogEvent* event = lcm_log.readNextEvent();
    ASSERT_NE(event, nullptr);
    const auto* data = static_cast<const std::uint8_t*>(event->data);
    EXPECT_TRUE(
        same({event->eventnum, event->timestamp, event->channel, {data, data + event->datalen}},
             records[i]))
        << i;
  }
}

TEST_F(ChannelLogTest, ReadsLogsOfLiblcm) {
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
  EXPECT_TRUE(reader.damages().empty());
}

TEST_F(ChannelLogTest, TruncatedLogDeliversCompleteRecordsAndNamesBrokenOne) {
  const std::string whole = three_records();
  const std::vector<std::size_t> starts = {0, head_size + 6, 2 * head_size + 6 + 14, whole.size()};
  ASSERT_EQ(whole.size(), 3 * head_size + 6 + 14 + 13 + 3);
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    std::size_t records = 0;
    while (records < 3 && starts[records + 1] <= length) ++records;
    const auto found = damages(whole.substr(0, length), records);
    const bool clean = starts[records] == length;
    ASSERT_EQ(found.empty(), clean) << length;
    if (clean) continue;
    EXPECT_EQ(found[0].begin, starts[records]) << length;
    EXPECT_EQ(found[0].end, length);
    EXPECT_TRUE(found[0].to_the_end);
    EXPECT_EQ(found[0].what, "truncated record") << length;
  }
}

TEST_F(ChannelLogTest, LostSyncLosesOneRecord) {
  std::string bytes = three_records();
  const std::size_t second = head_size + 6;
  const std::size_t third = second + head_size + 14;
  bytes[second] = 'x';
  LogDamage found = damage(bytes, 2);
  EXPECT_EQ(found.begin, second);
  EXPECT_EQ(found.end, third);
  EXPECT_FALSE(found.to_the_end);
  EXPECT_EQ(found.what, "sync word missing");

  found = damage(three_records() + "junk", 3);
  EXPECT_EQ(found.what, "sync word missing");
  EXPECT_TRUE(found.to_the_end);
  found = damage("junk" + three_records(), 3);
  EXPECT_EQ(found.begin, 0U);
  EXPECT_EQ(found.end, 4U);
  const std::string text = "not a log at all, but some text that somebody wrote";
  EXPECT_EQ(damage(text, 0).end, text.size());
  EXPECT_TRUE(damages("", 0).empty());
}

TEST_F(ChannelLogTest, AbsurdLengthsAreRefused) {
  const std::size_t second = head_size + 6;
  const auto with = [&](std::size_t offset, std::string_view length) {
    std::string bytes = three_records();
    const LogDamage found = damage(bytes.replace(second + offset, 4, length), 2);
    EXPECT_EQ(found.begin, second);
    EXPECT_EQ(found.end, second + head_size + 14);
    return found.what;
  };
  using namespace std::string_view_literals;
  for (const auto length :
       {"\0\0\0\0"sv, "\xff\xff\xff\xff"sv, "\0\0\x03\xe8"sv, "\x7f\xff\xff\xff"sv})
    EXPECT_TRUE(with(20, length).starts_with("channel length"));
  for (const auto length : {"\xff\xff\xff\xff"sv, "\x80\0\0\0"sv, "\x7f\xff\xff\xff"sv})
    EXPECT_TRUE(with(24, length).starts_with("data length"));
  EXPECT_EQ(with(24, "\x10\0\0\0"sv), "truncated record");  // 256 MiB, beyond the file
  // A valid length within the file, but beyond the next record.
  for (const auto length : {"\0\0\0\x05"sv, "\0\0\0\x10"sv, "\0\0\0\x20"sv})
    EXPECT_EQ(with(24, length), "wrong length");
}

TEST_F(ChannelLogTest, SyncWordInMessageIsIgnored) {
  // A valid head of a record inside the message of a record whose own head is damaged.
  const std::string head = three_records().substr(0, head_size + 6);
  const std::string data = "abc" + head + "defghijklm" + head.substr(0, 4) + "n";
  ChannelLogWriter writer(directory_ / "nested.lcmlog");
  const auto* first = reinterpret_cast<const std::uint8_t*>(data.data());
  for (int i = 0; i < 3; ++i) writer.write(i, "A", {first, data.size()});
  ASSERT_TRUE(writer.close());
  std::string bytes = read_text(directory_ / "nested.lcmlog");
  const std::size_t size = bytes.size() / 3;
  EXPECT_TRUE(damages(bytes, 3).empty());
  bytes[size] = 'x';
  const LogDamage found = damage(bytes, 2);
  EXPECT_EQ(found.begin, size);
  EXPECT_EQ(found.end, 2 * size);
}

TEST_F(ChannelLogTest, StrayBytesLoseOnlyCoveredRecords) {
  const unsigned seed = 12;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::vector<ChannelRecord> records;
  std::vector<std::size_t> starts;
  const std::string log = random_log(random, records, starts);
  for (int trial = 0; trial < repetitions(400); ++trial) {
    const bool inserted = trial % 2 == 0;
    const std::size_t begin = random() % (log.size() - 1000);
    std::string stray(1 + random() % 1000, 'x');
    for (char& byte : stray) byte = static_cast<char>(random());
    std::string bytes = log;
    bytes.replace(begin, inserted ? 0 : stray.size(), stray);
    const std::size_t end = inserted ? begin : begin + stray.size();
    ChannelLogReader reader(write_text(directory_ / "stray.lcmlog", bytes));
    const auto read = read_all(reader);
    std::size_t next = 0;
    std::size_t untouched = 0;
    for (std::size_t i = 0; i < records.size(); ++i) {
      if (starts[i] < end && starts[i + 1] > begin) continue;
      if (inserted && starts[i] < begin && begin < starts[i + 1]) continue;
      ++untouched;
      while (next < read.size() && !same(read[next], records[i])) ++next;
      ASSERT_LT(next, read.size())
          << trial << ": record " << i << " from " << starts[i] << " is lost; " << stray.size()
          << (inserted ? " inserted at " : " written at ") << begin << ", "
          << testing::PrintToString(reader.damages().size()) << " damages, the first from "
          << (reader.damages().empty() ? 0 : reader.damages()[0].begin) << " to "
          << (reader.damages().empty() ? 0 : reader.damages()[0].end);
    }
    EXPECT_LE(read.size(), untouched + 1) << trial;  // one may be damaged in its data only
    const auto& damages = reader.damages();
    ASSERT_LE(damages.size(), 1U) << trial;
    if (damages.empty()) continue;
    const std::size_t shift = inserted ? stray.size() : 0;
    EXPECT_NE(std::find(starts.begin(), starts.end(), damages[0].end - shift), starts.end());
  }
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
