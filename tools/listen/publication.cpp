#include "tools/listen/publication.h"

#include <iostream>
#include <stdexcept>
#include <utility>

#include "lcmtypes/wall_clock.h"
#include "sprag/detail/text/printable.h"

namespace sprag {

ListenPublication::ListenPublication(int contacts, PublisherSettings settings,
                                     const std::filesystem::path& record, std::string source)
    : contacts_(contacts), settings_(std::move(settings)), source_(std::move(source)) {
  if (!record.empty()) {
    log_.emplace(record);
    if (!log_->good()) throw std::runtime_error(log_->error());
    settings_.copy = [this](std::string_view channel, std::span<const std::uint8_t> message) {
      write(channel, message);
    };
  }
  publisher_ = std::make_unique<EventPublisher>(contacts_, settings_);
}

void ListenPublication::write(std::string_view channel,
                              std::span<const std::uint8_t> message) noexcept {
  const std::lock_guard lock(log_mutex_);
  log_->write(wall_clock_us(), channel, message);
}

void ListenPublication::events(std::span<const ContactEvent> events, double watermark) {
  publish([this, taken = std::vector(events.begin(), events.end()), watermark] {
    for (const ContactEvent& event : taken) {
      if (publisher_->take(event)) ++published_;
    }
    publisher_->set_horizon(watermark);
  });
}

void ListenPublication::start_input(double t0, double dt) {
  publish([this, t0, dt] { publisher_->start_input(t0, dt); });
}

void ListenPublication::sample(std::int64_t k, double value) {
  publish([this, k, value] { publisher_->take_sample(k, value); });
}

// Final messages take 0.2 s. Lines are read on meanwhile, since they may be stamped on arrival.
// The new session sends nothing until then: a receiver would see two masters.
void ListenPublication::new_session() {
  open();
  closed_ = false;
  closing_ = std::jthread([this] {
    publisher_->close();
    closed_ = true;
  });
}

void ListenPublication::pass() {
  if (closed_) open();
}

// Begins the next session if one was ended.
void ListenPublication::open() {
  if (!closing_.joinable()) return;
  closing_.join();
  sent_ += publisher_->sent();
  unsent_ += publisher_->unsent();
  publisher_ = std::make_unique<EventPublisher>(contacts_, settings_);
  for (const auto& action : std::exchange(waiting_, {})) action();
}

// Runs the action now, or once the next session is open.
void ListenPublication::publish(std::function<void()> action) {
  pass();
  if (!closing_.joinable()) return action();
  waiting_.push_back(std::move(action));
}

void ListenPublication::problem(std::int64_t number, const std::string& text,
                                const std::string& why) {
  if (++problems_ <= most_shown) {
    std::cerr << source_ << ':' << number << ": " << printable(why) << "; skipped: '"
              << printable(text) << "'\n";
  } else if (problems_ == most_shown + 1) {
    std::cerr << source_ << ": further lines that cannot be used are counted\n";
  }
}

void ListenPublication::notice(const std::string& text) {
  if (++notices_ <= most_shown) {
    std::cerr << source_ << ": " << printable(text) << '\n';
  } else if (notices_ == most_shown + 1) {
    std::cerr << source_ << ": further messages of this kind are left out\n";
  }
}

void ListenPublication::flush() {
  const std::lock_guard lock(log_mutex_);
  if (!log_ || log_->flush() || std::exchange(said_failure_, true)) return;
  std::cerr << log_->error() << ": the recording is incomplete; publishing goes on\n";
}

void ListenPublication::finish() {
  if (std::exchange(finished_, true)) return;
  open();
  publisher_->close();
  const std::lock_guard lock(log_mutex_);
  if (log_ && !log_->close()) throw std::runtime_error(log_->error());
}

}  // namespace sprag
