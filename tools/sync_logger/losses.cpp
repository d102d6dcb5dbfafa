#include "tools/sync_logger/losses.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace sprag {
namespace {

// Limits of memory, since any sender may send any numbers.
constexpr std::size_t most_streams = 256;
constexpr std::size_t most_gaps = 10000;
constexpr std::int64_t any_gap = std::numeric_limits<std::int64_t>::max();
// If a machine's clock jumps further ahead, an observer omits the ticks between.
constexpr std::int64_t longest_gap_of_ticks = 100000;

std::int64_t sum(std::int64_t a, std::int64_t b) {
  constexpr std::int64_t most = std::numeric_limits<std::int64_t>::max();
  return a > most - b ? most : a + b;
}

}  // namespace

void MissingNumbers::take(std::int64_t number, std::int64_t longest_gap) {
  if (!last_ || number > *last_) {
    const std::int64_t gap = last_ ? number - *last_ - 1 : 0;
    if (gap > 0 && gap <= longest_gap) {
      missing_.emplace_hint(missing_.end(), *last_ + 1, number - 1);
      count_ = sum(count_, gap);
      if (missing_.size() > most_gaps) missing_.erase(missing_.begin());
    }
    last_ = number;
    return;
  }
  auto gap = missing_.upper_bound(number);
  if (gap == missing_.begin()) return;
  --gap;
  const auto [first, last] = *gap;
  if (number > last) return;  // repeated
  missing_.erase(gap);
  if (first < number) missing_.emplace(first, number - 1);
  if (number < last) missing_.emplace(number + 1, last);
  --count_;
}

void Losses::take(Channel channel, std::uint64_t sender, std::int64_t session,
                  std::int64_t number) {
  const std::int64_t longest_gap = channel == Channel::settled ? longest_gap_of_ticks : any_gap;
  const auto found = std::find_if(streams_.begin(), streams_.end(), [&](const Stream& stream) {
    return stream.channel == channel && stream.sender == sender && stream.session == session;
  });
  if (found != streams_.end()) {
    found->numbers.take(number, longest_gap);
    std::rotate(streams_.begin(), found, std::next(found));
    return;
  }
  if (streams_.size() == most_streams) {
    std::int64_t& past = of_past_streams_[static_cast<std::size_t>(streams_.back().channel)];
    past = sum(past, streams_.back().numbers.count());
    streams_.pop_back();
  }
  Stream stream{channel, sender, session, {}};
  stream.numbers.take(number, longest_gap);
  streams_.insert(streams_.begin(), std::move(stream));
}

std::int64_t Losses::missing(Channel channel) const {
  std::int64_t count = of_past_streams_[static_cast<std::size_t>(channel)];
  for (const Stream& stream : streams_) {
    if (stream.channel == channel) count = sum(count, stream.numbers.count());
  }
  return count;
}

std::string describe(const Losses& losses, std::int64_t dropped) {
  std::string text;
  const auto add = [&text](std::int64_t count, const char* one, const char* of) {
    if (count == 0) return;
    text += (text.empty() ? "" : ", ") + std::to_string(count) + ' ' + one +
            (count == 1 ? "" : "s") + ' ' + of;
  };
  using Channel = Losses::Channel;
  add(dropped, "packet", "at a full receive buffer");
  add(losses.missing(Channel::contacts), "message", "of SPRAG_CONTACTS");
  add(losses.missing(Channel::settled), "tick", "of SPRAG_SETTLED");
  add(losses.missing(Channel::truth), "tick", "of SPRAG_TRUTH");
  return text;
}

}  // namespace sprag
