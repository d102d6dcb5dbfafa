#include "observer/identification_thread.h"

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {

IdentificationThread::IdentificationThread(const SceneValues& family, std::size_t most_events)
    : family_(family) {
  task_.events.reserve(most_events);
}

void IdentificationThread::run() {
  try {
    while (!stop_) {
      if (stage_.load(std::memory_order_acquire) == Stage::asked) {
        results_[next_] = sprag::run(task_, family_);
        stage_.store(Stage::done, std::memory_order_release);
      } else {
        asked_.wait_until(monotonic_now() + between_looks);
      }
    }
  } catch (const Interrupted&) {  // a signal ended the run
  }
}

void IdentificationThread::stop() {
  stop_ = true;
  asked_.signal();
}

bool IdentificationThread::ask(const AdaptationTask& task) {
  if (stage_.load(std::memory_order_acquire) != Stage::idle) return false;
  task_ = task;
  stage_.store(Stage::asked, std::memory_order_release);
  asked_.signal();
  return true;
}

const AdaptationResult* IdentificationThread::result() {
  if (stage_.load(std::memory_order_acquire) != Stage::done) return nullptr;
  const AdaptationResult* result = &results_[next_];
  next_ = 1 - next_;
  stage_.store(Stage::idle, std::memory_order_release);
  return result;
}

}  // namespace sprag
