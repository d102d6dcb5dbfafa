#include "tools/tolerance/modes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/analysis/wrapped_text.h"
#include "sprag/detail/files/csv.h"
#include "tools/tolerance/words.h"

namespace sprag::tolerance {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr std::array some = {1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 30, 40, 50, 60};

std::vector<int> numbers_of_modes(int all) {
  std::vector<int> numbers;
  for (const int n : some)
    if (n < all) numbers.push_back(n);
  numbers.push_back(all);
  return numbers;
}

// Error of one estimator whose model is `part`.
double observed_error(EstimatorKind kind, const Scene& scene, const ModalMachine& whole,
                      const ModalMachine& part, const std::vector<ContactEvent>& events,
                      const study::Truth& truth) try {
  const Scene given = reduced_scene(scene, part);
  TrackingEstimator estimator(given, truth.tick, kind);
  const Eigen::Index f = given.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  double squares = 0.0;
  Eigen::Index count = 0;
  study::pursue(estimator, given.prior.start, events, truth,
                [&](Eigen::Index k, const TrackingEstimator::State& state) {
                  if (2 * k <= truth.q.cols()) return;
                  estimator.output(state, q, u);
                  squares += (part.observed * q - whole.observed * truth.q.col(k)).squaredNorm();
                  count += whole.observed.rows();
                });
  const double error = std::sqrt(squares / static_cast<double>(count));
  return std::isfinite(error) ? error : infinite;
} catch (const ModelError&) {
  return infinite;
}

// Result of one run with one number of modes.
struct Outcome {
  std::vector<double> plain, corrected;  // by estimator
  std::string correction;
  Eigen::Index coordinates = 0;
};

Outcome outcome_of(const Bench& bench, const ModalMachine& whole, int modes, int run) {
  const study::Truth& truth = bench.truth(run);
  const std::vector<ContactEvent> events =
      bench.arrived({.jitter = bench.scene().prior.jitter}, run);
  std::vector<Eigen::Index> kept = by_frequency(whole);
  const bool all = modes == static_cast<int>(kept.size());
  kept.resize(static_cast<std::size_t>(modes));
  Outcome outcome;
  const auto errors = [&](const ModalMachine& part) {
    std::vector<double> values;
    for (const EstimatorKind kind : bench.settings().estimators)
      values.push_back(observed_error(kind, bench.scene(), whole, part, events, truth));
    return values;
  };
  outcome.plain = errors(reduced(whole, kept));
  if (all) return outcome;
  std::vector<Reduction> tried;
  try {
    tried = reductions(whole, kept, second_half(events));
  } catch (const std::runtime_error&) {
    // Too few closings to choose a correction.
  }
  if (tried.empty()) return outcome;
  const Reduction& best = tried.front();
  outcome.corrected = errors(best.machine);
  outcome.correction = best.correction;
  outcome.coordinates = best.machine.model.coordinates();
  return outcome;
}

const char* observed_name(const Bench& bench) { return bench.scene().beam ? "tip" : "gaps"; }

}  // namespace

double observed_motion(const Bench& bench) {
  const ModalMachine whole = modal_machine(bench.scene());
  const study::Truth& truth = bench.truth(0);
  const Eigen::MatrixXd seen = whole.observed * truth.q.rightCols(truth.q.cols() / 2);
  return std::sqrt((seen.colwise() - seen.rowwise().mean()).array().square().mean());
}

std::vector<FewerModes> fewer_modes(const Bench& bench, int threads,
                                    const std::function<void(double done)>& progress) {
  const ModalMachine whole = modal_machine(bench.scene());
  const std::vector<int> numbers = numbers_of_modes(static_cast<int>(whole.model.coordinates()));
  const int runs = bench.settings().runs;
  const int count = runs * static_cast<int>(numbers.size());
  std::vector<Outcome> outcomes(static_cast<std::size_t>(count));
  std::mutex mutex;
  int done = 0;
  in_parallel(threads, count, [&](int i) {
    const int modes = numbers[static_cast<std::size_t>(i / runs)];
    outcomes[static_cast<std::size_t>(i)] = outcome_of(bench, whole, modes, i % runs);
    const std::lock_guard lock(mutex);
    progress(static_cast<double>(++done) / count);
  });

  std::vector<FewerModes> table;
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    const auto of_runs = std::span(outcomes).subspan(n * static_cast<std::size_t>(runs),
                                                     static_cast<std::size_t>(runs));
    const Outcome& first = of_runs.front();
    FewerModes row{numbers[n], {}, {}, first.correction, first.coordinates};
    for (std::size_t e = 0; e < bench.settings().estimators.size(); ++e) {
      std::vector<double> plain, corrected;
      for (const Outcome& outcome : of_runs) {
        plain.push_back(outcome.plain[e]);
        if (!first.corrected.empty())
          corrected.push_back(outcome.corrected.empty() ? infinite : outcome.corrected[e]);
      }
      row.plain.push_back(spread_of(plain));
      if (!corrected.empty()) row.corrected.push_back(spread_of(corrected));
    }
    table.push_back(std::move(row));
  }
  return table;
}

std::string to_text(const Bench& bench, const std::vector<FewerModes>& table) {
  const auto& estimators = bench.settings().estimators;
  const double motion = observed_motion(bench);
  std::string text = bench.scene().name + ": error of the " + observed_name(bench) +
                     ", root mean square [m]; the motion is " + short_number(motion) + "\n\n";
  std::vector<std::string> cells = {"modes"};
  for (const EstimatorKind kind : estimators) cells.emplace_back(study::name(kind));
  for (const EstimatorKind kind : estimators)
    cells.push_back(std::string(study::name(kind)) + " corrected");
  cells.emplace_back("correction");
  constexpr std::size_t first = 6, other = 18;
  add_line(cells, first, other, text);
  for (const FewerModes& row : table) {
    cells = {std::to_string(row.modes)};
    for (const Spread& error : row.plain) cells.push_back(short_number(error.median));
    for (std::size_t e = 0; e < estimators.size(); ++e)
      cells.push_back(row.corrected.empty() ? "-" : short_number(row.corrected[e].median));
    cells.push_back(row.correction.empty()
                        ? ""
                        : row.correction + ", " + std::to_string(row.coordinates) + " coordinates");
    add_line(cells, first, other, text);
  }
  text += '\n';
  append_wrapped(text,
                 "Median of " + std::to_string(bench.settings().runs) + " runs of " +
                     short_number(bench.duration()) +
                     " s, the second half of each. reduce EVENTS SCENE --modes n --output F.toml "
                     "writes the scene with the correction.");
  return text;
}

void write_json(const Bench& bench, const std::vector<FewerModes>& table,
                nlohmann::ordered_json& object) {
  const auto& estimators = bench.settings().estimators;
  object["scene"] = bench.scene().name;
  object["observed"] = observed_name(bench);
  object["motion"] = observed_motion(bench);
  object["duration"] = bench.duration();
  object["runs"] = bench.settings().runs;
  object["modes"] = nlohmann::ordered_json::array();
  for (const FewerModes& row : table) {
    nlohmann::ordered_json of = {{"modes", row.modes}};
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      of["plain"][study::name(estimators[e])] = to_json(row.plain[e]);
      if (!row.corrected.empty())
        of["corrected"][study::name(estimators[e])] = to_json(row.corrected[e]);
    }
    if (!row.corrected.empty()) {
      of["correction"] = row.correction;
      of["coordinates"] = row.coordinates;
    }
    object["modes"].push_back(std::move(of));
  }
}

std::string to_csv(const Bench& bench, const std::vector<FewerModes>& table) {
  const auto& estimators = bench.settings().estimators;
  std::string text = "modes,estimator,correction,coordinates,median,low,high\n";
  const auto add = [&](const FewerModes& row, std::size_t e, std::string correction,
                       Eigen::Index coordinates, const Spread& error) {
    std::replace(correction.begin(), correction.end(), ',', ';');
    text += std::to_string(row.modes) + ',' + study::name(estimators[e]) + ',' + correction + ',' +
            std::to_string(coordinates);
    append_spread(error, text);
    text += '\n';
  };
  for (const FewerModes& row : table) {
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      add(row, e, "none", row.modes, row.plain[e]);
      if (!row.corrected.empty()) add(row, e, row.correction, row.coordinates, row.corrected[e]);
    }
  }
  return text;
}

}  // namespace sprag::tolerance
