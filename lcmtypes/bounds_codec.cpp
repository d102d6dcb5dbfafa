#include "lcmtypes/bounds_codec.h"

#include <cmath>
#include <sprag/bounds_t.hpp>

#include "lcmtypes/big_endian.h"
#include "lcmtypes/named_values.h"

namespace sprag {
namespace {

constexpr std::size_t bounds_head = 7 * 8;

std::string numbered(char letter, Eigen::Index i) {
  std::string name(1, letter);
  name += std::to_string(i + 1);
  return name;
}

// Visits names and half-widths in the order of the message.
template <typename Visit>
void visit_widths(const Confidence& confidence, std::span<const Output> outputs, Visit&& visit) {
  for (Eigen::Index i = 0; i < confidence.bound_q.size(); ++i) {
    visit(numbered('q', i), confidence.bound_q[i]);
  }
  for (Eigen::Index i = 0; i < confidence.bound_g.size(); ++i) {
    visit(numbered('g', i), confidence.bound_g[i]);
  }
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    visit(outputs[i].name, bound_of_output(confidence, i));
  }
}

}  // namespace

std::span<const std::uint8_t> encode_bounds(const EstimateSample& sample,
                                            std::span<const Output> outputs,
                                            std::vector<std::uint8_t>& buffer) {
  std::size_t size = bounds_head + 4;
  std::int32_t n = 0;
  visit_widths(sample.confidence, outputs, [&](const std::string& name, double) {
    size += text_size(name) + 8;
    ++n;
  });
  buffer.resize(size);
  std::uint8_t* to = buffer.data();
  put(to, bounds_t::getHash());
  put(to, sample.session);
  put(to, sample.utime);
  put(to, sample.tick);
  put(to, sample.t);
  put(to, sample.confidence.bound);
  put(to, sample.confidence.refutations);
  put(to, n);
  visit_widths(sample.confidence, outputs,
               [&](const std::string& name, double) { put_text(to, name); });
  visit_widths(sample.confidence, outputs,
               [&](const std::string&, double half_width) { put(to, half_width); });
  return buffer;
}

Refusal decode(std::span<const std::uint8_t> message, BoundsSample& sample) {
  const std::uint8_t* from = message.data();
  if (message.size() < sizeof(std::int64_t)) return Refusal::truncated;
  if (take<std::int64_t>(from) != bounds_t::getHash()) return Refusal::wrong_type;
  if (message.size() < bounds_head) return Refusal::truncated;
  sample.session = take<std::int64_t>(from);
  sample.utime = take<std::int64_t>(from);
  sample.tick = take<std::int64_t>(from);
  sample.t = take<double>(from);
  sample.bound = take<double>(from);
  sample.refutations = take<std::int64_t>(from);
  if (!std::isfinite(sample.t) || sample.t < 0.0 || sample.tick < 0) return Refusal::bad_time;
  if (!(sample.bound >= 0.0) || sample.refutations < 0) return Refusal::bad_value;
  std::span<const std::uint8_t> rest = message.subspan(bounds_head);
  const Refusal refusal = take_names(rest, sample.names);
  if (refusal != Refusal::none) return refusal;
  const std::size_t n = sample.names.size();
  if (rest.size() < 8 * n) return Refusal::truncated;
  if (rest.size() > 8 * n) return Refusal::oversized;
  from = rest.data();
  sample.half_widths.resize(n);
  for (double& half_width : sample.half_widths) {
    half_width = take<double>(from);
    if (!(half_width >= 0.0)) return Refusal::bad_value;
  }
  return Refusal::none;
}

}  // namespace sprag
