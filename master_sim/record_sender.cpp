#include "master_sim/record_sender.h"

#include <algorithm>
#include <cmath>

namespace sprag {

RecordSender::RecordSender(Bus& bus, SampledInputPointer record, std::int64_t session)
    : record_(std::move(record)),
      sender_(bus, record_->sample_times().front(), record_->spacing(), session) {}

void RecordSender::send(double t, int ahead) {
  const std::vector<double>& values = record_->sample_values();
  const double since =
      (t - record_->settings().delay - record_->sample_times().front()) / record_->spacing();
  // At least the first sample; the rounding of t / dt does not matter.
  const auto until =
      std::max<std::int64_t>(static_cast<std::int64_t>(std::floor(since)) + 1, 1) + ahead;
  for (std::int64_t k = sender_.total(); k < until; ++k) {
    sender_.add(k, values[std::min(static_cast<std::size_t>(k), values.size() - 1)]);
  }
  sender_.send();
}

}  // namespace sprag
