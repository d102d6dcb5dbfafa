#include "lcmtypes/parameters_codec.h"

#include <cmath>
#include <sprag/parameters_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

std::span<const std::uint8_t> encode_parameters(const EstimateSample& sample,
                                                std::vector<std::uint8_t>& buffer) {
  const ParameterEstimates& parameters = sample.confidence.parameters;
  const std::vector<std::string>& keys = *parameters.keys;
  std::size_t size = 5 * 8 + 4 + 16 * keys.size() + 3 * 8 + 1;
  for (const std::string& key : keys) size += text_size(key);
  buffer.resize(size);
  std::uint8_t* to = buffer.data();
  put(to, parameters_t::getHash());
  put(to, sample.session);
  put(to, sample.utime);
  put(to, sample.tick);
  put(to, sample.t);
  put(to, static_cast<std::int32_t>(keys.size()));
  for (const std::string& key : keys) put_text(to, key);
  for (const double value : parameters.values) put(to, value);
  for (const double sigma : parameters.sigmas) put(to, sigma);
  put(to, parameters.accepted);
  put(to, parameters.known);
  put(to, parameters.identifications);
  put(to, static_cast<std::int8_t>(sample.confidence.from_filter ? 1 : 0));
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, ParametersSample& sample) {
  constexpr std::size_t head = 5 * 8, tail = 3 * 8 + 1;
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != parameters_t::getHash()) return Refusal::wrong_type;
  if (message.size() < head) return Refusal::truncated;
  sample.session = take<std::int64_t>(from);
  sample.utime = take<std::int64_t>(from);
  sample.tick = take<std::int64_t>(from);
  sample.t = take<double>(from);
  if (!std::isfinite(sample.t) || sample.t < 0.0 || sample.tick < 0) return Refusal::bad_time;
  std::span<const std::uint8_t> rest = message.subspan(head);
  const Refusal refusal = take_named_values(rest, sample.parameters);
  if (refusal != Refusal::none) return refusal;
  if (rest.size() != tail) return rest.size() < tail ? Refusal::truncated : Refusal::oversized;
  from = rest.data();
  sample.accepted = take<double>(from);
  sample.known = take<double>(from);
  sample.identifications = take<std::int64_t>(from);
  sample.from_filter = take<std::int8_t>(from) == 1;
  const bool possible =
      std::isfinite(sample.accepted) && std::isfinite(sample.known) && sample.identifications >= 0;
  return possible ? Refusal::none : Refusal::bad_value;
}

}  // namespace sprag
