#include "lcmtypes/channel_log.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include "lcmtypes/big_endian.h"
#include "mechanics/csv.h"

namespace sprag {

namespace {

constexpr std::uint32_t sync_word = 0xEDA1DA01;
constexpr std::size_t head_size = 4 + 8 + 8 + 4 + 4;
constexpr std::int32_t longest_channel = 999;  // liblcm's own limits
constexpr std::int32_t longest_message = 1 << 28;
constexpr std::size_t piece = 65536;  // a garbage length must not make us allocate it

}  // namespace

ChannelLogReader::ChannelLogReader(const std::filesystem::path& file)
    : stream_(file, std::ios::binary) {
  if (!stream_) throw InputError(file.string() + ": " + std::generic_category().message(errno));
  if (std::filesystem::is_directory(file)) throw InputError(file.string() + ": is a directory");
}

template <class Bytes>
bool ChannelLogReader::read(Bytes& bytes, std::size_t count) {
  bytes.clear();
  while (bytes.size() < count) {
    const std::size_t begin = bytes.size();
    bytes.resize(std::min(count, begin + piece));
    stream_.read(reinterpret_cast<char*>(bytes.data()) + begin,
                 static_cast<std::streamsize>(bytes.size() - begin));
    bytes.resize(begin + static_cast<std::size_t>(stream_.gcount()));
    if (!stream_) return bytes.size() == count;
  }
  return true;
}

bool ChannelLogReader::stop(std::string what) {
  damage_ = LogDamage{offset_, stream_.bad() ? "cannot be read" : std::move(what)};
  return false;
}

bool ChannelLogReader::next(ChannelRecord& record) {
  if (damage_) return false;
  const bool whole = read(head_, head_size);
  if (head_.empty() && !stream_.bad()) return false;
  const std::uint8_t* from = head_.data();
  if (head_.size() >= sizeof sync_word && take<std::uint32_t>(from) != sync_word)
    return stop("sync word missing");
  if (!whole) return stop("truncated record");
  record.number = take<std::int64_t>(from);
  record.utime = take<std::int64_t>(from);
  const auto channel_length = take<std::int32_t>(from);
  const auto data_length = take<std::int32_t>(from);
  if (channel_length < 1 || channel_length > longest_channel)
    return stop("channel length " + std::to_string(channel_length) + " is not in 1 to 999");
  if (data_length < 0 || data_length > longest_message)
    return stop("data length " + std::to_string(data_length) + " is not in 0 to 2^28");
  if (!read(record.channel, static_cast<std::size_t>(channel_length)) ||
      !read(record.data, static_cast<std::size_t>(data_length)))
    return stop("truncated record");
  offset_ += head_size + record.channel.size() + record.data.size();
  return true;
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
