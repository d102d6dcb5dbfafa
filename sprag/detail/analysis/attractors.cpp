#include "sprag/detail/analysis/attractors.h"

#include <algorithm>
#include <cmath>

namespace sprag {

std::vector<int> label_attractors(std::span<const int> periods,
                                  const Eigen::Ref<const Simulation::Rows>& points,
                                  double tolerance) {
  const Eigen::Index f = points.cols() / 2;
  std::vector<Eigen::Index> order;
  double largest_q = 0.0;
  double largest_u = 0.0;
  const auto period = [&](Eigen::Index i) { return periods[static_cast<std::size_t>(i)]; };
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (period(i) == 0) continue;
    order.push_back(i);
    largest_q = std::max(largest_q, points.row(i).head(f).cwiseAbs().maxCoeff());
    largest_u = std::max(largest_u, points.row(i).tail(f).cwiseAbs().maxCoeff());
  }
  const double zero = 1e-9 * std::max(largest_q, largest_u);
  const double same_q = std::max(tolerance * largest_q, zero);
  const double same_u = std::max(tolerance * largest_u, zero);
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    if (period(a) != period(b)) return period(a) < period(b);
    const auto x = points.row(a);
    const auto y = points.row(b);
    return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
  });
  const auto equal = [&](Eigen::Index a, Eigen::Index b) {
    const auto difference = (points.row(a) - points.row(b)).cwiseAbs();
    return period(a) == period(b) && difference.head(f).maxCoeff() <= same_q &&
           difference.tail(f).maxCoeff() <= same_u;
  };
  std::vector<Eigen::Index> firsts;
  std::vector<std::size_t> which(periods.size(), 0);
  for (const Eigen::Index i : order) {
    const auto known = std::find_if(firsts.begin(), firsts.end(),
                                    [&](Eigen::Index first) { return equal(i, first); });
    which[static_cast<std::size_t>(i)] = static_cast<std::size_t>(known - firsts.begin());
    if (known == firsts.end()) firsts.push_back(i);
  }
  // Differences within the tolerance do not determine the order.
  const auto before = [&](Eigen::Index a, Eigen::Index b) {
    if (period(a) != period(b)) return period(a) < period(b);
    for (Eigen::Index j = 0; j < 2 * f; ++j) {
      const double difference = points(a, j) - points(b, j);
      if (std::abs(difference) > (j < f ? same_q : same_u)) return difference < 0.0;
    }
    return false;
  };
  // Insertion sort, since closeness is not transitive and std::sort requires a strict weak order.
  std::vector<std::size_t> sorted;
  for (std::size_t k = 0; k < firsts.size(); ++k) {
    auto place = sorted.end();
    while (place != sorted.begin() && before(firsts[k], firsts[*std::prev(place)])) --place;
    sorted.insert(place, k);
  }
  std::vector<int> label_of(firsts.size());
  for (std::size_t k = 0; k < sorted.size(); ++k) label_of[sorted[k]] = static_cast<int>(k) + 1;
  std::vector<int> labels(periods.size(), 0);
  for (const Eigen::Index i : order) {
    const auto place = static_cast<std::size_t>(i);
    labels[place] = label_of[which[place]];
  }
  return labels;
}

}  // namespace sprag
