#include "observer/settled_follower.h"

#include <algorithm>

#include "lcmtypes/wall_clock.h"
#include "observer/messages.h"
#include "sprag/detail/live/drive.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr std::int64_t longest_wait_for_settled = 100'000'000;  // ns

}  // namespace

SettledFollower::SettledFollower(const Scene& scene, const ObserverOptions& options, Bus& bus)
    : last_(options.last()),
      estimator_(scene, options.tick, options.estimator),
      time_line_(estimator_, static_cast<int>(scene.model.contacts.size()), scene.prior.start, 1),
      writer_(writer_of<ImpactsWriter>(options.impacts)),
      ahead_(options.predict),
      predictions_(writer_of<PredictionsWriter>(options.predictions)),
      bus_(bus) {
  estimator_.record_in(impacts_);
  if (ahead_ > 0.0) predictor_.emplace(scene.model);
}

bool SettledFollower::put(const Settled& item) {
  Settled* slot = queue_.free_slot();
  if (slot == nullptr) return false;
  *slot = item;
  queue_.push();
  if (item.kind == Settled::Kind::horizon) ready_.signal();
  return true;
}

void SettledFollower::run() {
  while (!stop_) {
    ready_.wait_until(monotonic_now() + longest_wait_for_settled);
    take_all();
  }
}

void SettledFollower::stop() {
  stop_ = true;
  ready_.signal();
}

void SettledFollower::finish() {
  take_all();
  // The last horizon may have been lost because the queue was full.
  if (time_line_.started()) {
    settle(tick_instant(time_line_.tick_of_last_event(), estimator_.h()).hi);
  }
}

void SettledFollower::take_all() {
  try {
    while (const Settled* item = queue_.front()) {
      take(*item);
      queue_.pop();
    }
    predict();
  } catch (const Interrupted&) {  // a signal during an identification or a prediction
    stop_ = true;
  }
  if (writer_) writer_->flush();
  if (predictions_) predictions_->flush();
}

void SettledFollower::take(const Settled& item) {
  switch (item.kind) {
    case Settled::Kind::start:
      session_ = item.session;
      time_line_.restart(item.tick, 0, item.chi, no_horizon);
      prediction_due_ = false;
      break;
    case Settled::Kind::event:
      time_line_.receive(item.event);
      break;
    case Settled::Kind::horizon:
      settle(item.horizon);
      break;
  }
}

void SettledFollower::settle(double horizon) {
  time_line_.set_horizon(std::min(horizon, tick_instant(last_, estimator_.h()).hi));
  sprag::settle(time_line_, last_, [this](const TrackingState&) {
    if (!impacts_.empty()) prediction_due_ = true;
    write_impacts();
    return true;
  });
}

// Predicts from the last settled state only: a follower that is late must not predict past events.
void SettledFollower::predict() {
  if (!predictor_ || !prediction_due_) return;
  prediction_due_ = false;
  const Prediction prediction = estimator_.predict(time_line_.present(), *predictor_, ahead_);
  if (predictions_) predictions_->write(prediction);
  prediction_t message{};
  fill(message, prediction, session_, wall_clock_us());
  (void)bus_.publish(prediction_channel, encode(message, buffer_));
}

void SettledFollower::write_impacts() {
  for (const ImpactRecord& record : impacts_) {
    if (!writer_) break;
    writer_->write(record);
    impact_t message{};
    fill(message, record, session_, wall_clock_us());
    (void)bus_.publish(impacts_channel, encode(message, buffer_));
  }
  impacts_.clear();
}

void SettledFollower::close() {
  if (writer_) writer_->finish();
  if (predictions_) predictions_->finish();
}

}  // namespace sprag
