#include "lcmtypes/impact_codec.h"

#include <sprag/impact_t.hpp>

#include "lcmtypes/big_endian.h"

namespace sprag {

std::span<const std::uint8_t> encode_impact(const ImpactRecord& record, std::int64_t session,
                                            std::int64_t utime, std::vector<std::uint8_t>& buffer) {
  buffer.resize(8 + 3 * 8 + 4 + 3 + 8 * 16);
  std::uint8_t* to = buffer.data();
  put(to, impact_t::getHash());
  put(to, session);
  put(to, utime);
  put(to, record.t);
  put(to, static_cast<std::int32_t>(record.contact + 1));
  put(to, static_cast<std::int8_t>(record.kind));
  put(to, static_cast<std::int8_t>(record.from_filter ? 1 : 0));
  put(to, static_cast<std::int8_t>(record.sustained ? 1 : 0));
  for (const Uncertain& x :
       {record.time, record.before, record.after, record.impulse, record.force_begin,
        record.force_end, record.force_largest, record.force_impulse}) {
    put(to, x.value);
    put(to, x.sigma);
  }
  return buffer;
}

}  // namespace sprag
