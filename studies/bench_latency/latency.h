// Latency of an observer with the replica: from the sending of a contact event to the estimate that
// contains it. A bare LCM ping and a bare UDP ping of the same size are measured in the same run,
// and the time from the writing of a line to a pipe of `listen` to the estimate of an observer that
// follows it. All are round trips.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "command_line/program.h"

namespace sprag::bench_latency {

struct Options {
  std::filesystem::path scene;
  std::string observer;
  std::string listen;
  double tick = 1e-3;
  int events = 2000;
  bool real_time = false;
  std::string lcm_url = "udpm://239.255.76.67:7677?ttl=0";
  std::string listen_url = "udpm://239.255.76.67:7687?ttl=0";  ///< of listen and its observer
};

struct Samples {
  const char* what;
  std::vector<std::int64_t> ns;
  int lost = 0;

  void add(std::int64_t value) {
    if (value < 0) {
      ++lost;
    } else {
      ns.push_back(value);
    }
  }

  /// The quantile [us] for probability p; 0 without values.
  double us(double p) const;
};

/// Starts the observer and the two echoes, simulates a machine of `contacts` contacts, and stops
/// all of them. Throws std::runtime_error if one of them fails.
std::vector<Samples> measure(const Options& options, const CommonOptions& common, int contacts);

}  // namespace sprag::bench_latency
