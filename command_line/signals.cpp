#include "command_line/signals.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <ctime>
#include <stop_token>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SPRAG_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SPRAG_SANITIZED 1
#endif
#endif

namespace sprag {
namespace {

#if defined(SPRAG_SANITIZED)
constexpr timespec patience{15, 0};
#else
constexpr timespec patience{0, 900'000'000};
#endif

// A timer instead of a thread: a signal handler may start it, and it needs no stack.
timer_t last_resort;
bool has_last_resort = false;
std::array<char, 160> message;
std::size_t message_size = 0;

// request_stop() allocates nothing, and waits for nothing where no std::stop_callback is
// registered: the programs register none, so that a handler may call it. Never destroyed: a signal
// may come late.
std::stop_source& stop = *new std::stop_source;

std::stop_token new_stop_token() {
  stop = std::stop_source();
  return stop.get_token();
}

void end_here(int) {
  (void)!::write(STDERR_FILENO, message.data(), message_size);
  ::_exit(1);
}

void ask_to_stop(int) {
  if (stop.stop_requested()) return;  // later signals do not restart the timer
  stop.request_stop();
  const itimerspec once{{0, 0}, patience};
  if (has_last_resort) ::timer_settime(last_resort, 0, &once, nullptr);
}

void handle(int signal, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;  // poll() and sleeps return nevertheless
  ::sigaction(signal, &action, nullptr);
}

bool ignored(int signal) {
  struct sigaction action {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

bool stop_requested() noexcept { return stop.stop_requested(); }

Signals::Signals(const std::string& program) : scope_(new_stop_token()) {
  const std::string text = program + ": does not end by itself after the signal; ended as it is\n";
  message_size = std::min(text.size(), message.size());
  std::copy_n(text.begin(), message_size, message.begin());
  sigevent event{};
  event.sigev_notify = SIGEV_SIGNAL;
  event.sigev_signo = SIGRTMIN;
  handle(SIGRTMIN, end_here);
  has_last_resort = ::timer_create(CLOCK_MONOTONIC, &event, &last_resort) == 0;
  handle(SIGINT, ask_to_stop);
  handle(SIGTERM, ask_to_stop);
  if (!ignored(SIGHUP)) handle(SIGHUP, ask_to_stop);
  std::signal(SIGPIPE, SIG_IGN);  // writing to a closed pipe fails with an error, which is reported
  std::signal(SIGXFSZ, SIG_IGN);  // the same at the size limit of files (ulimit -f)
}

Signals::~Signals() {
  if (has_last_resort) ::timer_delete(last_resort);
  has_last_resort = false;
}

}  // namespace sprag
