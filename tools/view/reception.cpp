#include "tools/view/reception.h"

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"

namespace sprag::view {
namespace {

constexpr std::array<const char*, 9> channels{contacts_channel,   estimate_channel, settled_channel,
                                              truth_channel,      outputs_channel,  bounds_channel,
                                              parameters_channel, health_channel,   input_channel};

}  // namespace

std::span<const char* const> watched_channels() { return channels; }

template <class Message, class Take>
void Reception::decoded(std::span<const std::uint8_t> data, Message& message, Take take) {
  ++messages_;
  const Refusal refusal = decode(data, message);
  ++refused_[static_cast<std::size_t>(refusal)];
  if (refusal != Refusal::none) return;
  const std::lock_guard lock(stage_.mutex);
  take(stage_.watch);
}

void Reception::take(std::string_view channel, std::span<const std::uint8_t> data,
                     const Arrival& arrival) {
  if (channel == contacts_channel) {
    decoded(data, contacts_, [&](Watch& watch) {
      to_machine_time(clock_, contacts_);
      watch.take(contacts_, arrival);
    });
  } else if (channel == estimate_channel) {
    decoded(data, estimate_, [&](Watch& watch) { watch.take_estimate(estimate_, arrival); });
  } else if (channel == settled_channel) {
    decoded(data, estimate_, [&](Watch& watch) { watch.take_settled(estimate_, arrival); });
  } else if (channel == truth_channel) {
    decoded(data, state_, [&](Watch& watch) { watch.take(state_, arrival); });
  } else if (channel == outputs_channel) {
    decoded(data, outputs_, [&](Watch& watch) { watch.take(outputs_, arrival); });
  } else if (channel == bounds_channel) {
    decoded(data, bounds_, [&](Watch& watch) { watch.take(bounds_, arrival); });
  } else if (channel == parameters_channel) {
    decoded(data, parameters_, [&](Watch& watch) { watch.take(parameters_, arrival); });
  } else if (channel == input_channel) {
    decoded(data, input_, [&](Watch& watch) { watch.take(input_, arrival); });
  } else if (channel == health_channel) {
    decoded(data, health_, [&](Watch& watch) { watch.take(health_, arrival); });
  }
}

}  // namespace sprag::view
