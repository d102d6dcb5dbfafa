#include "lcmtypes/event_publisher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "sprag/estimation/message_builder.h"

namespace sprag {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto heartbeat = std::chrono::milliseconds(10);
constexpr int goodbyes = 20;
// Of a paced machine whose horizon stays more often than that, observers say that it has come to
// its end.
constexpr int most_repeats = 2;

std::int64_t random_session() {
  std::random_device device;
  const std::uint64_t high = device();
  const std::uint64_t low = device();
  return static_cast<std::int64_t>(((high << 32U) | low) >> 1U);
}

std::int64_t wall_clock_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Observers take finite speeds beyond that for damage.
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

void check_time(double t) {
  if (t >= 0.0 && std::isfinite(t)) return;
  throw std::invalid_argument("t is " + std::to_string(t) + "; must be a number >= 0");
}

}  // namespace

class EventPublisher::Core {
 public:
  Core(int contacts, const PublisherSettings& settings)
      : contacts_(checked_contacts(contacts)),
        paced_(!std::isinf(settings.speed)),
        builder_(random_session(), checked_speed(settings.speed), contacts),
        bus_(settings.url, settings.key),
        beats_([this](const std::stop_token& stop) { beat(stop); }) {}
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;
  ~Core() { close(); }

  bool take(const ContactEvent& event) {
    check_time(event.t);
    if (event.contact < 0 || event.contact >= contacts_) {
      throw std::invalid_argument("the machine has no contact " +
                                  std::to_string(event.contact + 1));
    }
    const std::lock_guard lock(mutex_);
    if (closed_ || event.t <= horizon_) return false;
    waiting_.insert(std::upper_bound(waiting_.begin(), waiting_.end(), event, earlier), event);
    return true;
  }

  void set_horizon(double t) {
    check_time(t);
    const std::lock_guard lock(mutex_);
    if (closed_ || t <= horizon_) return;
    horizon_ = t;
    const auto end =
        std::upper_bound(waiting_.begin(), waiting_.end(), ContactEvent{t, 0, {}}, earlier);
    builder_.add({waiting_.begin(), end});
    waiting_.erase(waiting_.begin(), end);
    if (builder_.pending() || Clock::now() >= next_beat_) send();
  }

  void close() noexcept {
    const std::lock_guard closing(closing_);
    beats_.request_stop();
    if (beats_.joinable()) beats_.join();
    const std::lock_guard lock(mutex_);
    if (std::exchange(closed_, true) || horizon_ < 0.0) return;
    for (int i = 0; i < goodbyes; ++i) {
      if (i > 0) std::this_thread::sleep_for(heartbeat);
      send();
    }
  }

  std::int64_t session() const { return builder_.session(); }
  std::int64_t sent() const {
    const std::lock_guard lock(mutex_);
    return builder_.sent() - unsent_;
  }
  std::int64_t unsent() const {
    const std::lock_guard lock(mutex_);
    return unsent_;
  }

 private:
  static bool earlier(const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; }

  // Nothing is said before the first horizon: where the machine's time begins is not known yet.
  void beat(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      const auto now = Clock::now();
      if (horizon_ >= 0.0 && now >= next_beat_ && (!paced_ || repeats_ < most_repeats)) send();
      wake_.wait_until(lock, stop, std::max(next_beat_, now + heartbeat / 2), [] { return false; });
    }
  }

  void send() {
    repeats_ = horizon_ > said_ ? 0 : repeats_ + 1;
    said_ = horizon_;
    do {
      encode(builder_.next(horizon_, wall_clock_us()), bytes_);
      if (!bus_.publish(contacts_channel, bytes_)) ++unsent_;
    } while (builder_.pending());
    next_beat_ = Clock::now() + heartbeat;
  }

  int contacts_;
  bool paced_;
  std::mutex closing_;
  mutable std::mutex mutex_;  // of all that follows
  std::condition_variable_any wake_;
  MessageBuilder builder_;
  Bus bus_;
  EncodedContacts bytes_{};
  std::vector<ContactEvent> waiting_;  // behind the horizon, in order
  double horizon_ = -1.0;              // none yet
  double said_ = -1.0;                 // in the last message
  int repeats_ = 0;                    // of it
  std::int64_t unsent_ = 0;
  bool closed_ = false;
  Clock::time_point next_beat_ = Clock::time_point::min();
  std::jthread beats_;  // last: it uses all the others
};

EventPublisher::EventPublisher(int contacts, const PublisherSettings& settings)
    : core_(std::make_unique<Core>(contacts, settings)) {}
EventPublisher::EventPublisher(EventPublisher&&) noexcept = default;
EventPublisher& EventPublisher::operator=(EventPublisher&&) noexcept = default;
EventPublisher::~EventPublisher() = default;

bool EventPublisher::take(const ContactEvent& event) { return core_->take(event); }
void EventPublisher::set_horizon(double t) { core_->set_horizon(t); }
void EventPublisher::close() noexcept { core_->close(); }
std::int64_t EventPublisher::session() const { return core_->session(); }
std::int64_t EventPublisher::sent() const { return core_->sent(); }
std::int64_t EventPublisher::unsent() const { return core_->unsent(); }

}  // namespace sprag
