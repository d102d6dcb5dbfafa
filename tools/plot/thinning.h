// Curves of more points than a picture has pixels: what is left out would not be seen.
#pragma once

#include <vector>

namespace sprag::plot {

struct Points {
  std::vector<double> t, y;
};

/// The points of [from, to], and one on either side, of which each of `pixels` equal intervals
/// keeps its first, least, greatest and last. Order stays, and so do breaks: NaN in y. t ascends.
Points thinned(const std::vector<double>& t, const std::vector<double>& y, double from, double to,
               int pixels);

struct BandPoints {
  std::vector<double> t, low, high;
};

/// The same for a band, of which every interval keeps the least of low and the greatest of high.
BandPoints thinned(const std::vector<double>& t, const std::vector<double>& low,
                   const std::vector<double>& high, double from, double to, int pixels);

}  // namespace sprag::plot
