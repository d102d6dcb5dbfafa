#include "tools/report/pdf.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag::report {
namespace {

constexpr std::chrono::seconds longest(120);
constexpr int pause_ms = 20;

// A folder of this process, removed at the end. Programs get fixed names in it, not the user's.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "sprag_report_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw std::runtime_error("no temporary folder can be made: " +
                               std::generic_category().message(errno));
    }
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::string file(const char* name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// Starts a program of the PATH in a process group of its own, without a shell and without output.
// Returns -1 if it is not installed.
pid_t start(std::vector<std::string> command) {
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  pid_t id = -1;
  const int error =
      ::posix_spawnp(&id, arguments.front(), &actions, &attributes, arguments.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return -1;
  if (error != 0) {
    throw std::runtime_error(command.front() +
                             " cannot be started: " + std::generic_category().message(error));
  }
  return id;
}

// Waits for the end; kills the process group after the time limit, or if a stop is requested.
bool ends_well(pid_t id) {
  const auto deadline = std::chrono::steady_clock::now() + longest;
  const auto end = [id] {
    ::kill(-id, SIGKILL);
    ::waitpid(id, nullptr, 0);
  };
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(id, &status, WNOHANG);
    if (ended == id) return status == 0;
    if (ended < 0 && errno != EINTR) return false;
    if (std::chrono::steady_clock::now() > deadline) {
      end();
      return false;
    }
    try {
      check_interrupt();
    } catch (...) {
      end();
      throw;
    }
    ::poll(nullptr, 0, pause_ms);
  }
}

}  // namespace

std::string pdf_of(const std::string& html) {
  const TemporaryFolder folder;
  const std::string page = folder.file("report.html"), pdf = folder.file("report.pdf");
  write_file(page, html);
  std::vector<std::string> command{"chromium",
                                   "--headless",
                                   "--disable-gpu",
                                   "--disable-dev-shm-usage",
                                   "--no-first-run",
                                   "--disable-extensions",
                                   "--user-data-dir=" + folder.file("profile"),
                                   "--no-pdf-header-footer",
                                   "--print-to-pdf-no-header",
                                   "--print-to-pdf=" + pdf,
                                   "file://" + page};
  // Chromium's sandbox does not run as root. The page has no script and loads nothing.
  if (::geteuid() == 0) command.insert(command.begin() + 1, "--no-sandbox");
  const pid_t id = start(command);
  if (id < 0) {
    throw std::runtime_error(
        "chromium is not installed, so that no PDF can be written; install Debian's package "
        "chromium, or use --format html and print the page in any browser");
  }
  if (!ends_well(id) || !std::filesystem::exists(pdf)) {
    throw std::runtime_error(
        "chromium has failed to convert the report to PDF; use --format html and print the page in "
        "any browser");
  }
  return read_whole(pdf);
}

}  // namespace sprag::report
