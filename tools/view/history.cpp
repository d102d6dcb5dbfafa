#include "tools/view/history.h"

#include <algorithm>
#include <cmath>

namespace sprag::view {
namespace {

constexpr std::size_t levels = 12;  // at 1 kHz the last one reaches back a year
constexpr std::size_t ratio = 4;
constexpr std::size_t least_buckets = 512, most_buckets = 8192;
constexpr float missing = std::numeric_limits<float>::quiet_NaN();

std::size_t buckets_for(std::size_t columns, std::size_t memory) {
  const std::size_t of_bucket = 2 * sizeof(double) + columns * 2 * sizeof(float);
  return std::clamp(memory / (levels * of_bucket), least_buckets, most_buckets);
}

float as_float(double value) {
  const auto narrow = static_cast<float>(value);
  return std::isfinite(narrow) ? narrow : missing;
}

// Collects the rows of one pixel for thinned().
class Pixel {
 public:
  explicit Pixel(std::size_t columns)
      : least_(columns), greatest_(columns), at_least_(columns), at_greatest_(columns) {}

  bool empty() const { return parts_ == 0; }

  template <class Extremes>
  void add(double first, double last, const Extremes& of_column) {
    if (empty()) {
      first_ = first;
      std::fill(least_.begin(), least_.end(), missing);
      std::fill(greatest_.begin(), greatest_.end(), missing);
      std::fill(at_least_.begin(), at_least_.end(), 0);
      std::fill(at_greatest_.begin(), at_greatest_.end(), 0);
    }
    last_ = last;
    for (std::size_t c = 0; c < least_.size(); ++c) {
      const auto& [least, greatest] = of_column(c);
      if (!(least_[c] <= least) && !std::isnan(least)) {
        least_[c] = least;
        at_least_[c] = parts_;
      }
      if (!(greatest_[c] >= greatest) && !std::isnan(greatest)) {
        greatest_[c] = greatest;
        at_greatest_[c] = parts_;
      }
    }
    ++parts_;
  }

  void flush(std::span<const History::Wanted> wanted, Rows& rows) {
    if (empty()) return;
    const bool one = parts_ == 1 && first_ == last_;
    rows.t.push_back(first_);
    if (!one) rows.t.push_back(last_);
    for (std::size_t c = 0; c < wanted.size(); ++c) {
      double before = least_[c], after = greatest_[c];
      if (wanted[c].keep == Keep::least) after = before;
      if (wanted[c].keep == Keep::greatest) before = after;
      if (at_greatest_[c] < at_least_[c]) std::swap(before, after);
      rows.values[c].push_back(before);
      if (!one) rows.values[c].push_back(after);
    }
    parts_ = 0;
  }

 private:
  std::vector<float> least_, greatest_;
  std::vector<std::size_t> at_least_, at_greatest_;
  std::size_t parts_ = 0;
  double first_ = 0.0, last_ = 0.0;
};

}  // namespace

History::History(std::size_t columns, std::size_t memory)
    : columns_(columns),
      capacity_(buckets_for(columns, memory)),
      levels_(view::levels),
      row_(columns) {
  for (Level& level : levels_) {
    level.first.resize(capacity_);
    level.last.resize(capacity_);
    level.values.resize(capacity_ * columns_);
    level.open.resize(columns_);
  }
}

void History::clear() {
  for (Level& level : levels_) level.begin = level.size = level.open_parts = 0;
  rows_ = 0;
  last_t_ = -std::numeric_limits<double>::infinity();
}

double History::first_t() const {
  double first = last_t_;
  for (const Level& level : levels_) {
    if (level.size > 0) first = std::min(first, level.first[level.begin]);
  }
  return first;
}

bool History::add(double t, std::span<const double> values) {
  if (!(t > last_t_) || values.size() != columns_) return false;
  for (std::size_t c = 0; c < columns_; ++c) row_[c] = {as_float(values[c]), as_float(values[c])};
  last_t_ = t;
  ++rows_;
  push(0, t, t, row_);
  return true;
}

void History::push(std::size_t to, double first, double last, std::span<const Extremes> values) {
  Level& level = levels_[to];
  if (level.size == capacity_) {
    level.begin = slot(level, 1);
    --level.size;
  }
  const std::size_t at = slot(level, level.size++);
  level.first[at] = first;
  level.last[at] = last;
  std::copy(values.begin(), values.end(),
            level.values.begin() + static_cast<std::ptrdiff_t>(at * columns_));
  if (to + 1 == levels_.size()) return;

  Level& next = levels_[to + 1];
  if (next.open_parts == 0) {
    next.open_first = first;
    std::copy(values.begin(), values.end(), next.open.begin());
  } else {
    for (std::size_t c = 0; c < columns_; ++c) {
      next.open[c].least = std::fmin(next.open[c].least, values[c].least);
      next.open[c].greatest = std::fmax(next.open[c].greatest, values[c].greatest);
    }
  }
  if (++next.open_parts < ratio) return;
  next.open_parts = 0;
  push(to + 1, next.open_first, last, next.open);
}

Rows History::thinned(const Window& window, std::span<const Wanted> wanted) const {
  Rows rows;
  rows.values.resize(wanted.size());
  if (empty() || !(window.from < window.to) || window.pixels < 1) return rows;
  const double width = (window.to - window.from) / window.pixels;
  const auto pixel_of = [&](double t) {
    return std::clamp(std::floor((t - window.from) / width), -1.0, double(window.pixels));
  };
  // The finest level that reaches back to `from`, or the level that reaches back furthest. Rows of
  // its unfinished bucket are in the finer levels.
  std::size_t from_level = 0;
  const auto oldest = [](const Level& level) { return level.first[level.begin]; };
  for (std::size_t l = 1; l < levels_.size() && levels_[l].size > 0; ++l) {
    if (oldest(levels_[from_level]) <= window.from) break;
    if (oldest(levels_[l]) < oldest(levels_[from_level])) from_level = l;
  }
  Pixel pixel(wanted.size());
  double here = -2.0;
  double done =
      -std::numeric_limits<double>::infinity();  // end of the part taken from coarser levels
  for (std::size_t l = from_level + 1; l-- > 0;) {
    const Level& level = levels_[l];
    // The first bucket that ends after `from` and after `done`, and the bucket before it.
    std::size_t i = 0, end = level.size;
    const double limit = std::max(done, window.from);
    while (i < end) {
      const std::size_t middle = (i + end) / 2;
      if (level.last[slot(level, middle)] <= limit) {
        i = middle + 1;
      } else {
        end = middle;
      }
    }
    if (i > 0 && level.last[slot(level, i - 1)] > done) --i;
    for (; i < level.size; ++i) {
      const std::size_t at = slot(level, i);
      const double of = pixel_of(level.first[at]);
      if (of != here) pixel.flush(wanted, rows);
      here = of;
      pixel.add(level.first[at], level.last[at],
                [&](std::size_t c) { return level.values[at * columns_ + wanted[c].column]; });
      done = level.last[at];
      if (level.first[at] > window.to) break;
    }
    if (done > window.to) break;
  }
  pixel.flush(wanted, rows);
  return rows;
}

}  // namespace sprag::view
