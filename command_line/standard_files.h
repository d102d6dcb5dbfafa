// Standard input, output and error of a process.
#pragma once

namespace sprag {

/// Opens those of the file descriptors 0, 1 and 2 that are closed on /dev/null, so that no file of
/// the program gets their numbers and, with it, its messages. To be called before anything is
/// opened.
void open_standard_files() noexcept;

}  // namespace sprag
