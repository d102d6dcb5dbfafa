#include "lcmtypes/channel_log.h"

#include <algorithm>
#include <utility>

#include "lcmtypes/big_endian.h"

namespace sprag {

namespace {

constexpr std::uint32_t sync_word = 0xEDA1DA01;
constexpr std::string_view sync_bytes = "\xED\xA1\xDA\x01";
constexpr std::size_t head_size = 4 + 8 + 8 + 4 + 4;
constexpr std::int32_t longest_channel = 999;  // limits of liblcm
constexpr std::int32_t longest_message = 1 << 28;
constexpr std::size_t piece = 65536;

}  // namespace

struct ChannelLogReader::Head {
  std::int64_t number = 0, utime = 0;
  std::size_t channel_length = 0, data_length = 0;

  std::size_t record_size() const { return head_size + channel_length + data_length; }
};

ChannelLogReader::ChannelLogReader(const std::filesystem::path& file)
    : ChannelLogReader(InputFile(file)) {}

ChannelLogReader::ChannelLogReader(InputFile file) : file_(std::move(file)) {}

// Describes the fault of the record at `place` of the unread bytes; empty if it is complete.
std::string ChannelLogReader::examine(std::size_t place, Head& head) {
  const std::string_view bytes = from(place, head_size);
  if (bytes.size() >= sync_bytes.size() && !bytes.starts_with(sync_bytes))
    return "sync word missing";
  if (bytes.size() < head_size) return "truncated record";
  const auto* field = reinterpret_cast<const std::uint8_t*>(bytes.data()) + sync_bytes.size();
  head.number = take<std::int64_t>(field);
  head.utime = take<std::int64_t>(field);
  const auto channel_length = take<std::int32_t>(field);
  const auto data_length = take<std::int32_t>(field);
  if (channel_length < 1 || channel_length > longest_channel)
    return "channel length " + std::to_string(channel_length) + " is not in 1 to 999";
  if (data_length < 0 || data_length > longest_message)
    return "data length " + std::to_string(data_length) + " is not in 0 to 2^28";
  head.channel_length = static_cast<std::size_t>(channel_length);
  head.data_length = static_cast<std::size_t>(data_length);
  if (from(place, head.record_size()).size() < head.record_size()) return "truncated record";
  return {};
}

// The unread bytes from `place` on, at least `count` unless the file has fewer.
std::string_view ChannelLogReader::from(std::size_t place, std::size_t count) {
  const std::string_view bytes = file_.ahead(place + count);
  return bytes.substr(std::min(place, bytes.size()));
}

// Whether the bytes at `place` begin another record, complete or not, or the file ends there.
bool ChannelLogReader::is_followed(std::size_t place) {
  const std::string_view next = from(place, sync_bytes.size()).substr(0, sync_bytes.size());
  return next == sync_bytes.substr(0, next.size());
}

// Whether the next record is followed by the record with the next event number.
bool ChannelLogReader::leads_on(const Head& head) {
  const std::size_t size = head.record_size();
  const std::string_view next = from(size, head_size);
  if (next.size() < head_size) return is_followed(size);
  const auto* number = reinterpret_cast<const std::uint8_t*>(next.data()) + sync_bytes.size();
  const auto step = take<std::uint64_t>(number) - static_cast<std::uint64_t>(head.number);
  return is_followed(size) && step == 1;
}

// Whether a complete record begins at `place`, and not just a sync word by chance.
bool ChannelLogReader::is_record(std::size_t place) {
  Head head;
  return examine(place, head).empty() && is_followed(place + head.record_size());
}

// Position of a record within the next `size` bytes; `size` if there is none.
std::size_t ChannelLogReader::find_record(std::size_t size) {
  for (std::size_t place = 1; place < size; ++place) {
    place = from(0, size).substr(0, size).find(sync_bytes, place);
    if (place == std::string_view::npos) break;
    if (is_record(place)) return place;
  }
  return size;
}

// Skips the unread bytes up to the next record.
void ChannelLogReader::pass_over(std::string what) {
  const std::uint64_t begin = file_.offset();
  bool ended = false;
  file_.skip(1);
  while (!ended && !is_record(0)) {
    const std::string_view bytes = file_.ahead(piece);
    ended = bytes.size() < piece;
    const std::size_t next = bytes.find(sync_bytes, 1);
    if (next != std::string_view::npos) {
      ended = false;
      file_.skip(next);
    } else {  // keep the last bytes, in which a sync word may begin
      file_.skip(ended ? bytes.size() : bytes.size() - sync_bytes.size() + 1);
    }
  }
  if (file_.failed()) what = "cannot be read";
  damages_.push_back({begin, file_.offset(), ended, std::move(what)});
}

bool ChannelLogReader::next(ChannelRecord& record) {
  while (!file_.ahead(1).empty()) {
    Head head;
    std::string fault = examine(0, head);
    const std::size_t size = head.record_size();
    // A wrong length would skip complete records.
    if (fault.empty() && !leads_on(head) && find_record(size) < size) fault = "wrong length";
    if (!fault.empty()) {
      pass_over(std::move(fault));
      continue;
    }
    const std::string_view bytes = file_.ahead(size);
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data()) + head_size;
    record.number = head.number;
    record.appended = last_number_ && head.number <= *last_number_;
    last_number_ = head.number;
    record.utime = head.utime;
    record.channel = bytes.substr(head_size, head.channel_length);
    record.data.assign(data + head.channel_length, data + head.channel_length + head.data_length);
    file_.skip(size);
    return true;
  }
  if (file_.failed() && (damages_.empty() || !damages_.back().to_the_end))
    damages_.push_back({file_.offset(), file_.offset(), true, "cannot be read"});
  return false;
}

ChannelLogWriter::ChannelLogWriter(const std::filesystem::path& file) : file_(file) {}

bool ChannelLogWriter::write(std::int64_t utime, std::string_view channel,
                             std::span<const std::uint8_t> data) noexcept {
  record_.resize(head_size);
  auto* to = reinterpret_cast<std::uint8_t*>(record_.data());
  put(to, sync_word);
  put(to, number_++);
  put(to, utime);
  put(to, static_cast<std::int32_t>(channel.size()));
  put(to, static_cast<std::int32_t>(data.size()));
  record_.append(channel);
  record_.append(reinterpret_cast<const char*>(data.data()), data.size());
  file_.write(record_);
  return good();
}

}  // namespace sprag
