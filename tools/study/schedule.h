// Runs by their indices, in chunks, by several workers: threads here, ranks in ranks.h.
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

namespace sprag::study {

/// Indices first, ..., end - 1.
struct Range {
  std::int64_t first = 0, end = 0;

  std::int64_t size() const { return end - first; }
  friend bool operator==(const Range&, const Range&) = default;
};

/// What is left of `all` without `done`, which are within it, in any order, and do not overlap.
std::vector<Range> missing_ranges(Range all, std::vector<Range> done);

/// Rows of runs that have been computed.
struct Chunk {
  Range range;
  std::string text;
  std::int64_t failures = 0;
  double seconds = 0.0;  ///< of computing
};

/// Runs of which the rows are there, and how many of them have failed.
struct Computed {
  std::int64_t runs = 0, failures = 0;
};

/// Appends the rows of the first runs of a range that is not empty, at least of one: as many as are
/// computed together. Throws Interrupted, having appended none.
using Compute = std::function<Computed(Range range, std::string& text)>;

/// Computes a range; of what is interrupted, the runs that are done.
Chunk compute_chunk(const Compute& compute, Range range);

/// How long a chunk should take: what a killed study loses at most [s].
inline constexpr double usual_chunk_seconds = 1.0;

struct Progress {
  std::int64_t total = 0;     ///< runs of the study, or of its shard
  std::int64_t before = 0;    ///< that were there already
  std::int64_t done = 0;      ///< of this session
  std::int64_t failures = 0;  ///< of this session
  double seconds = 0.0;       ///< since the session began
  double busy = 0.0;          ///< of all workers, computing [s]
};

/// Hands out chunks and has them written. Any thread may call it.
class Coordinator {
 public:
  struct Options {
    std::int64_t total = 0;
    int workers = 1;
    std::int64_t chunk = 0;        ///< runs; 0: as many as take usual_chunk_seconds
    std::int64_t longest = 16384;  ///< most runs of a chunk
  };

  /// `write` gets each chunk once, one at a time; what it throws ends the study.
  Coordinator(std::vector<Range> missing, const Options& options,
              std::function<void(const Chunk&)> write);

  /// The next range to compute; none when there is no more or the study is to end.
  std::optional<Range> take();
  void put(const Chunk& chunk);
  /// No more chunks are handed out; finish() throws `reason`.
  void stop(std::exception_ptr reason) noexcept;

  bool stopped() const;
  /// Everything that was handed out has come back or was given up.
  bool finished() const;
  Progress progress() const;
  /// Throws what has stopped it, or Interrupted where the signal came before the end.
  void finish() const;

  /// Waits for something to happen, at most so long.
  void wait(std::chrono::milliseconds longest);

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Range> missing_;  // the next one last
  Options options_;
  std::function<void(const Chunk&)> write_;
  Progress progress_;
  std::int64_t left_ = 0;  // not handed out
  int out_ = 0;            // chunks that are handed out
  double seconds_per_run_ = 0.0;
  std::exception_ptr reason_;
  std::chrono::steady_clock::time_point begin_;
};

/// What a worker does: takes chunks and puts them back until there are no more.
void work(Coordinator& coordinator, const Compute& compute);

/// "1200 of 80000 runs, 312 per second, 4 min 12 s left, 3 failed"
std::string describe(const Progress& progress);

/// By threads; each gets a Compute of its own. `on_wait` is called by this thread every 100 ms or
/// so. Throws what stopped it.
void run_threads(Coordinator& coordinator, int threads,
                 const std::function<Compute()>& make_compute,
                 const std::function<void()>& on_wait);

}  // namespace sprag::study
