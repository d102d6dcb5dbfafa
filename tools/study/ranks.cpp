#include "tools/study/ranks.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "command_line/program.h"
#include "sprag/detail/mechanics/interrupt.h"

#ifdef SPRAG_HAS_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace sprag::study {
namespace {

// Number of processes, from variables of Open MPI's mpirun, MPICH's mpirun and srun.
int processes_of_environment() {
  for (const char* variable : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}) {
    if (const char* value = std::getenv(variable)) return std::max(std::atoi(value), 1);
  }
  // A launcher with PMIx provides the size only through its library.
  if (std::getenv("PMIX_RANK") == nullptr) return 1;
  const char* tasks = std::getenv("SLURM_NTASKS");
  return tasks != nullptr ? std::max(std::atoi(tasks), 1) : 1;
}

}  // namespace

#ifndef SPRAG_HAS_MPI

Ranks::~Ranks() = default;

void Ranks::begin() {
  const int processes = processes_of_environment();
  if (processes == 1) return;
  throw UsageError("is built without MPI and cannot share a study with " +
                   std::to_string(processes - 1) +
                   " other ranks: start it alone, with --jobs or --shard, or build it where "
                   "libopenmpi-dev is installed (scripts/install_packages --mpi)");
}

std::uint64_t Ranks::from_manager(std::uint64_t number) const { return number; }

void Ranks::manage(Coordinator& coordinator, const std::function<Compute()>& make_compute,
                   const std::function<void()>& on_wait) {
  run_threads(coordinator, 1, make_compute, on_wait);
}

void Ranks::serve(const Compute&) {}

void Ranks::leave() {}

#else

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr int tag_to_manager = 1, tag_to_worker = 2;
// Waiting time for computing ranks after a signal.
constexpr auto patience = milliseconds(300);

// Header of a worker's message, which is followed by the rows.
struct Header {
  Range range;
  std::int64_t failures = 0;
  double seconds = 0.0;
  bool asked = false;  // the first message, a request without a chunk
};

// MPI waits by spinning. Sleeping leaves the core to computing threads; the time grows while no
// message arrives.
class Nap {
 public:
  void take() {
    std::this_thread::sleep_for(length_);
    length_ = std::min(2 * length_, longest);
  }
  void reset() { length_ = shortest; }

 private:
  static constexpr microseconds shortest{20}, longest{1000};
  microseconds length_ = shortest;
};

// Whether the time after a signal has passed in which other ranks are waited for.
class Patience {
 public:
  bool over() {
    if (!interrupted()) return false;
    if (!since_) since_ = Clock::now();
    return Clock::now() - *since_ > patience;
  }

 private:
  std::optional<Clock::time_point> since_;
};

int count_hosts(int rank, int size) {
  std::array<char, MPI_MAX_PROCESSOR_NAME> name{};
  int length = 0;
  MPI_Get_processor_name(name.data(), &length);
  std::vector<char> all(rank == 0 ? name.size() * static_cast<std::size_t>(size) : 0);
  MPI_Gather(name.data(), static_cast<int>(name.size()), MPI_CHAR, all.data(),
             static_cast<int>(name.size()), MPI_CHAR, 0, MPI_COMM_WORLD);
  std::set<std::string> names;
  for (std::size_t i = 0; i < all.size(); i += name.size()) names.insert(all.data() + i);
  return std::max(static_cast<int>(names.size()), 1);
}

}  // namespace

Ranks::~Ranks() {
  if (!begun_) return;
  if (abandoned_) MPI_Abort(MPI_COMM_WORLD, exit_failed);
  MPI_Finalize();
}

void Ranks::leave() {
  if (!begun_) return;
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  Nap nap;
  Patience others;
  for (int arrived = 0; !abandoned_;) {
    MPI_Test(&request, &arrived, MPI_STATUS_IGNORE);
    if (arrived != 0) break;
    if (others.over()) abandoned_ = true;
    nap.take();
  }
}

void Ranks::begin() {
  if (processes_of_environment() == 1) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  begun_ = true;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  hosts_ = count_hosts(rank_, size_);
  if (provided < MPI_THREAD_FUNNELED) throw UsageError("needs an MPI library that knows threads");
}

std::uint64_t Ranks::from_manager(std::uint64_t number) const {
  if (begun_) MPI_Bcast(&number, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  return number;
}

void Ranks::manage(Coordinator& coordinator, const std::function<Compute()>& make_compute,
                   const std::function<void()>& on_wait) {
  std::thread own(with_stop_token([&] {
    try {
      work(coordinator, make_compute());
    } catch (...) {
      coordinator.stop(std::current_exception());
    }
  }));
  int active = size_ - 1;
  Nap nap;
  Patience others;
  auto looked = Clock::now();
  std::vector<char> message;
  while (active > 0 || !coordinator.finished()) {
    if (Clock::now() - looked > milliseconds(100)) {
      looked = Clock::now();
      on_wait();
    }
    int there = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, tag_to_manager, MPI_COMM_WORLD, &there, &status);
    if (there == 0) {
      if (others.over()) {
        abandoned_ = active > 0;
        break;
      }
      nap.take();
      continue;
    }
    nap.reset();
    int bytes = 0;
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    message.resize(static_cast<std::size_t>(bytes));
    MPI_Recv(message.data(), bytes, MPI_BYTE, status.MPI_SOURCE, tag_to_manager, MPI_COMM_WORLD,
             MPI_STATUS_IGNORE);
    Header header;
    std::memcpy(&header, message.data(), sizeof header);
    if (!header.asked) {
      const auto rows = message.begin() + sizeof header;
      coordinator.put({header.range, {rows, message.end()}, header.failures, header.seconds});
    }
    const Range next = coordinator.take().value_or(Range{});
    if (next.size() == 0) --active;
    MPI_Send(&next, sizeof next, MPI_BYTE, status.MPI_SOURCE, tag_to_worker, MPI_COMM_WORLD);
  }
  own.join();
  coordinator.finish();
}

void Ranks::serve(const Compute& compute) {
  Header header;
  header.asked = true;
  std::vector<char> message(sizeof header);
  std::memcpy(message.data(), &header, sizeof header);
  while (true) {
    MPI_Send(message.data(), static_cast<int>(message.size()), MPI_BYTE, 0, tag_to_manager,
             MPI_COMM_WORLD);
    Nap nap;
    Patience manager;
    for (int there = 0; there == 0;) {
      MPI_Iprobe(0, tag_to_worker, MPI_COMM_WORLD, &there, MPI_STATUS_IGNORE);
      if (there != 0) break;
      if (manager.over()) return;
      nap.take();
    }
    Range range;
    MPI_Recv(&range, sizeof range, MPI_BYTE, 0, tag_to_worker, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    if (range.size() == 0) return;
    const Chunk chunk = compute_chunk(compute, range);
    header = {chunk.range, chunk.failures, chunk.seconds, false};
    message.resize(sizeof header + chunk.text.size());
    std::memcpy(message.data(), &header, sizeof header);
    std::copy(chunk.text.begin(), chunk.text.end(), message.begin() + sizeof header);
  }
}

#endif

}  // namespace sprag::study
