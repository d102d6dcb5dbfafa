// A program run by a test: its stdout and stderr go to files, every wait has a time limit, and no
// process outlives the test.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace sprag::test {

using namespace std::chrono_literals;

/// Evaluates `condition` every few milliseconds until it holds or `timeout` has passed; returns its
/// value.
template <class Condition>
bool eventually(const Condition& condition, std::chrono::milliseconds timeout);

/// What a program printed or wrote. Throws nlohmann::json::parse_error.
nlohmann::json parse_json(const std::string& text);

class Process {
 public:
  /// Starts `command` (program, looked up in PATH if it has no slash, and its arguments) with
  /// stdout in `directory`/`label`.out and stderr in `label`.err. The program ends with the thread
  /// that started it. Throws std::runtime_error if no process can be made; a program that cannot be
  /// executed exits with 127.
  Process(std::vector<std::string> command, const std::filesystem::path& directory,
          const std::string& label);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process() { kill(); }

  /// Waits for the end and returns the exit code, 128 + n after signal n; empty if the program
  /// still runs after `timeout`.
  std::optional<int> wait(std::chrono::milliseconds timeout);

  bool running() { return !wait(0ms); }

  /// Sends a signal if the program still runs.
  void signal(int number);

  /// Sends SIGKILL, and waits for the end.
  void kill() noexcept;

  /// The program's output so far.
  std::string out() const;
  std::string err() const;

  const std::string& label() const { return label_; }
  pid_t id() const { return pid_; }

 private:
  std::string label_;
  std::filesystem::path out_, err_;
  pid_t pid_ = -1;
  std::optional<int> code_;
};

void pause_briefly();

template <class Condition>
bool eventually(const Condition& condition, std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return condition();
    pause_briefly();
  }
  return true;
}

}  // namespace sprag::test
