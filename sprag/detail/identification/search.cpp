#include "sprag/detail/identification/search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// Steps of the grid, in coordinates of the unknowns: the largest from which a refinement between
// two points converges to the nearer minimum (measured on the paper's beam with 22 impacts).
constexpr double widest_of_stiffness = 0.05, widest_of_position = 0.04;
// [rad]: phase that a step of the stiffness changes in a usual flight.
constexpr double turn_of_fastest = 2.0;
constexpr double part_of_wave = 0.31;  // of the shortest wave: step of a position
// [rad]: phase that a step of a frequency changes at the last impact.
constexpr double step_of_phase = 0.8;
// [rad] of a record's mean frequency. A record also has faster content.
constexpr double step_of_delay = 0.4;
constexpr double most_points = 30000.0;
constexpr std::size_t kept = 6;
constexpr double growth = 1.5;

struct Axis {
  std::size_t unknown = 0;
  double step = 0.0;
  int to_low = 0, to_high = 0;  // points to either side of the nominal one
};

double step_of_stiffness(const MachineFamily& family, double interval) {
  const Machine machine = family.at(family.nominal());
  double fastest = 0.0;
  for (Eigen::Index i = 0; i < machine.n(); ++i) {
    const Eigen::Index column = machine.modal ? 0 : i;
    // A mode that decays within a flight does not determine its phase.
    constexpr double gone = 3.0;
    if (0.5 * machine.C(i, column) * interval > gone) continue;
    fastest = std::max(fastest, std::sqrt(std::max(machine.K(i, column), 0.0)));
  }
  return std::min(widest_of_stiffness,
                  turn_of_fastest / std::max(fastest * interval, turn_of_fastest));
}

double step_of_position(const MachineFamily& family) {
  return std::min(widest_of_position, part_of_wave / wavenumber(family.scene().beam->modes));
}

// Largest frequency of the harmonics that the unknown changes.
double fastest_of(const MachineFamily& family, const Unknown& unknown) {
  double fastest = 0.0;
  for (std::size_t g = 0; g < family.groups().size(); ++g) {
    if (unknown.index >= 0 && unknown.index != static_cast<int>(g)) continue;
    fastest = std::max(fastest, family.groups()[g].frequency);
  }
  return fastest;
}

// A rate changes all harmonics and the stiffness, by its square.
double step_of_clock_rate(const MachineFamily& family, double duration, double interval) {
  double step = 0.5 * step_of_stiffness(family, interval);
  for (const HarmonicGroup& group : family.groups()) {
    step = std::min(step, step_of_phase / (group.frequency * duration));
  }
  return step;
}

std::vector<Axis> axes_of(const MachineFamily& family, double duration, double interval,
                          double refinement) {
  std::vector<Axis> axes;
  const std::vector<Unknown>& unknowns = family.unknowns();
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const Unknown& unknown = unknowns[k];
    Axis axis{.unknown = k};
    if (unknown.kind == Kind::stiffness || unknown.kind == Kind::stiffness_entry) {
      axis.step = step_of_stiffness(family, interval);
    } else if (unknown.kind == Kind::position) {
      axis.step = step_of_position(family);
    } else if (unknown.kind == Kind::frequency) {
      axis.step = step_of_phase / (fastest_of(family, unknown) * duration);
    } else if (unknown.kind == Kind::clock_rate) {
      axis.step = step_of_clock_rate(family, duration, interval);
    } else if (unknown.kind == Kind::clock_offset) {
      axis.step = step_of_phase / (fastest_of(family, unknown) * unknown.unit_step);
    } else if (unknown.kind == Kind::delay) {
      axis.step = step_of_delay;
    } else {
      continue;
    }
    axis.step *= refinement;
    // The nominal value may differ by `within` of the true one, in either direction.
    const bool is_time = unknown.kind == Kind::clock_offset || unknown.kind == Kind::delay;
    const double radius =
        is_time ? unknown.highest() : -std::log1p(-std::min(unknown.within, 0.9)) + 0.3 * axis.step;
    axis.to_low = static_cast<int>(std::ceil(std::min(radius, -unknown.lowest()) / axis.step));
    axis.to_high = static_cast<int>(std::ceil(std::min(radius, unknown.highest()) / axis.step));
    axes.push_back(axis);
  }
  // Frequencies vary fastest, so results that do not depend on them are computed once for all.
  std::stable_partition(axes.begin(), axes.end(), [&](const Axis& axis) {
    return unknowns[axis.unknown].kind != Kind::frequency;
  });
  double points = 1.0;
  for (const Axis& axis : axes) points *= axis.to_low + axis.to_high + 1;
  if (points > most_points) {
    const double wider = std::pow(points / most_points, 1.0 / static_cast<double>(axes.size()));
    for (Axis& axis : axes) {
      axis.step *= wider;
      axis.to_low = static_cast<int>(std::ceil(axis.to_low / wider));
      axis.to_high = static_cast<int>(std::ceil(axis.to_high / wider));
    }
  }
  return axes;
}

struct GridPoint {
  std::vector<int> at;  // steps from the nominal point
  PathFit fit;
  double score = 0.0;
};

bool near(const GridPoint& a, const GridPoint& b) {
  for (std::size_t i = 0; i < a.at.size(); ++i) {
    if (std::abs(a.at[i] - b.at[i]) >= 2) return false;
  }
  return true;
}

// Keeps the best points that are at least two steps apart.
void keep(GridPoint point, std::vector<GridPoint>& best) {
  if (!std::isfinite(point.score)) return;
  for (GridPoint& other : best) {
    if (near(point, other) && other.score <= point.score) return;
  }
  std::erase_if(best, [&](const GridPoint& other) { return near(point, other); });
  const auto later =
      std::upper_bound(best.begin(), best.end(), point.score,
                       [](double score, const GridPoint& other) { return score < other.score; });
  best.insert(later, std::move(point));
  if (best.size() > kept) best.pop_back();
}

std::vector<GridPoint> best_of_grid(const MachineFamily& family, Projection& projection,
                                    const std::vector<Axis>& axes) {
  constexpr double penalty = 3.0;  // of impacts with an opening gap
  std::vector<GridPoint> best;
  GridPoint point{std::vector<int>(axes.size()), {}, 0.0};
  for (std::size_t i = 0; i < axes.size(); ++i) point.at[i] = -axes[i].to_low;
  Eigen::VectorXd values = family.nominal();
  while (true) {
    check_interrupt();
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const Unknown& unknown = family.unknowns()[axes[i].unknown];
      values[static_cast<Eigen::Index>(axes[i].unknown)] = unknown.value(
          std::clamp(axes[i].step * point.at[i], unknown.lowest(), unknown.highest()));
    }
    PathFit fit = projection.at(values);
    const double score = fit.rms * (1.0 + penalty * fit.inside);
    if (best.size() < kept || score < best.back().score) keep({point.at, fit, score}, best);
    std::size_t i = axes.size();
    while (i > 0 && point.at[i - 1] == axes[i - 1].to_high) {
      point.at[i - 1] = -axes[i - 1].to_low;
      --i;
    }
    if (i == 0) break;
    ++point.at[i - 1];
  }
  return best;
}

double duration_of(const Stretches& stretches) {
  return stretches.back().impacts.back().t - stretches.front().start;
}

// Refines on windows that grow from `size` impacts at `first` to all impacts.
PathFit grow(Projection& projection, const Stretches& all, std::size_t first, std::size_t size,
             PathFit fit, std::size_t fewest) {
  constexpr int steps = 12, last_steps = 40;
  const std::size_t total = count(all);
  while (size < total) {
    const auto next = static_cast<std::size_t>(std::ceil(growth * static_cast<double>(size)));
    // Grow forward to the end, then backward.
    const std::size_t end = std::min(total, first + next);
    first = end > next ? end - next : 0;
    size = end - first;
    Stretches window = part(all, first, size);
    std::erase_if(window, [&](const Stretch& stretch) { return stretch.equations() < fewest; });
    projection.take(std::move(window));
    fit = projection.refine(fit, size == total ? last_steps : steps);
  }
  return fit;
}

}  // namespace

namespace {

std::size_t unknowns_in_all(const MachineFamily& family, const Projection& projection) {
  return 2 * static_cast<std::size_t>(family.n()) +
         static_cast<std::size_t>(projection.free_inputs()) + projection.nonlinear().size();
}

}  // namespace

std::size_t first_window(const MachineFamily& family, const Projection& projection) {
  const auto n = static_cast<std::size_t>(family.n());
  return std::max(6 * n + 4, unknowns_in_all(family, projection) + 8);
}

std::size_t least_window(const MachineFamily& family, const Projection& projection) {
  return unknowns_in_all(family, projection) + 4;
}

namespace {

constexpr int first_steps = 25;
constexpr double finer = 0.5;  // step of the last resort's grid, in usual steps

// `apart`: in coordinates of the unknowns.
bool same_place(const MachineFamily& family, const PathFit& a, const PathFit& b, double apart) {
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const Unknown& unknown = family.unknowns()[k];
    const auto i = static_cast<Eigen::Index>(k);
    if (unknown.linear()) continue;
    if (std::abs(unknown.coordinate(a.values[i]) - unknown.coordinate(b.values[i])) > apart) {
      return false;
    }
  }
  return true;
}

std::size_t first_of_longest(const Stretches& stretches) {
  std::size_t at = 0, first = 0, longest = 0;
  for (const Stretch& stretch : stretches) {
    if (stretch.size() > longest) {
      longest = stretch.size();
      first = at;
    }
    at += stretch.size();
  }
  return first;
}

std::vector<std::size_t> hits(const Stretches& stretches, int contacts) {
  std::vector<std::size_t> hits(static_cast<std::size_t>(contacts));
  for (const Stretch& stretch : stretches) {
    for (const Impact& impact : stretch.impacts) ++hits[static_cast<std::size_t>(impact.contact)];
  }
  return hits;
}

// Number of impacts from `first` on that include every contact that is hit at all. A window without
// one of them could not determine it.
std::size_t with_all_contacts(const MachineFamily& family, const Stretches& all, std::size_t first,
                              std::size_t size) {
  constexpr std::size_t enough = 4;
  const std::vector<std::size_t> wanted = hits(all, family.contacts());
  const std::size_t total = count(all);
  while (first + size < total) {
    const std::vector<std::size_t> of = hits(part(all, first, size), family.contacts());
    bool enough_of_all = true;
    for (std::size_t i = 0; i < of.size(); ++i) {
      if (of[i] < std::min(enough, wanted[i])) enough_of_all = false;
    }
    if (enough_of_all) break;
    ++size;
  }
  return size;
}

// For a single unknown: adds starting values over all of its range. On an orbit with one impact a
// period there are many minima, and the deepest need not be near the grid's best point.
void add_starts_along(const MachineFamily& family, Projection& projection, const Axis& axis,
                      std::vector<PathFit>& starts) {
  constexpr int most = 32;
  const int stride = (axis.to_low + axis.to_high) / most + 1;
  const Unknown& unknown = family.unknowns()[axis.unknown];
  for (int i = -axis.to_low; i <= axis.to_high; i += stride) {
    PathFit start;
    start.values = family.nominal();
    start.values[static_cast<Eigen::Index>(axis.unknown)] =
        unknown.value(std::clamp(axis.step * i, unknown.lowest(), unknown.highest()));
    starts.push_back(projection.refine(start, first_steps));
  }
}

// The best points of the grid, refined, the best first, without duplicates; as a last resort other
// points too.
std::vector<PathFit> refined_starts(const MachineFamily& family, Projection& projection,
                                    const Stretches& window, bool last_resort) {
  projection.take(window);
  const std::vector<Axis> axes =
      axes_of(family, duration_of(window), usual_interval(window), last_resort ? finer : 1.0);
  std::vector<PathFit> starts;
  for (const GridPoint& point : best_of_grid(family, projection, axes)) {
    starts.push_back(projection.refine(point.fit, first_steps));
  }
  if (last_resort && axes.size() == 1) {
    add_starts_along(family, projection, axes.front(), starts);
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const PathFit& a, const PathFit& b) { return a.score() < b.score(); });
  constexpr double apart = 1e-3;
  std::vector<PathFit> places;
  for (PathFit& start : starts) {
    const bool is_new = std::none_of(places.begin(), places.end(), [&](const PathFit& place) {
      return same_place(family, start, place, apart);
    });
    if (is_new) places.push_back(std::move(start));
  }
  return places;
}

}  // namespace

PathFit search_window(const MachineFamily& family, const Stretches& window) {
  Projection projection(family);
  std::vector<PathFit> starts = refined_starts(family, projection, window, false);
  return starts.empty() ? PathFit{} : std::move(starts.front());
}

PathFit search(const MachineFamily& family, const Stretches& stretches,
               const SearchSettings& settings) {
  constexpr std::size_t followed = 3;  // number of refined points to continue
  constexpr double most_inside = 0.1;  // of the impacts
  constexpr double apart = 0.01;       // distance in coordinates to another minimum
  Projection projection(family);
  const std::size_t total = count(stretches);
  const auto fewest = static_cast<std::size_t>(2 * family.n() + 1);
  const std::size_t n = std::min(total, first_window(family, projection));
  PathFit best;
  best.rms = std::numeric_limits<double>::infinity();
  bool found = false;
  std::vector<PathFit> tried;
  constexpr std::size_t most_tried = 4;
  // Whether a new minimum is a solution. A path with many impacts at an opening gap is none.
  const auto solves = [&](const PathFit& fit) {
    if (!(fit.score() <= settings.good) || fit.inside > most_inside) return false;
    if (tried.size() >= most_tried && !found) return false;
    const auto same = [&](const PathFit& other) { return same_place(family, fit, other, apart); };
    if (std::any_of(tried.begin(), tried.end(), same)) return false;
    tried.push_back(fit);
    return settings.is_solution(fit);
  };
  struct Window {
    std::size_t first, size;
    bool last_resort;
  };
  std::vector<Window> windows;
  // A long stretch has fewer unknown starts for its number of impacts, so it comes first.
  const std::size_t longest = first_of_longest(stretches);
  for (const std::size_t first : {longest, longest + n / 2, longest + n, longest + 2 * n,
                                  longest + 3 * n, std::size_t{0}, n / 2}) {
    const bool is_there = std::any_of(windows.begin(), windows.end(),
                                      [&](const Window& window) { return window.first == first; });
    if (first + n <= total && !is_there) windows.push_back({first, n, false});
  }
  // As a last resort, also the record's beginning, which may contain a transient: a periodic orbit
  // alone may fit several machines.
  const std::size_t wide = std::min(total, n * 7 / 5);
  const std::size_t at_longest = std::min(longest, total - wide);
  windows.push_back({at_longest, wide, true});
  if (at_longest != 0) windows.push_back({0, wide, true});
  for (Window& window : windows) {
    window.size = with_all_contacts(family, stretches, window.first, window.size);
    Stretches first = part(stretches, window.first, window.size);
    std::erase_if(first, [&](const Stretch& stretch) { return stretch.equations() < fewest; });
    if (first.empty()) continue;
    const std::vector<PathFit> starts =
        refined_starts(family, projection, first, window.last_resort);
    for (std::size_t i = 0; i < starts.size(); ++i) {
      // Another minimum as deep as the solution is visible on few impacts already.
      const bool promises = starts[i].score() <= settings.good;
      if (found ? !promises : i >= followed && !(window.last_resort && promises)) continue;
      PathFit fit = grow(projection, stretches, window.first, window.size, starts[i], fewest);
      const bool solution = solves(fit);
      if ((solution && !found) || (!found && fit.score() < best.score())) best = std::move(fit);
      found = found || solution;
    }
    if (found) break;
  }
  return best;
}

}  // namespace sprag
