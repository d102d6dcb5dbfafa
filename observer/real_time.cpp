#include "observer/real_time.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <cerrno>
#include <system_error>

namespace sprag {

std::string lock_memory() {
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return "mlockall: " + std::generic_category().message(errno);
}

std::string schedule_fifo(int priority) {
  sched_param parameter{};
  parameter.sched_priority = priority;
  const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameter);
  return error == 0 ? std::string{} : "SCHED_FIFO: " + std::generic_category().message(error);
}

void sleep_exactly() { ::prctl(PR_SET_TIMERSLACK, 1UL); }

}  // namespace sprag
