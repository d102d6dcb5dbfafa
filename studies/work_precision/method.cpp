#include "studies/work_precision/method.h"

#include <cmath>
#include <limits>

namespace sprag::work_precision {

Eigen::Index Task::samples() const {
  if (!(sample_step > 0.0)) return 0;
  auto last = static_cast<Eigen::Index>(std::floor(horizon / sample_step));
  // The quotient is rounded: the last sample is the last one whose rounded time does not exceed the
  // horizon.
  while (sample_time(last + 1) <= horizon) ++last;
  while (last > 0 && sample_time(last) > horizon) --last;
  return last + 1;
}

void prepare(const Task& task, Outcome& outcome) {
  const Eigen::Index f = task.model.coordinates();
  outcome.q.setConstant(f, task.samples(), std::numeric_limits<double>::quiet_NaN());
  outcome.u = outcome.q;
}

}  // namespace sprag::work_precision
