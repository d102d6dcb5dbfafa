// Lock-free queues and flags between the threads of a live observer.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "observer/estimate_sample.h"
#include "observer/health.h"
#include "observer/spsc_queue.h"
#include "observer/wake.h"
#include "recording/arrival.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {

struct ReceivedMessage {
  ContactMessage message;
  Arrival arrival;
};

struct ReceivedInput {
  InputMessage message;
  std::int64_t arrival = 0;  ///< monotonic [ns]
};

/// From the receiving thread to the integrating thread. Messages of the followed session have a
/// queue of their own, so that other senders cannot fill it.
struct Inbox {
  static constexpr std::size_t slots = 1024;

  SpscQueue<ReceivedMessage> followed{slots, ReceivedMessage{}};
  SpscQueue<ReceivedMessage> strangers{slots, ReceivedMessage{}};
  SpscQueue<ReceivedInput> inputs{slots, ReceivedInput{}};  ///< on SPRAG_INPUT
  Wake arrived;
  std::atomic<bool> follows{false};  ///< set by the integrating thread when it follows a session
  std::atomic<std::int64_t> session{0};       ///< that session; valid once `follows` is set
  std::atomic<std::int64_t> last_arrival{0};  ///< of any contact message, monotonic [ns]
  /// Monotonic time [ns] of the last drop of messages that may have been the master's.
  std::atomic<std::int64_t> last_drop{0};
};

/// A change of the observer's state that is reported on stderr.
struct Announcement {
  enum class Kind {
    session,
    other_master,
    silence,
    end_of_run,
    input_silence,
    input_regained,
    real_time_lost,
    real_time_regained
  };
  Kind kind = Kind::session;
  std::int64_t session = 0;
  double t = 0.0;  ///< simulated [s]
};

struct Sample {
  bool settled = false;
  EstimateSample estimate;
};

/// From the integrating thread to the publishing thread.
struct Outbox {
  /// The queue of samples has a size of a few MB. `empty` is a sample with all vectors allocated.
  explicit Outbox(const EstimateSample& empty)
      : samples(sample_slots(empty), Sample{false, empty}),
        announcements(64, Announcement{}),
        statuses(8, IntegrationStatus{}) {}

  SpscQueue<Sample> samples;
  SpscQueue<Announcement> announcements;
  SpscQueue<IntegrationStatus> statuses;
  Wake ready;

 private:
  static std::size_t sample_slots(const EstimateSample& empty) {
    constexpr std::size_t bytes = 8 << 20, least = 1024, most = 16384;
    const Eigen::Index f = empty.q.size();
    const auto numbers = static_cast<std::size_t>(4 * f + empty.confidence.sigma_g.size() +
                                                  empty.confidence.sigma_outputs.size());
    return std::clamp(bytes / (sizeof(Sample) + sizeof(double) * numbers), least, most);
  }
};

}  // namespace sprag
