#include "tools/listen/input_grid.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "lcmtypes/refusal.h"

namespace sprag {

InputGrid::Place InputGrid::take(double t) {
  Place place;
  if (!t0_) {
    t0_ = t;
    next_ = 1;
    return place;
  }
  const double since = (t - *t0_) / dt_;
  const double nearest = std::round(since);
  if (!(nearest < static_cast<double>(largest_number))) {
    place.problem = "the time of the sample is too large";
  } else if (nearest < static_cast<double>(next_)) {
    place.problem = "there is a sample of this time or a later one already";
  } else if (std::abs(since - nearest) > largest_shift) {
    std::array<char, 160> text;
    std::snprintf(text.data(), text.size(),
                  "the sample is %.3g of an interval from its place; the scene's record has an "
                  "interval of %.6g s",
                  std::abs(since - nearest), dt_);
    place.problem = text.data();
  } else {
    place.k = static_cast<std::int64_t>(nearest);
    place.missing = place.k - next_;
    next_ = place.k + 1;
  }
  return place;
}

}  // namespace sprag
