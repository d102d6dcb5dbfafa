#include "sprag/detail/live/machine_adaptation.h"

#include <algorithm>

namespace sprag {
namespace {

// After refused identifications a window grows up to this number of events, then it moves on.
constexpr std::size_t longest_window = 160;

// The events of the search's first grid, and some more to judge the fit.
std::size_t first_size(const SceneValues& family) {
  const auto f = static_cast<std::size_t>(family.nominal().model.coordinates());
  return std::max(6 * f + 6, 2 * f + family.unknowns().size() + 8);
}

}  // namespace

MachineAdaptation::MachineAdaptation(TrackingEstimator& estimator)
    : estimator_(estimator), first_size_(first_size(*estimator.family())) {
  task_.events.reserve(most_events + 1);
}

void MachineAdaptation::start(double begins, ContactSet closed) {
  task_.events.clear();
  task_.begins = begins;
  task_.closed = closed;
  task_.number = 0;
  size_ = first_size_;
  changed_ = 0;
}

// Removes the first events of the window.
void MachineAdaptation::drop(std::size_t events) {
  const auto end = task_.events.begin() + static_cast<std::ptrdiff_t>(events);
  for (auto event = task_.events.begin(); event != end; ++event) {
    task_.begins = event->t;
    task_.closed = after(task_.closed, *event);
  }
  task_.events.erase(task_.events.begin(), end);
  size_ = first_size_;
}

bool MachineAdaptation::settle(std::span<const ContactEvent> events, const TrackingState& state) {
  for (const ContactEvent& event : events) {
    // The first event may be slightly earlier than the start.
    if (task_.number++ == 0) task_.begins = std::min(task_.begins, event.t);
    task_.events.push_back(event);
    if (task_.events.size() > most_events) drop(1);
  }
  if (state.changed != changed_) {
    changed_ = state.changed;
    const auto kept = static_cast<std::size_t>(task_.number - changed_);
    drop(task_.events.size() - std::min(task_.events.size(), kept));
  }
  return !state.belief && task_.events.size() >= size_;
}

void MachineAdaptation::finish(const AdaptationResult& result, TrackingState& state) {
  if (estimator_.adopt(result, state)) return;
  size_ += size_ / 2;
  if (size_ <= longest_window) return;
  drop(task_.events.size() - std::min(task_.events.size(), 2 * first_size_));
  size_ = 3 * first_size_;
}

void MachineAdaptation::identify(TrackingState& state) {
  finish(run(task_, *estimator_.family()), state);
}

}  // namespace sprag
