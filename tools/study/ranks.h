// The processes of a study: one, or the ranks started by mpirun or srun. Rank 0 hands out chunks
// and writes the results, and also computes in a thread of its own. The other ranks compute and
// access no file of results. Only this unit uses MPI.
#pragma once

#include <cstdint>
#include <functional>

#include "tools/study/schedule.h"

namespace sprag::study {

class Ranks {
 public:
  /// A single process until begin() is called.
  Ranks() = default;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  /// Finalizes MPI, or aborts all ranks if a rank has given up.
  ~Ranks();

  /// Initializes MPI if the environment indicates several processes; otherwise does nothing. Throws
  /// UsageError if there are several and the program was built without MPI.
  void begin();

  int rank() const { return rank_; }
  int size() const { return size_; }
  int hosts() const { return hosts_; }

  /// Broadcasts rank 0's number; to be called by all ranks.
  std::uint64_t from_manager(std::uint64_t number) const;

  /// Rank 0: serves the other ranks until the study ends, while one thread of its own computes.
  /// `on_wait` as in run_threads(). Throws the exception that stopped the study.
  void manage(Coordinator& coordinator, const std::function<Compute()>& make_compute,
              const std::function<void()>& on_wait);

  /// Other ranks: computes chunks until the study ends.
  void serve(const Compute& compute);

  /// Waits until all ranks call it; after a signal only for a short time.
  void leave();
  /// To be called if this rank cannot continue: the study ends.
  void give_up() { abandoned_ = true; }

 private:
  int rank_ = 0, size_ = 1, hosts_ = 1;
  bool begun_ = false;
  // A rank has given up, or did not answer after a signal. Never cleared; the destructor aborts.
  bool abandoned_ = false;
};

}  // namespace sprag::study
