// Time series with rising times, for plots of any window. Memory is constant, also over days. The
// last rows are kept as received; of older rows, the minimum and maximum over 4, 16, ... rows, so
// that no peak is lost.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace sprag::view {

/// Extremes of a column that a pixel keeps.
enum class Keep { both, least, greatest };

/// Rows with rising times, and a vector of values for each requested column; NaN: no value.
struct Rows {
  std::vector<double> t;
  std::vector<std::vector<double>> values;
};

struct Window {
  double from = 0.0, to = 0.0;
  int pixels = 1;
};

class History {
 public:
  /// For rows of `columns` values, in about `memory` bytes, which are all allocated here.
  History(std::size_t columns, std::size_t memory);

  /// Takes a row; NaN and infinite values count as missing. Returns false and takes nothing if t
  /// does not rise or the number of values differs from `columns`.
  bool add(double t, std::span<const double> values);

  void clear();

  bool empty() const { return rows_ == 0; }
  double last_t() const { return last_t_; }  ///< of the last row; -infinity before the first one
  double first_t() const;                    ///< of the oldest row that a level still covers

  struct Wanted {
    std::size_t column;
    Keep keep;
  };

  /// The rows from `from` to `to`, and a row on either side. Where several rows share one of the
  /// `pixels` equal intervals: two rows with the minimum and maximum of each column, or, as
  /// `wanted` specifies, one of the two twice.
  Rows thinned(const Window& window, std::span<const Wanted> wanted) const;

 private:
  struct Extremes {
    float least, greatest;
  };
  // A ring of the last buckets, each of 4^level rows; all columns of a bucket lie together.
  struct Level {
    std::vector<double> first, last;  // times
    std::vector<Extremes> values;
    std::size_t begin = 0, size = 0;
    // The bucket under construction.
    std::vector<Extremes> open;
    double open_first = 0.0;
    std::size_t open_parts = 0;
  };

  std::size_t slot(const Level& level, std::size_t i) const {
    return (level.begin + i) % capacity_;
  }
  void push(std::size_t level, double first, double last, std::span<const Extremes> values);

  std::size_t columns_;
  std::size_t capacity_;
  std::vector<Level> levels_;
  std::size_t rows_ = 0;
  double last_t_ = -std::numeric_limits<double>::infinity();
  std::vector<Extremes> row_;
};

}  // namespace sprag::view
