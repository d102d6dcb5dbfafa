// Standard input, output and error of a process.
#pragma once

namespace sprag {

/// Opens /dev/null for each of the file descriptors 0, 1 and 2 that is closed. Otherwise a file of
/// the program would get its number, and messages would be written into it. To be called before
/// anything is opened.
void open_standard_files() noexcept;

}  // namespace sprag
