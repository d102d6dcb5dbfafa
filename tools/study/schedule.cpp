#include "tools/study/schedule.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <system_error>
#include <thread>
#include <utility>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag::study {
namespace {

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

std::string duration_text(double seconds) {
  char text[40];
  const double minutes = std::floor(seconds / 60.0);
  const double hours = std::floor(minutes / 60.0);
  if (hours >= 48.0) {
    std::snprintf(text, sizeof text, "%.1f days", hours / 24.0);
  } else if (hours >= 1.0) {
    std::snprintf(text, sizeof text, "%.0f h %.0f min", hours, minutes - 60.0 * hours);
  } else if (minutes >= 1.0) {
    std::snprintf(text, sizeof text, "%.0f min %.0f s", minutes, seconds - 60.0 * minutes);
  } else {
    std::snprintf(text, sizeof text, "%.0f s", std::ceil(seconds));
  }
  return text;
}

}  // namespace

std::vector<Range> missing_ranges(Range all, std::vector<Range> done) {
  std::sort(done.begin(), done.end(),
            [](const Range& a, const Range& b) { return a.first < b.first; });
  std::vector<Range> missing;
  for (const Range& range : done) {
    if (range.first > all.first) missing.push_back({all.first, range.first});
    all.first = std::max(all.first, range.end);
  }
  if (all.first < all.end) missing.push_back(all);
  return missing;
}

Chunk compute_chunk(const Compute& compute, Range range) {
  const auto begin = std::chrono::steady_clock::now();
  Chunk chunk{{range.first, range.first}, {}, 0, 0.0};
  try {
    while (chunk.range.end < range.end && !interrupted()) {
      const Computed computed = compute({chunk.range.end, range.end}, chunk.text);
      chunk.range.end += computed.runs;
      chunk.failures += computed.failures;
    }
  } catch (const Interrupted&) {  // the chunk ends with the last completed run
  }
  chunk.seconds = seconds_since(begin);
  return chunk;
}

Coordinator::Coordinator(std::vector<Range> missing, const Options& options,
                         std::function<void(const Chunk&)> write)
    : missing_(std::move(missing)),
      options_(options),
      write_(std::move(write)),
      begin_(std::chrono::steady_clock::now()) {
  std::reverse(missing_.begin(), missing_.end());
  for (const Range& range : missing_) left_ += range.size();
  progress_.total = options.total;
  progress_.before = options.total - left_;
}

std::optional<Range> Coordinator::take() {
  const std::lock_guard lock(mutex_);
  if (reason_ || interrupted() || missing_.empty()) return std::nullopt;
  std::int64_t size = options_.chunk;
  if (size == 0) {
    // The first chunks are single runs, since their cost is unknown. At the end chunks shrink, so
    // that all workers end at about the same time.
    const double of_time = seconds_per_run_ > 0.0 ? usual_chunk_seconds / seconds_per_run_ : 1.0;
    const std::int64_t share = left_ / (std::int64_t{4} * options_.workers);
    size = std::min({static_cast<std::int64_t>(std::min(of_time, 1e9)), share, options_.longest});
  }
  Range& next = missing_.back();
  const Range range{next.first, next.first + std::clamp<std::int64_t>(size, 1, next.size())};
  next.first = range.end;
  if (next.size() == 0) missing_.pop_back();
  left_ -= range.size();
  ++out_;
  return range;
}

void Coordinator::put(const Chunk& chunk) {
  {
    const std::lock_guard lock(mutex_);
    --out_;
    if (chunk.range.size() > 0 && !reason_) {
      try {
        write_(chunk);
        progress_.done += chunk.range.size();
        progress_.failures += chunk.failures;
        progress_.busy += chunk.seconds;
        const double cost = chunk.seconds / static_cast<double>(chunk.range.size());
        seconds_per_run_ = seconds_per_run_ > 0.0 ? 0.5 * (seconds_per_run_ + cost) : cost;
      } catch (...) {
        reason_ = std::current_exception();
      }
    }
  }
  changed_.notify_all();
}

void Coordinator::stop(std::exception_ptr reason) noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (!reason_) reason_ = std::move(reason);
  }
  changed_.notify_all();
}

bool Coordinator::stopped() const {
  const std::lock_guard lock(mutex_);
  return reason_ != nullptr || interrupted();
}

bool Coordinator::finished() const {
  const std::lock_guard lock(mutex_);
  return out_ == 0 && (missing_.empty() || reason_ || interrupted());
}

Progress Coordinator::progress() const {
  const std::lock_guard lock(mutex_);
  Progress progress = progress_;
  progress.seconds = seconds_since(begin_);
  return progress;
}

void Coordinator::finish() const {
  const std::lock_guard lock(mutex_);
  if (reason_) std::rethrow_exception(reason_);
  if (progress_.before + progress_.done < progress_.total) throw Interrupted();
}

void Coordinator::wait(std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, longest);
}

void work(Coordinator& coordinator, const Compute& compute) {
  while (const std::optional<Range> range = coordinator.take()) {
    Chunk chunk;
    try {
      chunk = compute_chunk(compute, *range);
    } catch (...) {
      coordinator.stop(std::current_exception());
    }
    coordinator.put(chunk);
  }
}

std::string describe(const Progress& progress) {
  char text[80];
  const double rate =
      progress.seconds > 0.0 ? static_cast<double>(progress.done) / progress.seconds : 0.0;
  const std::int64_t done = progress.before + progress.done;
  std::string line = std::to_string(done) + " of " + std::to_string(progress.total) + " runs";
  std::snprintf(text, sizeof text, ", %.3g per second", rate);
  line += text;
  if (rate > 0.0 && done < progress.total) {
    line += ", " + duration_text(static_cast<double>(progress.total - done) / rate) + " left";
  }
  return line + ", " + std::to_string(progress.failures) + " failed";
}

void run_threads(Coordinator& coordinator, int threads,
                 const std::function<Compute()>& make_compute,
                 const std::function<void()>& on_wait) {
  std::vector<std::thread> workers;
  workers.reserve(static_cast<std::size_t>(threads));
  const auto serve = with_stop_token([&] {
    try {
      work(coordinator, make_compute());
    } catch (...) {
      coordinator.stop(std::current_exception());
    }
  });
  try {
    for (int i = 0; i < threads; ++i) workers.emplace_back(serve);
  } catch (const std::system_error&) {  // the system provides no more threads
    if (workers.empty()) throw;
  }
  while (!coordinator.finished()) {
    coordinator.wait(std::chrono::milliseconds(100));
    on_wait();
  }
  for (std::thread& worker : workers) worker.join();
  coordinator.finish();
}

}  // namespace sprag::study
