// The real-time loop of the integrating thread. It takes messages, advances the time line to the
// due tick and hands over estimates. It does not allocate, lock or do I/O.
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
  /// Estimates up to tick `last`. All arguments must outlive this.
  RealTimeLoop(Estimation& estimation, std::int64_t last, Freshness freshness, Inbox& inbox,
               Outbox& outbox, Notices& notices);
  RealTimeLoop(const RealTimeLoop&) = delete;
  RealTimeLoop& operator=(const RealTimeLoop&) = delete;

  /// Sets the thread that runs an adaptive estimator's identifications; it must outlive this.
  void identify_in(IdentificationThread& thread) { identification_ = &thread; }

  /// Sets the receiver of settled events and ticks; it must outlive this.
  void set_follower(SettledFollower& follower) { follower_ = &follower; }

  /// Runs until tick `last` has settled, or until `stop` or a signal.
  void run(const std::atomic<bool>& stop);

  /// Whether tick `last` has settled; may be called by any thread.
  bool done() const { return done_; }

  /// Valid after run().
  const IntegrationFigures& figures() const { return figures_; }
  const MessageCounts& messages() const { return sessions_.counts(); }

 private:
  using State = Estimation::State;
  enum class Pace { catching_up, kept, lost };

  void turn(bool& in_time);
  void wait();

  // Messages.
  void take_messages();
  void take_followed();
  void take_inputs();
  void take(const ReceivedMessage& received);
  void start(const ReceivedMessage& received);
  void start_again(const ReceivedMessage& received);
  void resume(const ReceivedMessage& received);
  void report_ignored(const ReceivedMessage& received, const MessageCounts& before);
  void receive_events(const ContactMessage& message, bool after_a_loss, bool resumed);

  // Ticks.
  bool advance(std::int64_t now);
  std::int64_t tick_for_now(std::int64_t now) const;
  void on_tick(const State& state);
  bool on_settled(const State& state);
  bool hand_over_events();
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
  void hand_over_status(std::int64_t now);

  Estimation& estimation_;
  TimeLine& time_line_;
  double h_;
  std::int64_t last_;
  Inbox& inbox_;
  Outbox& outbox_;
  Notices& notices_;
  MasterClock clock_;
  SessionTracker sessions_;
  std::int64_t first_received_ = 0, last_received_ = 0;
  int stands_still_ = 0;  // consecutive messages with the same watermark
  double last_horizon_ = 0.0;
  // The last tick reached was corrected by a rollback and is to be sent again. Set by a rollback;
  // cleared when the tick is sent, when a later tick is reached, or at a new start.
  bool corrected_ = false;
  std::int64_t corrected_rollbacks_ = 0;      // rollbacks seen by repeat_corrected()
  std::int64_t reached_ = -1;                 // last tick estimated
  std::int64_t rollbacks_ = 0;                // rollbacks seen by account()
  std::vector<std::int64_t> new_events_due_;  // local times of events received in this turn
  Pace pace_ = Pace::catching_up;
  std::int64_t lost_since_ = 0;
  std::int64_t last_input_ = 0;  // arrival of the last message of the input, monotonic [ns]
  bool input_silent_ = false;    // none for 1 s; updated by watch()
  bool silent_ = false;          // no contact message for 1 s; updated by watch()
  SettledFollower* follower_ = nullptr;
  std::int64_t reported_start_ = 0;   // start of the time line that the follower has received
  std::int64_t reported_events_ = 0;  // number of events that the follower has received
  double reported_horizon_ = -1.0;    // horizon that the follower has received [s]
  IdentificationThread* identification_ = nullptr;
  std::int64_t asked_ = 0;  // start of the time line whose task the thread runs; 0: none
  std::atomic<bool> done_{false};
  IntegrationFigures figures_;
  IntegrationStatus status_;          // accumulates the period since the last status
  std::int64_t status_reported_ = 0;  // local time of the last status
};

}  // namespace sprag
