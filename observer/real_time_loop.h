// The real-time loop: the integrating thread. It takes messages, brings the time line to the tick
// that is due and hands estimates on. No allocation, no lock, no I/O.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "observer/estimation.h"
#include "observer/figures.h"
#include "observer/identification_thread.h"
#include "observer/mailboxes.h"
#include "observer/master_clock.h"
#include "observer/notices.h"
#include "observer/settled_follower.h"
#include "recording/session_tracker.h"

namespace sprag {

class RealTimeLoop {
 public:
  /// Estimates up to tick `last`. Everything must outlive this.
  RealTimeLoop(Estimation& estimation, std::int64_t last, Freshness freshness, Inbox& inbox,
               Outbox& outbox, Notices& notices);
  RealTimeLoop(const RealTimeLoop&) = delete;
  RealTimeLoop& operator=(const RealTimeLoop&) = delete;

  /// Where an adaptive estimator's identifications are made; it must outlive this.
  void identify_in(IdentificationThread& thread);

  /// Who hears of what has settled; it must outlive this.
  void tell_settled_to(SettledFollower& follower) { follower_ = &follower; }

  /// Runs until tick `last` has settled, or until `stop`. A signal ends it as well.
  void run(const std::atomic<bool>& stop);

  /// Whether tick `last` has settled; any thread may ask.
  bool done() const { return done_; }

  /// After run().
  const IntegrationFigures& figures() const { return figures_; }
  const MessageCounts& messages() const { return sessions_.counts(); }

 private:
  using State = Estimation::State;
  enum class Pace { catching_up, kept, lost };

  void turn(bool& in_time);
  void wait();

  // Reports.
  void take_messages();
  void take_followed();
  void take(const ReceivedMessage& received);
  void start(const ReceivedMessage& received);
  void start_again(const ReceivedMessage& received);
  void resume(const ReceivedMessage& received);
  void tell_ignored(const ReceivedMessage& received, const MessageCounts& before);
  void receive_events(const ContactMessage& message, bool after_a_loss, bool resumed);

  // Ticks.
  bool advance(std::int64_t now);
  std::int64_t tick_for_now(std::int64_t now) const;
  void on_tick(const State& state);
  bool on_settled(const State& state);
  bool tell_settled(std::int64_t tick);
  void repeat_corrected();
  void identify();
  bool send(bool settled, const State& state);

  // Time.
  void watch(std::int64_t now);
  void end_loss(std::int64_t now);
  void account(std::int64_t begin);
  bool paced() const;
  bool at_end() const;
  void announce(Announcement::Kind kind);
  void tell_status(std::int64_t now);

  Estimation& estimation_;
  TimeLine<TrackingEstimator>& time_line_;
  double h_;
  std::int64_t last_;
  Inbox& inbox_;
  Outbox& outbox_;
  Notices& notices_;
  MasterClock clock_;
  SessionTracker sessions_;
  std::int64_t first_received_ = 0, last_received_ = 0;
  int stands_still_ = 0;  // messages in a row with the same horizon
  double last_horizon_ = 0.0;
  bool corrected_ = false;  // the last tick reached, since it was sent
  std::int64_t corrected_rollbacks_ = 0;
  std::int64_t reached_ = -1;
  std::int64_t rollbacks_ = 0;
  std::vector<std::int64_t> new_events_due_;  // local times
  Pace pace_ = Pace::catching_up;
  std::int64_t lost_since_ = 0;
  bool silent_ = false;
  SettledFollower* follower_ = nullptr;
  std::int64_t reported_start_ = 0;   // of the time line
  std::int64_t reported_events_ = 0;  // so many of all that were taken
  IdentificationThread* identification_ = nullptr;
  AdaptationTask wanted_;
  bool asked_ = true;  // the thread has been told of it
  std::atomic<bool> done_{false};
  IntegrationFigures figures_;
  IntegrationStatus status_;          // with what has been since the last one was told
  std::int64_t status_reported_ = 0;  // local time
};

}  // namespace sprag
