#include "command_line/scene_inputs.h"

#include <iostream>
#include <sstream>

#include "command_line/program.h"
#include "sprag/detail/text/printable.h"

namespace sprag {

void require_inputs_until(const Scene& scene, double duration, const std::string& option) {
  const double end = end_of_inputs(scene.model);
  if (!(duration > end)) return;
  std::ostringstream message;
  message << "the recorded input of " << printable(scene.name) << " ends at t = " << end << "; "
          << option << " must be at most " << end
          << ", or the table with the key `file` must have outside = \"zero\" or \"hold\"";
  throw UsageError(message.str());
}

void report_held_inputs(const Scene& scene, double t) {
  const double end = end_of_inputs(scene.model);
  if (!(t > end)) return;
  std::cerr << "the recorded input ends at t = " << end
            << "; after it the observer holds its last value, which is not the machine's\n";
}

void refuse_recorded_inputs(const Scene& scene, const std::string& program) {
  if (!has_sampled_inputs(scene.model)) return;
  throw UsageError(program +
                   " does not support a recorded input (the key `file` of [excitation] "
                   "or [[force]]): it needs constant and harmonic inputs");
}

}  // namespace sprag
