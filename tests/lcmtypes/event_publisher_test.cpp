// Would catch a publisher that sends an event twice or before its horizon, unsigned, or falls
// silent.
#include "lcmtypes/event_publisher.h"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/estimate_listener.h"
#include "tests/support/temporary_directory.h"
#include "tests/support/udp_url.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

using enum ContactEventKind;

/// Receives the published messages.
class Receiver {
 public:
  explicit Receiver(const std::string& url, std::optional<Key> key = std::nullopt)
      : bus_(url, key) {
    bus_.subscribe(contacts_channel,
                   [this](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
                     ContactMessage report;
                     EXPECT_EQ(decode(data, report), Refusal::none);
                     reports.push_back(report);
                   });
  }

  /// Whether `count` reports have arrived in the end.
  bool receives(std::size_t count) {
    for (int silence = 0; reports.size() < count && silence < 30;)
      silence = bus_.handle(1s) > 0 ? 0 : silence + 1;
    return reports.size() >= count;
  }
  /// Receives until no more messages arrive.
  void receive_all() {
    while (bus_.handle(500ms) > 0) continue;
  }
  std::int64_t unauthenticated() const { return bus_.counts().unauthenticated; }

  std::vector<ContactMessage> reports;

 private:
  Bus bus_;
};

TEST(EventPublisher, EventsAreSentOnceHorizonReachesThem) {
  const std::string url = test::udp_url();
  Receiver receiver(url);
  EventPublisher publisher(2, {.url = url});
  EXPECT_TRUE(publisher.take({0.7, 1, ContactEventKind::opens}));
  EXPECT_TRUE(publisher.take({0.5, 1, ContactEventKind::closes}));
  EXPECT_TRUE(publisher.take({0.5, 0, pulse}));
  std::this_thread::sleep_for(50ms);
  publisher.set_horizon(0.6);
  ASSERT_TRUE(receiver.receives(1));
  const ContactMessage& report = receiver.reports.front();  // the first message
  EXPECT_EQ(report.session, publisher.session());
  EXPECT_EQ(report.contacts, 2);
  EXPECT_EQ(report.horizon, 0.6);
  EXPECT_EQ(report.speed, 1.0);
  EXPECT_EQ(report.closed, bit(1));
  ASSERT_EQ(report.records, 2);
  EXPECT_EQ(report.record[0], (ContactEvent{0.5, 1, ContactEventKind::closes}));
  EXPECT_EQ(report.record[1], (ContactEvent{0.5, 0, pulse}));
  EXPECT_FALSE(publisher.take({0.6, 0, pulse}));

  receiver.reports.clear();
  publisher.set_horizon(0.8);
  do {
    ASSERT_TRUE(receiver.receives(1));
    if (receiver.reports.back().horizon == 0.8) break;
    receiver.reports.clear();
  } while (true);
  EXPECT_EQ(receiver.reports.back().records_total, 3);
  EXPECT_EQ(receiver.reports.back().closed, 0U);
}

// The copy is what the network gets, with the tag.
TEST(EventPublisher, CopiesEveryMessageAsSent) {
  const std::string url = test::udp_url();
  const test::TemporaryDirectory directory;
  const Key key(test::write_text(directory / "key", std::string(64, '7') + "\n"));
  Bus receiver(url, key);
  Receiver other(url, Key(std::array<std::uint8_t, Key::size>{4}));
  std::vector<std::vector<std::uint8_t>> received, copied;
  receiver.subscribe(contacts_channel,
                     [&](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
                       const auto sent = receiver.as_sent(data);
                       received.emplace_back(sent.begin(), sent.end());
                     });
  EventPublisher publisher(1,
                           {.url = url,
                            .key = key,
                            .copy = [&](std::string_view, std::span<const std::uint8_t> message) {
                              copied.emplace_back(message.begin(), message.end());
                            }});
  publisher.take({0.5, 0, pulse});
  publisher.set_horizon(1.0);
  publisher.close();
  while (receiver.handle(500ms) > 0) continue;
  EXPECT_GE(copied.size(), 20U);
  EXPECT_EQ(copied.size(), static_cast<std::size_t>(publisher.sent()));
  EXPECT_EQ(received, copied);
  other.receive_all();
  EXPECT_TRUE(other.reports.empty());
  EXPECT_EQ(other.unauthenticated(), publisher.sent());
}

TEST(EventPublisher, HeartbeatsContinueAndLastMessageIsRepeated) {
  const std::string url = test::udp_url();
  Receiver receiver(url);
  EventPublisher publisher(1, {.url = url, .speed = std::numeric_limits<double>::infinity()});
  publisher.take({0.5, 0, pulse});
  publisher.set_horizon(1.0);
  ASSERT_TRUE(receiver.receives(10));
  publisher.close();
  EXPECT_FALSE(publisher.take({2.0, 0, pulse}));
  publisher.set_horizon(2.0);
  publisher.close();
  receiver.receive_all();
  ASSERT_GE(receiver.reports.size(), 30U);
  EXPECT_EQ(receiver.reports.size(), static_cast<std::size_t>(publisher.sent()));
  EXPECT_EQ(publisher.unsent(), 0);
  for (std::size_t i = 0; i < receiver.reports.size(); ++i) {
    EXPECT_EQ(receiver.reports[i].sequence,
              receiver.reports[0].sequence + static_cast<std::int64_t>(i));
    EXPECT_EQ(receiver.reports[i].horizon, 1.0);
    EXPECT_EQ(receiver.reports[i].records_total, 1);
  }
}

TEST(EventPublisher, PausedMachineIsNotReportedAsEnded) {
  const std::string url = test::udp_url();
  Receiver receiver(url);
  EventPublisher publisher(1, {.url = url});
  publisher.set_horizon(1.0);
  receiver.receive_all();
  EXPECT_EQ(receiver.reports.size(), 3U);
  publisher.set_horizon(2.0);
  receiver.receive_all();
  EXPECT_EQ(receiver.reports.size(), 6U);
  publisher.close();
  receiver.receive_all();
  EXPECT_EQ(receiver.reports.size(), 26U);
}

// Observers ignore samples of a session that no contact message has begun.
TEST(EventPublisher, SamplesFollowTheFirstContactMessage) {
  std::vector<std::string> channels;
  std::vector<double> samples;
  const auto keep = [&](std::string_view channel, std::span<const std::uint8_t> message) {
    channels.emplace_back(channel);
    InputMessage input;
    if (channel != input_channel) return;
    EXPECT_EQ(decode(message, input), Refusal::none);
    for (auto k = static_cast<std::int64_t>(samples.size()); k < input.total; ++k)
      samples.push_back(input.sample(k));
  };
  EventPublisher publisher(1, {.url = test::udp_url(), .copy = keep});
  publisher.start_input(0.0, 1e-3);
  for (int k = 0; k < 400; ++k) EXPECT_TRUE(publisher.take_sample(k, 0.5 * k));
  EXPECT_FALSE(publisher.take_sample(399, 1.0));
  std::this_thread::sleep_for(50ms);
  publisher.set_horizon(0.3);
  EXPECT_TRUE(publisher.take_sample(400, 200.0));
  publisher.close();
  ASSERT_FALSE(channels.empty());
  EXPECT_EQ(channels.front(), contacts_channel);
  ASSERT_EQ(samples.size(), 401U);
  for (std::size_t k = 0; k < samples.size(); ++k)
    EXPECT_EQ(samples[k], 0.5 * static_cast<double>(k));
}

TEST(EventPublisher, WrongArgumentsAreRefused) {
  const std::string url = test::udp_url();
  EXPECT_THROW(EventPublisher(0, {.url = url}), std::invalid_argument);
  EXPECT_THROW(EventPublisher(61, {.url = url}), std::invalid_argument);
  EXPECT_THROW(EventPublisher(1, {.url = url, .speed = 0.0}), std::invalid_argument);
  EXPECT_THROW(EventPublisher(1, {.url = "carrier pigeon"}), UrlError);
  EventPublisher publisher(1, {.url = url});
  EXPECT_THROW(publisher.take({-1.0, 0, pulse}), std::invalid_argument);
  EXPECT_THROW(publisher.take({1.0, 1, pulse}), std::invalid_argument);
  EXPECT_THROW(publisher.set_horizon(std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

TEST(EstimateListener, ReceivesEstimatesOfItsChannel) {
  const std::string url = test::udp_url();
  EstimateListener now(EstimateChannel::now, url), settled(EstimateChannel::settled, url);
  Bus bus(url);
  estimate_t sample{};
  sample.tick = 7;
  sample.t = 0.07;
  sample.f = 2;
  sample.q = {1.0, 2.0};
  sample.u = {3.0, 4.0};
  std::vector<std::uint8_t> buffer;
  ASSERT_TRUE(bus.publish(settled_channel, encode(sample, buffer)));
  ASSERT_TRUE(bus.publish(settled_channel, std::vector<std::uint8_t>(10)));
  const auto estimate = settled.next(10s);
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->tick, 7);
  EXPECT_EQ(estimate->u, sample.u);
  EXPECT_FALSE(settled.next(50ms));
  EXPECT_EQ(settled.refused(), 1);
  EXPECT_FALSE(now.next(0ms));
}

}  // namespace
}  // namespace sprag
