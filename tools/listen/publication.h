// Publishes the events of listen: one EventPublisher for each session of the device, a recording,
// and messages for the user.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/event_publisher.h"
#include "tools/listen/intake.h"

namespace sprag {

class ListenPublication : public IntakeSink {
 public:
  /// `source`: its name in messages. `record`: an LCM log, or empty. Throws BusError, UrlError, and
  /// std::runtime_error if the log cannot be created.
  ListenPublication(int contacts, PublisherSettings settings, const std::filesystem::path& record,
                    std::string source);
  ~ListenPublication() override = default;
  ListenPublication(const ListenPublication&) = delete;
  ListenPublication& operator=(const ListenPublication&) = delete;

  void events(std::span<const ContactEvent> events, double watermark) override;
  void start_input(double t0, double dt) override;
  void sample(std::int64_t k, double value) override;
  void new_session() override;
  void problem(std::int64_t number, const std::string& text, const std::string& why) override;
  void notice(const std::string& text) override;

  /// Called several times a second: begins a new session as soon as the old one has ended.
  void pass();

  /// Writes the recording so far to the disk. Once, if that fails, prints a message.
  void flush();

  /// Sends the final messages and completes the recording. Throws std::runtime_error if it is not
  /// complete.
  void finish();

  /// Counts; complete after finish().
  std::int64_t messages() const { return sent_ + publisher_->sent(); }
  std::int64_t unsent() const { return unsent_ + publisher_->unsent(); }
  std::int64_t published() const { return published_; }  ///< events

 private:
  /// At most this many messages of one kind; the others are counted.
  static constexpr std::int64_t most_shown = 20;

  void open();
  void publish(std::function<void()> action);
  void write(std::string_view channel, std::span<const std::uint8_t> message) noexcept;

  int contacts_;
  PublisherSettings settings_;
  std::string source_;
  std::mutex log_mutex_;
  std::optional<ChannelLogWriter> log_;
  std::unique_ptr<EventPublisher> publisher_;
  // Sends the final messages of publisher_, whose session has ended. Joinable from new_session()
  // until the next session is open.
  std::jthread closing_;
  std::atomic<bool> closed_ = false;            // closing_ is done
  std::vector<std::function<void()>> waiting_;  // for the next session, in order
  std::int64_t sent_ = 0, unsent_ = 0;          // of earlier sessions
  std::int64_t published_ = 0;
  std::int64_t problems_ = 0, notices_ = 0;
  bool finished_ = false;
  bool said_failure_ = false;
};

}  // namespace sprag
