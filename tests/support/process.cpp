#include "tests/support/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "tests/support/temporary_directory.h"

namespace sprag::test {

namespace {

int create(const std::filesystem::path& file) {
  return ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
}

int exit_code(int status) {
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

nlohmann::json parse_json(const std::string& text) { return nlohmann::json::parse(text); }

Process::Process(std::vector<std::string> command, const std::filesystem::path& directory,
                 const std::string& label)
    : label_(label), out_(directory / (label + ".out")), err_(directory / (label + ".err")) {
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  const int in = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const int out = create(out_);
  const int err = create(err_);
  const pid_t parent = ::getpid();
  if (in >= 0 && out >= 0 && err >= 0) pid_ = ::fork();
  if (pid_ == 0) {  // only async-signal-safe calls between fork and exec
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    std::signal(SIGHUP, SIG_DFL);  // even if the tests run under nohup
    if (::getppid() != parent) ::_exit(127);
    ::dup2(in, STDIN_FILENO);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(err, STDERR_FILENO);
    ::execvp(arguments[0], arguments.data());
    ::_exit(127);
  }
  ::close(in);
  ::close(out);
  ::close(err);
  if (pid_ < 0) throw std::runtime_error("cannot start " + label);
}

std::optional<int> Process::wait(std::chrono::milliseconds timeout) {
  eventually(
      [this] {
        if (code_) return true;
        int status = 0;
        const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
        if (ended == pid_) code_ = exit_code(status);
        return code_.has_value();
      },
      timeout);
  return code_;
}

void Process::signal(int number) {
  if (running()) ::kill(pid_, number);
}

void Process::kill() noexcept {
  if (code_) return;
  ::kill(pid_, SIGKILL);
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  code_ = exit_code(status);
}

std::string Process::out() const { return read_text(out_); }
std::string Process::err() const { return read_text(err_); }

void pause_briefly() { std::this_thread::sleep_for(5ms); }

}  // namespace sprag::test
