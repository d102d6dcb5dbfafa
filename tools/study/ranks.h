// The processes of one study: alone, or ranks that mpirun or srun has started. Rank 0 hands out
// chunks, writes what comes back, and computes too, in a thread of its own; the others compute, and
// touch no file of results. The only place that knows MPI.
#pragma once

#include <cstdint>
#include <functional>

#include "tools/study/schedule.h"

namespace sprag::study {

class Ranks {
 public:
  /// One process until begin() is called.
  Ranks() = default;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  /// Ends MPI or, where a rank has given up, all ranks.
  ~Ranks();

  /// Starts MPI where the environment says that there are several processes; else this costs
  /// nothing. Throws UsageError where there are and the program was built without MPI.
  void begin();

  int rank() const { return rank_; }
  int size() const { return size_; }
  int hosts() const { return hosts_; }

  /// All ranks call it; returns rank 0's number.
  std::uint64_t from_manager(std::uint64_t number) const;

  /// Rank 0: serves the others until the study ends, while `workers` of its own threads compute.
  /// `on_wait` as in run_threads. Throws what stopped the study.
  void manage(Coordinator& coordinator, const std::function<Compute()>& make_compute,
              const std::function<void()>& on_wait);

  /// The others.
  void serve(const Compute& compute);

  /// Waits until all ranks are here; after a signal not for long.
  void leave();
  /// This rank cannot go on: the study ends.
  void give_up() { abandoned_ = true; }

 private:
  int rank_ = 0, size_ = 1, hosts_ = 1;
  bool begun_ = false;
  bool abandoned_ = false;  // a rank has given up, or did not answer after a signal
};

}  // namespace sprag::study
