#include "lcmtypes/event_publisher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <utility>

#include "lcmtypes/refusal.h"

namespace sprag {
namespace {

// If the watermark of a paced machine stays the same in more messages than this, observers conclude
// that its run has ended.
constexpr int most_repeats = 2;

// Observers refuse finite speeds above this limit as damaged.
double checked_speed(double speed) {
  if (speed > 0.0 && (speed <= 1e9 || std::isinf(speed))) return speed;
  throw std::invalid_argument("speed is " + std::to_string(speed) +
                              "; must be > 0 and at most 1e9, or infinite");
}

int checked_contacts(int contacts) {
  if (contacts >= 1 && contacts <= max_contacts) return contacts;
  throw std::invalid_argument("contacts is " + std::to_string(contacts) + "; must be from 1 to " +
                              std::to_string(max_contacts));
}

Bus open_bus(const PublisherSettings& settings) {
  Bus bus(settings.url, settings.key);
  if (settings.copy) bus.copy_published(settings.copy);
  return bus;
}

void check_time(double t) {
  if (t >= 0.0 && std::isfinite(t)) return;
  throw std::invalid_argument("t is " + std::to_string(t) + "; must be a number >= 0");
}

bool earlier(const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; }

}  // namespace

EventPublisher::EventPublisher(int contacts, const PublisherSettings& settings)
    : contacts_(checked_contacts(contacts)),
      paced_(!std::isinf(settings.speed)),
      bus_(open_bus(settings)),
      sender_(bus_, contacts, checked_speed(settings.speed)),
      beats_([this](const std::stop_token& stop) { beat(stop); }) {}

EventPublisher::~EventPublisher() { close(); }

bool EventPublisher::take(const ContactEvent& event) {
  check_time(event.t);
  if (event.contact < 0 || event.contact >= contacts_) {
    throw std::invalid_argument("the machine has no contact " + std::to_string(event.contact + 1));
  }
  const std::lock_guard lock(mutex_);
  if (closed_ || event.t <= horizon_) return false;
  waiting_.insert(std::upper_bound(waiting_.begin(), waiting_.end(), event, earlier), event);
  return true;
}

void EventPublisher::set_horizon(double t) {
  check_time(t);
  const std::lock_guard lock(mutex_);
  if (closed_ || t <= horizon_) return;
  horizon_ = t;
  const auto end =
      std::upper_bound(waiting_.begin(), waiting_.end(), ContactEvent{t, 0, {}}, earlier);
  sender_.add({waiting_.begin(), end});
  waiting_.erase(waiting_.begin(), end);
  if (sender_.due()) send();
}

void EventPublisher::start_input(double t0, double dt) {
  if (!std::isfinite(t0) || !(dt > 0.0) || !std::isfinite(dt)) {
    throw std::invalid_argument("the input has t0 = " + std::to_string(t0) + " and dt = " +
                                std::to_string(dt) + "; must be finite, with dt > 0");
  }
  const std::lock_guard lock(mutex_);
  if (input_sender_) throw std::invalid_argument("the input has begun before");
  input_sender_.emplace(bus_, t0, dt, sender_.session());
}

bool EventPublisher::take_sample(std::int64_t k, double value) {
  if (k < 0 || k >= largest_number || !std::isfinite(value)) {
    throw std::invalid_argument("sample " + std::to_string(k) + " is " + std::to_string(value) +
                                "; must be finite, with a number from 0 to 2^53 - 1");
  }
  const std::lock_guard lock(mutex_);
  if (!input_sender_) throw std::invalid_argument("a sample comes before start_input()");
  const std::int64_t next = early_.empty() ? input_sender_->total() : early_.back().first + 1;
  if (closed_ || k < next) return false;
  if (begun()) {
    input_sender_->add(k, value);
  } else {
    early_.emplace_back(k, value);
  }
  return true;
}

void EventPublisher::close() noexcept {
  const std::lock_guard closing(closing_);
  beats_.request_stop();
  if (beats_.joinable()) beats_.join();
  const std::lock_guard lock(mutex_);
  if (std::exchange(closed_, true) || horizon_ < 0.0) return;
  for (int i = 0; i < ContactSender::goodbyes; ++i) {
    if (i > 0) std::this_thread::sleep_for(ContactSender::heartbeat);
    send();
    if (input_sender_) input_sender_->send();
  }
}

std::int64_t EventPublisher::sent() const {
  const std::lock_guard lock(mutex_);
  const std::int64_t of_input =
      input_sender_ ? input_sender_->messages() - input_sender_->unsent() : 0;
  return sender_.messages() - sender_.unsent() + of_input;
}

std::int64_t EventPublisher::unsent() const {
  const std::lock_guard lock(mutex_);
  return sender_.unsent() + (input_sender_ ? input_sender_->unsent() : 0);
}

// Sends nothing before the first watermark, since the machine's start time is unknown until then.
void EventPublisher::beat(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const bool repeats = !paced_ || repeats_ < most_repeats;
    if (input_sender_ && input_sender_->pending()) input_sender_->send();
    if (horizon_ >= 0.0 && sender_.due() && repeats) send();
    const auto soonest = ContactSender::Clock::now() + ContactSender::heartbeat / 2;
    wake_.wait_until(lock, stop, std::max(sender_.next(), soonest), [] { return false; });
  }
}

void EventPublisher::send() {
  repeats_ = horizon_ > said_ ? 0 : repeats_ + 1;
  said_ = horizon_;
  sender_.send(horizon_);
  for (const auto& [k, value] : early_) input_sender_->add(k, value);
  early_.clear();
}

}  // namespace sprag
