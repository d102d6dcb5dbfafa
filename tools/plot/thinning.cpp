#include "tools/plot/thinning.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace sprag::plot {
namespace {

struct Range {
  std::size_t first = 0, end = 0;
};

// Includes one point on either side, so that a line reaches the edge.
Range inside(const std::vector<double>& t, double from, double to) {
  const auto first = std::lower_bound(t.begin(), t.end(), from);
  const auto end = std::upper_bound(first, t.end(), to);
  return {static_cast<std::size_t>(first - t.begin()) - (first != t.begin() ? 1 : 0),
          static_cast<std::size_t>(end - t.begin()) + (end != t.end() ? 1 : 0)};
}

int pixel(double t, double from, double to, int pixels) {
  return static_cast<int>(std::floor((t - from) / (to - from) * pixels));
}

}  // namespace

Points thinned(const std::vector<double>& t, const std::vector<double>& y, double from, double to,
               int pixels) {
  const Range range = inside(t, from, to);
  Points kept;
  const auto keep = [&](std::size_t i) {
    kept.t.push_back(t[i]);
    kept.y.push_back(y[i]);
  };
  std::vector<std::size_t> of_pixel;
  for (std::size_t i = range.first; i < range.end;) {
    if (std::isnan(y[i])) {
      if (kept.y.empty() || !std::isnan(kept.y.back())) keep(i);
      ++i;
      continue;
    }
    const int here = pixel(t[i], from, to, pixels);
    std::size_t least = i, greatest = i, last = i;
    const std::size_t first = i;
    for (; i < range.end && !std::isnan(y[i]) && pixel(t[i], from, to, pixels) == here; ++i) {
      if (y[i] < y[least]) least = i;
      if (y[i] > y[greatest]) greatest = i;
      last = i;
    }
    of_pixel = {first, least, greatest, last};
    std::sort(of_pixel.begin(), of_pixel.end());
    of_pixel.erase(std::unique(of_pixel.begin(), of_pixel.end()), of_pixel.end());
    for (const std::size_t k : of_pixel) keep(k);
  }
  return kept;
}

BandPoints thinned(const std::vector<double>& t, const std::vector<double>& low,
                   const std::vector<double>& high, double from, double to, int pixels) {
  const Range range = inside(t, from, to);
  BandPoints kept;
  bool open = false;
  int of_last = 0;
  for (std::size_t i = range.first; i < range.end; ++i) {
    const bool there = std::isfinite(low[i]) && std::isfinite(high[i]);
    const int here = pixel(t[i], from, to, pixels);
    if (there && open && here == of_last) {
      kept.low.back() = std::min(kept.low.back(), low[i]);
      kept.high.back() = std::max(kept.high.back(), high[i]);
      continue;
    }
    if (there || open) {
      kept.t.push_back(t[i]);
      kept.low.push_back(there ? low[i] : std::nan(""));
      kept.high.push_back(there ? high[i] : std::nan(""));
    }
    open = there;
    of_last = here;
  }
  return kept;
}

}  // namespace sprag::plot
