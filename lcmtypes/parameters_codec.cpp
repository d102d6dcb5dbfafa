#include "lcmtypes/parameters_codec.h"

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

}  // namespace sprag
