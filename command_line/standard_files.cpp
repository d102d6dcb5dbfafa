#include "command_line/standard_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace sprag {

void open_standard_files() noexcept {
  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(file, F_GETFD) >= 0 || errno != EBADF) continue;
    // open() returns the lowest free descriptor, which is this one: all below are open.
    if (::open("/dev/null", O_RDWR) != file) return;
  }
}

}  // namespace sprag
