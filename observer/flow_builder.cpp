#include "observer/flow_builder.h"

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr double most_memory = 16 << 20;          // of flows built ahead
constexpr std::int64_t look_waiting = 1'000'000;  // ns

// Approximate memory of a flow [bytes]: its signals and its matrices.
double size_of(const Dynamics& dynamics) {
  const auto f = static_cast<double>(dynamics.coordinates());
  const auto m = static_cast<double>(dynamics.contacts());
  const auto nf = static_cast<double>(dynamics.frequencies().size());
  return 8.0 * (2.0 * m * (2.0 * (f + nf) + m) + 6.0 * f * f);
}

}  // namespace

FlowBuilder::FlowBuilder(Flows& flows) : flows_(flows) {
  flows.on_missing([this](ContactSet locked) { await(locked); });
}

// Called by the thread that needs a flow; returns when it has been built.
void FlowBuilder::await(ContactSet locked) {
  ++awaited_;
  wanted_ = locked;
  waiting_ = true;
  asked_.signal();
  while (waiting_) {
    if (stop_) throw Interrupted();
    built_.wait_until(monotonic_now() + look_waiting);
  }
}

void FlowBuilder::run() {
  while (!stop_) {
    if (waiting_) {
      last_ = wanted_;
      next_ = 0;
      flows_.build(last_);
      waiting_ = false;
      built_.signal();
    } else if (next_ < flows_.dynamics().contacts() && memory_ < most_memory) {
      build_ahead();
    } else {
      asked_.wait_until(monotonic_now() + between_looks);
    }
  }
}

// Builds the set that differs from the last requested one by the next contact.
void FlowBuilder::build_ahead() {
  const ContactSet neighbour = last_ ^ bit(next_++);
  if (flows_.built(neighbour)) return;
  flows_.build(neighbour);
  memory_ += size_of(flows_.dynamics());
}

void FlowBuilder::stop() {
  stop_ = true;
  asked_.signal();
  built_.signal();
}

}  // namespace sprag
