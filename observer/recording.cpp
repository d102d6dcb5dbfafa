#include "observer/recording.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <span>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"

namespace sprag {
namespace {

// The log's clock advances a little with every record: not every log's does.
constexpr std::int64_t least_step = 1'000'000;  // ns
constexpr std::int64_t latest = std::numeric_limits<std::int64_t>::max() / 4000;

}  // namespace

bool is_lcm_log(const std::filesystem::path& file) {
  constexpr std::array<char, 4> sync{'\xED', '\xA1', '\xDA', '\x01'};
  std::array<char, 4> first{};
  std::ifstream(file, std::ios::binary).read(first.data(), first.size());
  return first == sync || file.extension() == ".lcmlog";
}

RecordedReports::RecordedReports(const std::filesystem::path& file, int contacts,
                                 const std::optional<Key>& key)
    : log_(file), contacts_(contacts), key_(&key) {}

bool RecordedReports::next(ContactReport& report, Arrival& arrival) {
  while (log_.next(record_)) {
    if (record_.channel != contacts_channel) continue;
    std::span<const std::uint8_t> message(record_.data);
    if (*key_) {
      if (!(*key_)->verifies(record_.channel, message)) {
        ++unauthenticated_;
        continue;
      }
      message = message.first(message.size() - Key::tag_size);
    }
    if (decode(message, report) != Refusal::none || report.contacts != contacts_) {
      ++refused_;
      continue;
    }
    const std::int64_t utime = std::clamp<std::int64_t>(record_.utime, 0, latest);
    now_ = std::max(1000 * utime, now_ + least_step);
    arrival = {now_, utime};
    return true;
  }
  return false;
}

}  // namespace sprag
