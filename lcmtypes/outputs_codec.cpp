#include "lcmtypes/outputs_codec.h"

#include <cmath>
#include <sprag/outputs_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

std::span<const std::uint8_t> encode_outputs(const EstimateSample& sample, bool settled,
                                             std::span<const Output> outputs,
                                             std::vector<std::uint8_t>& buffer) {
  std::size_t size = 5 * 8 + 2 + 4 + 16 * outputs.size();
  for (const Output& output : outputs) size += text_size(output.name);
  buffer.resize(size);
  std::uint8_t* to = buffer.data();
  put(to, outputs_t::getHash());
  put(to, sample.session);
  put(to, sample.utime);
  put(to, sample.tick);
  put(to, sample.t);
  put(to, static_cast<std::int8_t>(settled ? 1 : 0));
  put(to, static_cast<std::int8_t>(sample.confidence.from_filter ? 1 : 0));
  put(to, static_cast<std::int32_t>(outputs.size()));
  for (const Output& output : outputs) put_text(to, output.name);
  for (const Output& output : outputs) put(to, value(output, sample.q, sample.u));
  for (std::size_t i = 0; i < outputs.size(); ++i) put(to, sigma_of_output(sample.confidence, i));
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, OutputsSample& sample) {
  constexpr std::size_t head = 5 * 8 + 2;
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != outputs_t::getHash()) return Refusal::wrong_type;
  if (message.size() < head) return Refusal::truncated;
  sample.session = take<std::int64_t>(from);
  sample.utime = take<std::int64_t>(from);
  sample.tick = take<std::int64_t>(from);
  sample.t = take<double>(from);
  sample.settled = take<std::int8_t>(from) == 1;
  sample.from_filter = take<std::int8_t>(from) == 1;
  if (!std::isfinite(sample.t) || sample.t < 0.0 || sample.tick < 0) return Refusal::bad_time;
  std::span<const std::uint8_t> rest = message.subspan(head);
  const Refusal refusal = take_named_values(rest, sample.outputs);
  if (refusal != Refusal::none) return refusal;
  return rest.empty() ? Refusal::none : Refusal::oversized;
}

}  // namespace sprag
