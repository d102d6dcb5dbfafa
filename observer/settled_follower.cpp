#include "observer/settled_follower.h"

#include <algorithm>

#include "lcmtypes/wall_clock.h"
#include "observer/messages.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr std::int64_t longest_wait_for_settled = 100'000'000;  // ns

}  // namespace

SettledFollower::SettledFollower(const Scene& scene, const ObserverOptions& options, Bus& bus)
    : start_(scene.prior.start),
      last_(options.last()),
      estimator_(scene, options.tick, options.estimator),
      writer_(writer_of<ImpactsWriter>(options.impacts)),
      ahead_(options.predict),
      predictions_(writer_of<PredictionsWriter>(options.predictions)),
      bus_(bus) {
  if (writer_) estimator_.record_in(impacts_);
  if (ahead_ > 0.0) predictor_.emplace(scene.model);
}

bool SettledFollower::put(const Settled& item) {
  Settled* slot = queue_.free_slot();
  if (slot == nullptr) return false;
  *slot = item;
  queue_.push();
  if (item.kind == Settled::Kind::tick) ready_.signal();
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
  // The last tick may have been lost because the queue was full.
  if (!events_.empty()) advance(first_tick_after(events_.back().t, estimator_.h()));
  write_impacts();
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
  write_impacts();
  if (writer_) writer_->flush();
  if (predictions_) predictions_->flush();
}

void SettledFollower::take(const Settled& item) {
  switch (item.kind) {
    case Settled::Kind::start:
      write_impacts();
      events_.clear();
      session_ = item.session;
      estimator_.start(start_, item.tick, item.chi, state_);
      started_ = false;
      prediction_due_ = false;
      break;
    case Settled::Kind::event:
      events_.push_back(item.event);
      break;
    case Settled::Kind::tick:
      advance(item.tick);
      break;
  }
}

// Advances to this tick, with the events up to it.
void SettledFollower::advance(std::int64_t tick) {
  std::size_t used = 0;
  const auto due = [&](std::int64_t k) {
    const std::size_t first = used;
    while (used < events_.size() && first_tick_after(events_[used].t, estimator_.h()) <= k) ++used;
    return std::span<const ContactEvent>(events_).subspan(first, used - first);
  };
  if (!started_) {
    started_ = true;
    for_each_instant(due(state_.tick), [&](std::span<const ContactEvent> of_one) {
      estimator_.apply(of_one, state_);
    });
  }
  for (std::int64_t k = state_.tick + 1; k <= std::min(tick, last_); ++k) {
    identify_now(estimator_, state_, identified_);
    estimator_.tick(due(k), state_);
  }
  if (used > 0) prediction_due_ = true;
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(used));
}

// Predicts from the last settled state only: a follower that is late must not predict past events.
void SettledFollower::predict() {
  if (!predictor_ || !prediction_due_) return;
  prediction_due_ = false;
  const Prediction prediction = estimator_.predict(state_, *predictor_, ahead_);
  if (predictions_) predictions_->write(prediction);
  prediction_t message{};
  fill(message, prediction, session_, wall_clock_us());
  (void)bus_.publish(prediction_channel, encode(message, buffer_));
}

void SettledFollower::write_impacts() {
  for (const ImpactRecord& record : impacts_) {
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
