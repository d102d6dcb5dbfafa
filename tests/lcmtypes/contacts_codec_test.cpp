#include "lcmtypes/contacts_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <random>
#include <sprag/contacts_t.hpp>

#include "lcmtypes/bus.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using enum ContactEventKind;

constexpr double quiet_nan = std::numeric_limits<double>::quiet_NaN();

// LCM's header, the channel's name with its terminator, the message.
static_assert(8 + sizeof "SPRAG_CONTACTS" + contacts_message_size < 1400);

ContactMessage random_report(std::mt19937_64& random) {
  ContactMessage report;
  report.session = static_cast<std::int64_t>(random());
  report.sequence = static_cast<std::int64_t>(random() >> 11U);
  report.utime = static_cast<std::int64_t>(random() >> 1U);
  report.speed = random() % 5 == 0 ? infinity : std::generate_canonical<double, 53>(random) + 1e-3;
  report.contacts = 1 + static_cast<int>(random() % max_contacts);
  report.closed = random() & (bit(report.contacts) - 1);
  report.records = static_cast<int>(random() % (max_records + 1));
  report.records_total = report.records + static_cast<std::int64_t>(random() % 1000);
  double t = 0.0;
  for (int i = 0; i < report.records; ++i) {
    if (random() % 4 != 0) t += std::generate_canonical<double, 53>(random);
    report.record.at(static_cast<std::size_t>(i)) = {
        t, static_cast<int>(random() % static_cast<unsigned>(report.contacts)),
        static_cast<ContactEventKind>(1 + random() % 3)};
  }
  report.horizon = t;
  return report;
}

void expect_equal(const ContactMessage& a, const ContactMessage& b) {
  EXPECT_EQ(a.session, b.session);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.utime, b.utime);
  EXPECT_EQ(a.speed, b.speed);
  EXPECT_EQ(a.horizon, b.horizon);
  EXPECT_EQ(a.closed, b.closed);
  EXPECT_EQ(a.contacts, b.contacts);
  EXPECT_EQ(a.records_total, b.records_total);
  ASSERT_EQ(a.records, b.records);
  EXPECT_TRUE(std::equal(a.record.begin(), a.record.begin() + a.records, b.record.begin()));
}

/// The report in LCM's generated type.
contacts_t to_lcm(const ContactMessage& report) {
  contacts_t message{};
  message.session = report.session;
  message.sequence = report.sequence;
  message.utime = report.utime;
  message.speed = report.speed;
  message.horizon = report.horizon;
  message.closed = static_cast<std::int64_t>(report.closed);
  message.contacts = report.contacts;
  message.records_total = report.records_total;
  message.records = report.records;
  for (int i = 0; i < report.records; ++i) {
    const ContactEvent& event = report.record.at(static_cast<std::size_t>(i));
    message.t[i] = event.t;
    message.contact[i] = static_cast<std::int8_t>(event.contact + 1);
    message.kind[i] = static_cast<std::int8_t>(event.kind);
  }
  return message;
}

EncodedContacts bytes(const contacts_t& message) {
  EncodedContacts result{};
  EXPECT_EQ(message.getEncodedSize(), static_cast<int>(result.size()));
  EXPECT_GT(message.encode(result.data(), 0, static_cast<int>(result.size())), 0);
  return result;
}

TEST(ContactsCodecTest, TypeHashIsStable) {
  EXPECT_EQ(static_cast<std::uint64_t>(contacts_t::getHash()), 0xcb9f618642cab9d1U);
}

TEST(ContactsCodecTest, RandomReportsRoundTripAndMatchLcmEncoding) {
  const unsigned seed = 1;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  for (int i = 0; i < 2000; ++i) {
    const ContactMessage report = random_report(random);
    EncodedContacts message;
    message.fill(0xee);
    encode(report, message);
    EXPECT_EQ(message, bytes(to_lcm(report)));
    ContactMessage back;
    ASSERT_EQ(decode(message, back), Refusal::none);
    expect_equal(report, back);
  }
}

TEST(ContactsCodecTest, EveryKindOfBadFieldIsRefusedWithItsCause) {
  ContactMessage report;
  report.contacts = 2;
  report.closed = 0b10;
  report.horizon = 3.0;
  report.records = 3;
  report.records_total = 3;
  report.record[0] = {1.0, 0, pulse};
  report.record[1] = {2.0, 1, closes};
  report.record[2] = {2.0, 0, pulse};
  const contacts_t good = to_lcm(report);
  ContactMessage back;
  ASSERT_EQ(decode(bytes(good), back), Refusal::none);

  const std::vector<std::pair<Refusal, std::function<void(contacts_t&)>>> cases = {
      {Refusal::bad_speed, [](auto& m) { m.speed = quiet_nan; }},
      {Refusal::bad_speed, [](auto& m) { m.speed = 0.0; }},
      {Refusal::bad_speed, [](auto& m) { m.speed = -infinity; }},
      {Refusal::bad_time, [](auto& m) { m.horizon = quiet_nan; }},
      {Refusal::bad_time, [](auto& m) { m.horizon = infinity; }},
      {Refusal::bad_time, [](auto& m) { m.horizon = -1.0; }},
      {Refusal::bad_count, [](auto& m) { m.contacts = 0; }},
      {Refusal::bad_count, [](auto& m) { m.contacts = -1; }},
      {Refusal::bad_count, [](auto& m) { m.contacts = 61; }},
      {Refusal::bad_closed, [](auto& m) { m.closed = 0b100; }},
      {Refusal::bad_closed, [](auto& m) { m.closed = std::numeric_limits<std::int64_t>::min(); }},
      {Refusal::bad_count, [](auto& m) { m.records = -1; }},
      {Refusal::bad_count, [](auto& m) { m.records_total = m.records = 121; }},
      {Refusal::bad_count, [](auto& m) { m.records = std::numeric_limits<std::int32_t>::max(); }},
      {Refusal::bad_count, [](auto& m) { m.records_total = 2; }},
      {Refusal::bad_count, [](auto& m) { m.records_total = -1; }},
      {Refusal::bad_count, [](auto& m) { m.records_total = (std::int64_t{1} << 53) + 1; }},
      {Refusal::bad_count, [](auto& m) { m.sequence = -1; }},
      {Refusal::bad_count, [](auto& m) { m.sequence = (std::int64_t{1} << 53) + 1; }},
      {Refusal::bad_time, [](auto& m) { m.t[1] = quiet_nan; }},
      {Refusal::bad_time, [](auto& m) { m.t[2] = infinity; }},
      {Refusal::bad_time, [](auto& m) { m.t[0] = -1e-9; }},
      {Refusal::bad_time, [](auto& m) { m.t[2] = 1.999; }},
      {Refusal::bad_contact, [](auto& m) { m.contact[0] = 0; }},
      {Refusal::bad_contact, [](auto& m) { m.contact[1] = 3; }},
      {Refusal::bad_contact, [](auto& m) { m.contact[2] = -128; }},
      {Refusal::bad_kind, [](auto& m) { m.kind[0] = 0; }},
      {Refusal::bad_kind, [](auto& m) { m.kind[1] = 4; }},
      {Refusal::bad_kind, [](auto& m) { m.kind[2] = -1; }},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    contacts_t bad = good;
    cases[i].second(bad);
    EXPECT_EQ(name(decode(bytes(bad), back)), name(cases[i].first)) << "case " << i;
  }
}

TEST(ContactsCodecTest, UnusedRecordsAreIgnored) {
  ContactMessage report;
  report.contacts = 1;
  contacts_t message = to_lcm(report);
  message.t[0] = quiet_nan;
  message.contact[5] = 99;
  message.kind[119] = -7;
  ContactMessage back;
  EXPECT_EQ(decode(bytes(message), back), Refusal::none);
}

TEST(ContactsCodecTest, WrongTypeAndWrongLengthAreRefused) {
  ContactMessage report;
  report.contacts = 60;
  report.closed = (ContactSet{1} << 60U) - 1;
  EncodedContacts message;
  encode(report, message);
  ContactMessage back;
  ASSERT_EQ(decode(message, back), Refusal::none);
  EXPECT_EQ(back.closed, report.closed);
  for (std::size_t size = 0; size < message.size(); ++size) {
    const std::vector<std::uint8_t> cut(message.begin(), message.begin() + static_cast<int>(size));
    ASSERT_EQ(decode(cut, back), Refusal::truncated) << size;
  }
  std::vector<std::uint8_t> longer(message.begin(), message.end());
  longer.push_back(0);
  EXPECT_EQ(decode(longer, back), Refusal::oversized);
  message[0] ^= 1U;
  EXPECT_EQ(decode(message, back), Refusal::wrong_type);
}

TEST(ContactsCodecTest, RandomBytesNeverYieldAnImpossibleReport) {
  const unsigned seed = 3;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  int accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    EncodedContacts message;
    encode(random_report(random), message);
    for (auto flips = random() % 4; flips-- > 0;)
      message.at(8 + random() % (message.size() - 8)) = static_cast<std::uint8_t>(random());
    ContactMessage back;
    if (decode(message, back) != Refusal::none) continue;
    ++accepted;
    ASSERT_TRUE(back.contacts >= 1 && back.contacts <= max_contacts);
    ASSERT_TRUE(back.records >= 0 && back.records <= max_records);
    for (int r = 0; r < back.records; ++r) {
      const ContactEvent& event = back.record.at(static_cast<std::size_t>(r));
      ASSERT_TRUE(std::isfinite(event.t) && event.t >= 0.0);
      ASSERT_TRUE(event.contact >= 0 && event.contact < back.contacts);
    }
  }
  EXPECT_GT(accepted, 0);
}

}  // namespace
}  // namespace sprag
