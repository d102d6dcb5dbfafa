// Common parts of the end-to-end tests: a directory and a port of the test's own, the programs, and
// the files that they write.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/program_test.h"
#include "tests/support/repetitions.h"
#include "tests/support/temporary_directory.h"
#include "tests/support/udp_url.h"

namespace sprag::test {

/// Path of a shipped scene.
std::string scene(const std::string& name);

/// Exit code and output of a program that has ended.
struct Ended {
  int code = -1;
  std::string out, err;
};

struct SyncLine {
  std::int64_t k = 0;
  double t = 0.0;
  double v = 0.0;
};

struct StateLine {
  std::int64_t k = 0;
  double t = 0.0;
  std::vector<double> values;  // q, then u
};

/// Rows of a sync CSV; fails the test if the file is damaged.
std::vector<SyncLine> read_sync(const std::filesystem::path& file);

/// Rows of a states CSV; fails the test if the file is damaged.
std::vector<StateLine> read_states_file(const std::filesystem::path& file);

/// A column of a CSV by its name in the header; fails the test if there is none.
std::vector<double> read_column(const std::filesystem::path& file, const std::string& name);

/// Rows of an events CSV, without the header; a pulse has two.
std::size_t count_rows(const std::filesystem::path& file);

class EndToEnd : public testing::Test {
 protected:
  /// Starts one of the six programs on this test's port.
  Process& start(const std::string& program, const Arguments& arguments);
  /// Starts any other program.
  Process& start_command(const Arguments& command);

  /// The same, and waits for the end; fails the test if the program does not end in time.
  Ended run(const std::string& program, const Arguments& arguments);

  /// Waits for a process that runs; fails the test if it does not end in time.
  Ended end_of(Process& process);
  Ended end_of(Process& process, std::chrono::milliseconds timeout);

  /// Starts an observer or a logger and returns once it listens.
  Process& start_listening(const std::string& program, const Arguments& arguments);
  /// Starts a master and returns once it is about to run.
  Process& start_master(const Arguments& arguments);

  /// LCM's logger, after it has started to listen. After end_recorder() its file is complete.
  Process& start_recorder(const std::string& log, const std::string& channels = ".*");
  void end_recorder(Process& recorder);

  /// Waits until the master's progress on stderr has reached simulated time `t`.
  void wait_for_time(Process& master, double t);

  /// As eventually(), within the remaining time of the test.
  template <class Condition>
  [[nodiscard]] bool in_time(const Condition& condition) {
    return eventually(condition, left());
  }

  std::string file(const std::string& name) const { return (directory_ / name).string(); }
  std::string text(const std::string& name) const { return read_text(directory_ / name); }
  nlohmann::json json(const std::string& name) const;
  const std::string& url() const { return url_; }
  void set_url(const std::string& url) { url_ = url; }

  /// Events and states of the master without a network; returns the events file.
  std::string simulate(const std::string& scene_file, const std::string& duration,
                       const std::string& tick);
  /// The observer's settled ticks from a recording; returns the states file.
  std::string replay(const std::string& scene_file, const std::string& recording,
                     const Arguments& more);

  void SetUp() override;
  void TearDown() override;

 private:
  std::chrono::milliseconds left() const;

  TemporaryDirectory directory_;
  std::string url_ = udp_url();
  std::vector<std::unique_ptr<Process>> processes_;
  std::chrono::steady_clock::time_point deadline_;
  int replays_ = 0;
};

}  // namespace sprag::test
