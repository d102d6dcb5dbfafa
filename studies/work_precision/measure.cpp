#include "studies/work_precision/measure.h"

#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "studies/common/cpu_time.h"

namespace sprag::work_precision {
namespace {

using Clock = std::chrono::steady_clock;

// The child sends all its figures again after each run, in one write that is atomic on pipes.
struct Message {
  Figures figures;
  bool last = false;
  std::array<char, 512> failure{};
};
static_assert(std::is_trivially_copyable_v<Message> && sizeof(Message) <= 4096);

/// A figure of /proc/self/status [kB], or NaN.
double process_status(const std::string& name) {
  std::ifstream file("/proc/self/status");
  std::string line;
  while (std::getline(file, line)) {
    if (line.compare(0, name.size(), name) != 0) continue;
    std::istringstream rest(line.substr(name.size() + 1));
    double value = not_known;
    rest >> value;
    return value;
  }
  return not_known;
}

bool reset_peak_memory() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return file.good();
}

class Child {
 public:
  Child(const Method& method, double setting, const Model& model, const State& start,
        const Reference& reference, const Limits& limits, int pipe)
      : method_(method),
        setting_(setting),
        reference_(reference),
        limits_(limits),
        pipe_(pipe),
        task_{model, start, reference.horizon, 0.0} {}

  void work() {
    if (accuracy_runs()) repeat();
    message_.last = true;
    send();
  }

 private:
  void send() {
    const auto written = write(pipe_, &message_, sizeof message_);
    if (written != static_cast<ssize_t>(sizeof message_)) _exit(EXIT_FAILURE);
  }

  void prepare_run(double sample_step) {
    task_.sample_step = sample_step;
    outcome_ = {};
    prepare(task_, outcome_);
  }

  /// Runs once and returns the CPU time in seconds; a failure is noted in the message.
  double run() {
    const double before = common::cpu_seconds();
    try {
      method_.run(task_, setting_, outcome_);
    } catch (const std::exception& e) {
      outcome_.failure = std::string("exception: ") + e.what();
    } catch (...) {
      outcome_.failure = "exception of an unknown type";
    }
    const double seconds = common::cpu_seconds() - before;
    if (!failed()) outcome_.failure.copy(message_.failure.data(), message_.failure.size() - 1);
    count();
    return seconds;
  }

  bool failed() const { return message_.failure[0] != '\0'; }

  void count() {
    message_.figures.steps = outcome_.steps;
    message_.figures.solves = outcome_.solves;
    message_.figures.right_hand_sides = outcome_.right_hand_sides;
  }

  bool accuracy_runs() {
    Figures& figures = message_.figures;
    prepare_run(reference_.sample_step);
    // Returns free memory to the system, so that the first run starts from the same state.
    malloc_trim(0);
    const bool known = reset_peak_memory();
    const double before = process_status("RssAnon");
    run();
    // RssFile is subtracted: the pages of code are shared by all methods.
    if (known) {
      figures.memory_kb =
          std::max(process_status("VmHWM") - process_status("RssFile") - before, 0.0);
    }
    figures.impacts = score(reference_.impacts, outcome_.impacts, reference_.horizon);
    figures.early_impacts = score(reference_.impacts, outcome_.impacts, reference_.early);
    figures.states = score(reference_, outcome_.q, outcome_.u, reference_.horizon);
    figures.early_states = score(reference_, outcome_.q, outcome_.u, reference_.early);
    send();
    prepare_run(limits_.fine_step);
    run();
    figures.penetration = penetration(task_, outcome_.q);
    send();
    return !failed();
  }

  void repeat() {
    task_.horizon = std::max(task_.horizon, limits_.timed_span);
    double shortest = std::numeric_limits<double>::infinity();
    double total = 0.0;
    for (int runs = 0; runs < limits_.most_repeats; ++runs) {
      if (runs >= limits_.least_repeats && total >= limits_.timing) break;
      if (runs > 0 && total + shortest > limits_.timeout / 3) break;
      prepare_run(0.0);
      const double seconds = run();
      if (failed()) return;
      shortest = std::min(shortest, seconds);
      total += seconds;
    }
    message_.figures.cpu_us_per_time = 1e6 * shortest / task_.horizon;
  }

  const Method& method_;
  double setting_;
  const Reference& reference_;
  const Limits& limits_;
  int pipe_;
  Task task_;
  Outcome outcome_;
  Message message_;
};

struct Pipe {
  std::array<int, 2> ends{-1, -1};
  Pipe() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0) {
      throw std::system_error(errno, std::generic_category(), "pipe");
    }
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  void close_end(std::size_t end) {
    if (ends[end] >= 0) close(ends[end]);
    ends[end] = -1;
  }
};

[[noreturn]] void live(Child& child, int words) {
  // Output of libraries, on any stream, is collected as the reason of a failure; core dumps are
  // off.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  dup2(words, STDOUT_FILENO);
  dup2(words, STDERR_FILENO);
  child.work();
  _exit(EXIT_SUCCESS);  // exit() would run the parent's exit handlers
}

/// The last line of a child's output.
std::string last_line(std::string_view words) {
  const auto end = words.find_last_not_of(" \n\r\t");
  if (end == std::string_view::npos) return {};
  words = words.substr(0, end + 1);
  return std::string(words.substr(words.find_last_of('\n') + 1));
}

struct Reports {
  Message message;
  bool timed_out = false, stopped = false;
  std::string words;
};

/// Reads until the child closes its pipes or its time is up. Without any message the result is
/// `undetected`.
Reports listen(int messages, int words, const Figures& undetected, const Limits& limits) {
  constexpr std::size_t kept_words = 4096;
  Reports reports;
  reports.message.figures = undetected;
  const auto end = Clock::now() + std::chrono::duration<double>(limits.timeout);
  std::array<pollfd, 2> open{{{messages, POLLIN, 0}, {words, POLLIN, 0}}};
  while (open[0].fd >= 0 || open[1].fd >= 0) {
    const double left = std::chrono::duration<double>(end - Clock::now()).count();
    if (left <= 0.0) {
      reports.timed_out = true;
      break;
    }
    const int ready = poll(open.data(), open.size(), static_cast<int>(left * 1e3) + 1);
    if (limits.stop != nullptr && limits.stop()) {
      reports.stopped = true;
      break;
    }
    if (ready <= 0) continue;
    if (open[0].revents != 0) {
      Message message;
      if (read(messages, &message, sizeof message) == static_cast<ssize_t>(sizeof message)) {
        reports.message = message;
      } else {
        open[0].fd = -1;
      }
    }
    if (open[1].revents != 0) {
      std::array<char, 4096> bytes;
      const ssize_t size = read(words, bytes.data(), bytes.size());
      if (size <= 0) {
        open[1].fd = -1;
        continue;
      }
      reports.words.append(bytes.data(), static_cast<std::size_t>(size));
      if (reports.words.size() > kept_words) {
        reports.words.erase(0, reports.words.size() - kept_words);
      }
    }
  }
  return reports;
}

std::string reason(const Reports& reports, int status, double timeout) {
  if (reports.stopped) return "stopped";
  if (reports.message.failure[0] != '\0') return reports.message.failure.data();
  std::string what;
  if (reports.timed_out) {
    std::ostringstream text;
    text << "timeout after " << timeout << " s";
    what = text.str();
  } else if (WIFSIGNALED(status)) {
    what = std::string("signal: ") + strsignal(WTERMSIG(status));
  } else if (!reports.message.last) {
    what = "exit with " + std::to_string(WEXITSTATUS(status));
  } else {
    return {};
  }
  const std::string words = last_line(reports.words);
  return words.empty() ? what : what + "; " + words;
}

}  // namespace

Measurement measure(const Method& method, double setting, const Model& model, const State& start,
                    const Reference& reference, const Limits& limits) {
  Pipe messages;
  Pipe words;
  std::fflush(nullptr);  // otherwise a child that exits would write the buffered output again
  const pid_t pid = fork();
  if (pid < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (pid == 0) {
    Child child(method, setting, model, start, reference, limits, messages.ends[1]);
    live(child, words.ends[1]);
  }
  messages.close_end(1);
  words.close_end(1);
  Figures undetected;  // with all impacts missed
  undetected.impacts = score(reference.impacts, {}, reference.horizon);
  undetected.early_impacts = score(reference.impacts, {}, reference.early);
  const Reports reports = listen(messages.ends[0], words.ends[0], undetected, limits);
  if (reports.timed_out || reports.stopped) kill(pid, SIGKILL);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return {reports.message.figures, reason(reports, status, limits.timeout)};
}

}  // namespace sprag::work_precision
