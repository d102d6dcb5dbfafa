#include "observer/publication.h"

#include <chrono>
#include <iostream>
#include <thread>

#include "lcmtypes/wall_clock.h"
#include "observer/messages.h"
#include "observer/wake.h"

namespace sprag {
namespace {

using namespace std::chrono_literals;

constexpr int last_sample_repeats = 5;
constexpr std::int64_t longest_idle = 100'000'000;       // ns
constexpr std::int64_t progress_period = 1'000'000'000;  // ns

}  // namespace

Publication::Publication(Bus& bus, const Inbox& inbox, Outbox& outbox, Notices& notices,
                         SettledOutput& settled, Reception& reception, double duration,
                         std::vector<Output> outputs)
    : bus_(bus),
      inbox_(inbox),
      outbox_(outbox),
      notices_(notices),
      settled_(settled),
      reception_(reception),
      duration_(duration),
      outputs_(std::move(outputs)) {}

void Publication::run(const std::function<bool()>& over) {
  std::int64_t next_progress = monotonic_now() + progress_period;
  while (!over()) {
    outbox_.ready.wait_until(monotonic_now() + longest_idle);
    empty_outbox();
    notices_.print(monotonic_now(), std::cerr);
    if (monotonic_now() < next_progress) continue;
    next_progress += progress_period;
    progress();
  }
}

void Publication::finish() {
  empty_outbox();
  publish_health(reception_.figures(), true);
  for (int i = 0; i < last_sample_repeats; ++i) {
    std::this_thread::sleep_for(10ms);
    if (!last_settled_.empty()) (void)bus_.publish(settled_channel, last_settled_);
    if (!last_outputs_.empty()) (void)bus_.publish(outputs_channel, last_outputs_);
    if (!parameters_.empty()) (void)bus_.publish(parameters_channel, parameters_);
    (void)bus_.publish(health_channel, health_);
  }
  notices_.print_rest(std::cerr);
}

void Publication::empty_outbox() {
  while (const Announcement* announcement = outbox_.announcements.front()) {
    print(*announcement);
    outbox_.announcements.pop();
  }
  while (Sample* sample = outbox_.samples.front()) {
    publish(sample->estimate, sample->settled);
    outbox_.samples.pop();
  }
  while (const IntegrationStatus* status = outbox_.statuses.front()) {
    status_ = *status;
    outbox_.statuses.pop();
    if (status_.last) continue;  // finish() publishes it
    publish_health(reception_.reported(), false);
    status_.begin_period();
  }
}

void Publication::publish_health(const ReceptionFigures& reception, bool last) {
  health_t health = health_of(status_, reception);
  health.utime = wall_clock_us();
  health.last = last ? 1 : 0;
  health.estimate = static_cast<std::int8_t>(source_);
  health.ticks = settled_.ticks();
  health.inconsistencies = settled_.inconsistencies();
  health.unsent = unsent_;
  (void)bus_.publish(health_channel, encode(health, health_));
}

void Publication::publish(EstimateSample& estimate, bool settled) {
  estimate.utime = wall_clock_us();
  if (settled) settled_.take(estimate);
  if (!settled) source_ = source_of(estimate.confidence);
  fill(estimate_, estimate);
  send(settled ? settled_channel : estimate_channel, estimate_, settled ? last_settled_ : buffer_);
  if (!outputs_.empty()) {
    fill(outputs_message_, estimate, settled, outputs_);
    send(outputs_channel, outputs_message_, settled ? last_outputs_ : buffer_);
  }
  if (settled && estimate.confidence.bound_q.size() > 0) {
    fill(bounds_, estimate, outputs_);
    send(bounds_channel, bounds_, buffer_);
  }
  if (settled && estimate.confidence.parameters.any()) publish_parameters(estimate);
}

template <class Message>
void Publication::send(const char* channel, const Message& message,
                       std::vector<std::uint8_t>& buffer) {
  if (!bus_.publish(channel, encode(message, buffer))) ++unsent_;
}

// Publishes the parameters if they have changed.
void Publication::publish_parameters(const EstimateSample& estimate) {
  const Confidence& confidence = estimate.confidence;
  const bool same = !parameters_.empty() && confidence.parameters.known == known_ &&
                    confidence.parameters.accepted == accepted_ &&
                    confidence.from_filter == from_filter_;
  if (same) return;
  known_ = confidence.parameters.known;
  accepted_ = confidence.parameters.accepted;
  from_filter_ = confidence.from_filter;
  parameters_t message{};
  fill(message, estimate);
  send(parameters_channel, message, parameters_);
}

void Publication::print(const Announcement& announcement) {
  const auto digits = std::cerr.precision(12);
  switch (announcement.kind) {
    case Announcement::Kind::input_silence:
      std::cerr << "no sample of the excitation for 1 s, at t = " << announcement.t
                << ": the estimate holds the last value, its standard deviations grow, and nothing "
                   "settles\n";
      break;
    case Announcement::Kind::input_regained:
      std::cerr << "samples of the excitation arrive again, at t = " << announcement.t << '\n';
      break;
    case Announcement::Kind::session:
      if (observing_ && announcement.session != reported_session_) {
        std::cerr << "new session: the master was restarted; ";
      }
      std::cerr << "observing from t = " << announcement.t << '\n';
      observing_ = true;
      reported_session_ = announcement.session;
      if (announcement.t > duration_) {
        std::cerr << "that is after --duration: nothing will settle\n";
      }
      break;
    case Announcement::Kind::other_master:
      std::cerr << "a second master (session " << announcement.session
                << ") is on the channel; the first is kept\n";
      break;
    case Announcement::Kind::silence:
      std::cerr << "the master is silent at t = " << announcement.t
                << "; the estimate goes on without it\n";
      break;
    case Announcement::Kind::end_of_run:
      std::cerr << "the machine's time stands at t = " << announcement.t
                << ": its run is over; the estimate goes on without it\n";
      break;
    case Announcement::Kind::real_time_lost:
      std::cerr << "real time lost at t = " << announcement.t << '\n';
      break;
    case Announcement::Kind::real_time_regained:
      std::cerr << "real time regained at t = " << announcement.t << '\n';
      break;
  }
  std::cerr.precision(digits);
}

void Publication::progress() {
  settled_.flush();
  if (observing_) {
    const auto digits = std::cerr.precision(12);
    std::cerr << "settled t " << settled_.t() << '\n';
    std::cerr.precision(digits);
  } else if (monotonic_now() - inbox_.last_arrival >= progress_period) {
    std::cerr << "waiting for a master\n";
  }
}

}  // namespace sprag
