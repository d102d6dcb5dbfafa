#include "studies/identification/charts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/search.h"
#include "sprag/scene_file.h"
#include "studies/identification/trial.h"

namespace sprag::identification_study {
namespace {

std::ofstream opened(const std::filesystem::path& file) {
  std::ofstream out(file);
  if (!out) throw std::runtime_error("cannot write " + file.string());
  return out;
}

double worst_error(const MachineFamily& family, const Eigen::VectorXd& values,
                   const Eigen::VectorXd& truth) {
  if (values.size() != truth.size() || !values.allFinite()) return HUGE_VAL;
  double worst = 0.0;
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    worst = std::max(worst, std::abs(error_of(family.unknowns()[k], values[i], truth[i])));
  }
  return worst;
}

// The search without its grid: from the values of the scene on the first impacts, then on growing
// windows up to all impacts.
PathFit growing_windows(const MachineFamily& family, const Stretches& all) {
  Projection projection(family);
  std::size_t size = first_window(family, projection);
  projection.take(part(all, 0, size));
  PathFit fit = projection.refine(projection.at(family.nominal()), 25);
  while (size < count(all)) {
    size = std::min(count(all), size + size / 2);
    projection.take(part(all, 0, size));
    fit = projection.refine(fit, size == count(all) ? 40 : 12);
  }
  return fit;
}

// From the values of the scene on all impacts at once.
PathFit whole_record(const MachineFamily& family, const Stretches& all) {
  Projection projection(family);
  projection.take(all);
  return projection.refine(projection.at(family.nominal()), 100);
}

void write_basin(const Scene& scene, const std::filesystem::path& file, std::uint64_t first_seed) {
  constexpr int runs = 20;
  constexpr double found = 1e-6;
  std::ofstream out = opened(file);
  out << "off,runs,search,windows,whole\n";
  for (const double off : {0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6}) {
    int by_search = 0, by_windows = 0, by_whole = 0;
    double seconds = 0.0;
    for (int i = 0; i < runs; ++i) {
      const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(i);
      const Trial trial{.off = off};
      const Outcome outcome = run(scene, trial, seed);
      seconds += outcome.seconds;
      if (outcome.accepted() && outcome.worst < found) ++by_search;
      const std::optional<Question> asked = question(scene, trial, seed);
      const MachineFamily family(asked->nominal, asked->settings.unknowns);
      const Stretches all = cut(asked->events, {}, 2 * static_cast<std::size_t>(family.n()) + 2);
      const auto finds = [&](const PathFit& fit) {
        if (!fit.values.allFinite() || !std::isfinite(fit.rms)) return false;
        const Likelihood solution = maximize_likelihood(family, all, fit);
        return worst_error(family, solution.values, asked->truth) < found;
      };
      if (finds(growing_windows(family, all))) ++by_windows;
      if (finds(whole_record(family, all))) ++by_whole;
    }
    out << off << ',' << runs << ',' << by_search << ',' << by_windows << ',' << by_whole << '\n';
    std::printf("off %g: %d, %d, %d of %d; %.2f s a search\n", off, by_search, by_windows, by_whole,
                runs, seconds / runs);
    std::fflush(stdout);
  }
}

// Root mean square errors of the maximum of the likelihood, and of the least squares of gaps at the
// end of the search, relative to sigma of the Cramer-Rao bound at the truth.
void write_bound(const Scene& scene, const std::filesystem::path& file, std::uint64_t first_seed) {
  constexpr int runs = 40;
  std::ofstream out = opened(file);
  out << "jitter,runs,parameter,bound,likelihood,least_squares\n";
  Trial trial{.off = 0.05};
  const Eigen::MatrixXd unit = run(scene, trial, first_seed).found.likelihood.covariance;
  std::uint64_t next_seed = first_seed;
  for (const double jitter : {1e-7, 1e-6, 1e-5, 1e-4, 1e-3}) {
    trial.jitter = jitter;
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(unit.rows());
    Eigen::VectorXd squares_of_gaps = squares;
    int good = 0;
    std::vector<Unknown> unknowns;
    for (int i = 0; i < runs; ++i) {
      const std::uint64_t seed = next_seed++;
      const Outcome outcome = run(scene, trial, seed);
      if (!outcome.accepted()) continue;
      ++good;
      const std::optional<Question> asked = question(scene, trial, seed);
      unknowns = asked->settings.unknowns;
      const MachineFamily family(asked->nominal, unknowns);
      const PathFit of_gaps =
          search(family, outcome.found.measured,
                 {.good = 30.0 * jitter, .is_solution = [](const PathFit&) { return true; }});
      for (std::size_t k = 0; k < unknowns.size(); ++k) {
        const auto at = static_cast<Eigen::Index>(k);
        const double truth = asked->truth[at];
        const double error = error_of(unknowns[k], outcome.found.unknowns[k].value, truth);
        squares[at] += error * error;
        const double of_gap = error_of(unknowns[k], of_gaps.values[at], truth);
        squares_of_gaps[at] += of_gap * of_gap;
      }
    }
    for (std::size_t k = 0; k < unknowns.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      const double bound = jitter * std::sqrt(unit(at, at));
      out << jitter << ',' << good << ',' << unknowns[k].key << ',' << bound << ','
          << std::sqrt(squares[at] / good) << ',';
      // The search has no values of phases and clearances yet.
      if (!unknowns[k].linear()) out << std::sqrt(squares_of_gaps[at] / good);
      out << '\n';
    }
    std::printf("jitter %g: %d of %d accepted\n", jitter, good, runs);
    std::fflush(stdout);
  }
}

}  // namespace

void write_chart_data(const std::filesystem::path& scenes, const std::filesystem::path& directory,
                      std::uint64_t first_seed) {
  const Scene scene = read_scene(scenes / "paper_beam.toml");
  std::filesystem::create_directories(directory);
  write_bound(scene, directory / "bound.csv", first_seed);
  write_basin(scene, directory / "basin.csv", first_seed);
}

}  // namespace sprag::identification_study
