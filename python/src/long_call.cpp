#include "python/src/long_call.h"

#include <csignal>
#include <mutex>

namespace sprag::python {
namespace {

// The signal has one handler for the process: of the calls under way, in several threads, the first
// takes its place and the last gives it back.
std::mutex mutex;
int calls = 0;
bool relays = false;
struct sigaction python_handler;
std::stop_source stop;  // of the calls under way; none registers a std::stop_callback

void relay(int signal) {
  stop.request_stop();
  python_handler.sa_handler(signal);
}

bool is_function(const struct sigaction& action) {
  return (action.sa_flags & SA_SIGINFO) == 0 && action.sa_handler != SIG_DFL &&
         action.sa_handler != SIG_IGN;
}

}  // namespace

InterruptRelay::InterruptRelay() {
  const std::lock_guard lock(mutex);
  if (calls++ > 0) return;
  stop = std::stop_source();
  relays = sigaction(SIGINT, nullptr, &python_handler) == 0 && is_function(python_handler);
  if (!relays) return;
  struct sigaction action = python_handler;
  action.sa_handler = relay;
  relays = sigaction(SIGINT, &action, nullptr) == 0;
}

InterruptRelay::~InterruptRelay() {
  const std::lock_guard lock(mutex);
  if (--calls > 0) return;
  if (relays) sigaction(SIGINT, &python_handler, nullptr);
}

std::stop_token InterruptRelay::token() const {
  const std::lock_guard lock(mutex);
  return stop.get_token();
}

void raise_interrupt() {
  if (PyErr_CheckSignals() == 0) PyErr_SetNone(PyExc_KeyboardInterrupt);
  throw pybind11::error_already_set();
}

}  // namespace sprag::python
