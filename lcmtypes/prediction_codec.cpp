#include "lcmtypes/prediction_codec.h"

#include <sprag/prediction_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

std::span<const std::uint8_t> encode_prediction(const Prediction& prediction, std::int64_t session,
                                                std::int64_t utime,
                                                std::vector<std::uint8_t>& buffer) {
  const std::vector<PredictedEvent>& events = prediction.events;
  buffer.resize(5 * 8 + 4 + (8 + 4 + 1 + 8) * events.size());
  std::uint8_t* to = buffer.data();
  put(to, prediction_t::getHash());
  put(to, session);
  put(to, utime);
  put(to, prediction.made_at);
  put(to, prediction.certain_until);
  put(to, static_cast<std::int32_t>(events.size()));
  for (const PredictedEvent& event : events) put(to, event.t);
  for (const PredictedEvent& event : events) put(to, static_cast<std::int32_t>(event.contact + 1));
  for (const PredictedEvent& event : events) put(to, static_cast<std::int8_t>(event.kind));
  for (const PredictedEvent& event : events) put(to, event.sigma);
  return buffer;
}

}  // namespace sprag
