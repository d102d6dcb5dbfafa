// Distributes runs by index, in chunks, to several workers: threads here, ranks in ranks.h.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/study/range.h"

namespace sprag::study {

/// The parts of `all` outside of `done`. These must lie in `all` without overlap, in any order.
std::vector<Range> missing_ranges(Range all, std::vector<Range> done);

/// Rows of computed runs.
struct Chunk {
  Range range;
  std::string text;
  std::int64_t failures = 0;
  double seconds = 0.0;  ///< computing time
};

/// Appends the rows of the first runs of a nonempty range: as many as are computed at once, at
/// least one. Throws Interrupted without appending any.
using Compute = std::function<Computed(Range range, std::string& text)>;

/// Computes a range; if interrupted, the chunk contains the completed runs.
Chunk compute_chunk(const Compute& compute, Range range);

/// Intended time of a chunk [s], which is the most that a killed study loses.
inline constexpr double usual_chunk_seconds = 1.0;

struct Progress {
  std::int64_t total = 0;     ///< runs of the study, or of its shard
  std::int64_t before = 0;    ///< computed in earlier sessions
  std::int64_t done = 0;      ///< computed in this session
  std::int64_t failures = 0;  ///< failed in this session
  double seconds = 0.0;       ///< since the session began
  double busy = 0.0;          ///< computing time of all workers [s]
};

/// Hands out chunks and has their results written. Thread-safe.
class Coordinator {
 public:
  struct Options {
    std::int64_t total = 0;
    int workers = 1;
    std::int64_t chunk = 0;        ///< runs of a chunk; 0: as many as take usual_chunk_seconds
    std::int64_t longest = 16384;  ///< most runs of a chunk
  };

  /// Calls `write` once for each chunk, one at a time. An exception from it ends the study.
  Coordinator(std::vector<Range> missing, const Options& options,
              std::function<void(const Chunk&)> write);

  /// The next range to compute; none if there is none left or the study is ending.
  std::optional<Range> take();
  void put(const Chunk& chunk);
  /// Ends the study: no more chunks are handed out, and finish() throws `reason`.
  void stop(std::exception_ptr reason) noexcept;

  bool stopped() const;
  /// Whether all chunks have been returned.
  bool finished() const;
  Progress progress() const;
  /// Throws the reason of the stop, or Interrupted if a signal came before the end.
  void finish() const;

  /// Waits for a change, at most this long.
  void wait(std::chrono::milliseconds longest);

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Range> missing_;  // in descending order: the next one is last
  Options options_;
  std::function<void(const Chunk&)> write_;
  Progress progress_;
  std::int64_t left_ = 0;  // runs not handed out
  int out_ = 0;            // chunks handed out and not returned
  double seconds_per_run_ = 0.0;
  std::exception_ptr reason_;
  std::chrono::steady_clock::time_point begin_;
};

/// The loop of a worker: takes and returns chunks until there are none left.
void work(Coordinator& coordinator, const Compute& compute);

/// "1200 of 80000 runs, 312 per second, 4 min 12 s left, 3 failed"
std::string describe(const Progress& progress);

/// Computes with threads, each with a Compute of its own. This thread calls `on_wait` about every
/// 100 ms. Throws the exception that stopped the study.
void run_threads(Coordinator& coordinator, int threads,
                 const std::function<Compute()>& make_compute,
                 const std::function<void()>& on_wait);

}  // namespace sprag::study
