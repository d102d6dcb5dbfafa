#include "tools/listen/publication.h"

#include <iostream>
#include <stdexcept>
#include <utility>

#include "command_line/printable.h"
#include "lcmtypes/wall_clock.h"

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
  for (const ContactEvent& event : events) {
    if (publisher_->take(event)) ++published_;
  }
  publisher_->set_horizon(watermark);
}

void ListenPublication::start_input(double t0, double dt) { publisher_->start_input(t0, dt); }

void ListenPublication::sample(std::int64_t k, double value) { publisher_->take_sample(k, value); }

// Lines of the new session wait for nothing: the old one ends in a thread of its own.
void ListenPublication::new_session() {
  if (closing_.size() == most_closing) closing_.erase(closing_.begin());
  closing_.emplace_back([this, old = std::move(publisher_)] {
    old->close();
    sent_ += old->sent();
    unsent_ += old->unsent();
  });
  publisher_ = std::make_unique<EventPublisher>(contacts_, settings_);
}

void ListenPublication::problem(const LineProblem& problem) {
  if (++problems_ <= most_shown) {
    std::cerr << source_ << ':' << problem.number << ": " << printable(problem.why)
              << "; skipped: '" << printable(problem.text) << "'\n";
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
  publisher_->close();
  closing_.clear();
  const std::lock_guard lock(log_mutex_);
  if (log_ && !log_->close()) throw std::runtime_error(log_->error());
}

}  // namespace sprag
