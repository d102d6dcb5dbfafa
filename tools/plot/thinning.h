// Thins curves that have more points than a picture has pixels, without a visible change.
#pragma once

#include <vector>

namespace sprag::plot {

struct Points {
  std::vector<double> t, y;
};

/// The points in [from, to] and one on either side. Of each of `pixels` equal intervals the first,
/// least, greatest and last point are kept. Order is kept, and so are breaks: NaN in y. t must
/// ascend.
Points thinned(const std::vector<double>& t, const std::vector<double>& y, double from, double to,
               int pixels);

struct BandPoints {
  std::vector<double> t, low, high;
};

/// The same for a band; each interval keeps the least of low and the greatest of high.
BandPoints thinned(const std::vector<double>& t, const std::vector<double>& low,
                   const std::vector<double>& high, double from, double to, int pixels);

}  // namespace sprag::plot
