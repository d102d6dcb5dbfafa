#include "studies/identification/table.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

#include "sprag/detail/identification/drift.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene_file.h"
#include "studies/identification/drifting.h"
#include "studies/identification/trial.h"

namespace sprag::identification_study {
namespace {

struct Row {
  const char* name;
  const char* scene;
  Trial trial;
  int runs;
  int wanted;
  int modes = 0;  ///< of the beam, instead of the scene's 3; 0: those of the scene
};

Scene scene_of(const std::filesystem::path& file, int modes) {
  if (modes == 0) return read_scene(file);
  std::ifstream in(file);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const std::string three = "modes = 3";
  text.replace(text.find(three), three.size(), "modes = " + std::to_string(modes));
  // The start of its replica has three modes.
  return parse_scene(text.substr(0, text.find("[replica]")), file.string());
}

void run_row(const std::filesystem::path& scenes, const Row& row, std::uint64_t first_seed) {
  const Scene scene = scene_of(scenes / row.scene, row.modes);
  int right = 0, wrong = 0, inside = 0, values = 0;
  double slowest = 0.0, seconds = 0.0;
  std::vector<double> errors;
  for (int i = 0; i < row.runs; ++i) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(i);
    const Outcome outcome = run(scene, row.trial, seed);
    if (outcome.right(row.trial)) {
      ++right;
      errors.push_back(outcome.worst);
      inside += outcome.inside_95;
      values += outcome.values;
    } else {
      wrong += outcome.accepted() ? 1 : 0;
      std::fprintf(stderr, "%s: seed %llu: %s, worst %.2g (%.2g sigma), %d impacts\n", row.name,
                   static_cast<unsigned long long>(seed),
                   outcome.too_few      ? "too few"
                   : outcome.accepted() ? "accepted"
                                        : "refused",
                   outcome.worst, outcome.worst_sigmas, outcome.found.impacts);
    }
    slowest = std::max(slowest, outcome.seconds);
    seconds += outcome.seconds;
  }
  std::sort(errors.begin(), errors.end());
  std::string coverage = "-";
  if (row.trial.jitter > 0.0 && values > 0) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f %%", 100.0 * inside / values);
    coverage = text;
  }
  std::printf("| %s | %d/%d | %d/%d | %d | %.1e | %s | %.2f, %.2f |\n", row.name, row.wanted,
              row.runs, right, row.runs, wrong, errors.empty() ? 0.0 : errors[errors.size() / 2],
              coverage.c_str(), seconds / row.runs, slowest);
  std::fflush(stdout);
}

const Row rows[] = {
    {"10 %, exact times", "paper_beam.toml", {.off = 0.1}, 50, 49},
    {"20 %, exact times", "paper_beam.toml", {.off = 0.2}, 50, 49},
    {"10 %, jitter 1e-4", "paper_beam.toml", {.off = 0.1, .jitter = 1e-4}, 50, 49},
    {"20 %, jitter 1e-4", "paper_beam.toml", {.off = 0.2, .jitter = 1e-4}, 50, 49},
    {"20 %, jitter 1e-4, not given",
     "paper_beam.toml",
     {.off = 0.2, .jitter = 1e-4, .jitter_given = false},
     50,
     49},
    {"30 %, exact times", "paper_beam.toml", {.off = 0.3}, 50, 49},
    {"machine itself off by 20 %, exact times",
     "paper_beam.toml",
     {.off = 0.2, .machine_off = 0.2},
     49,
     47},
    {"machine itself off by 20 %, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.2, .machine_off = 0.2, .jitter = 1e-4},
     49,
     47},
    {"22 impacts, exact times", "paper_beam.toml", {.off = 0.2, .impacts = 22}, 25, 24},
    {"22 impacts, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.2, .impacts = 22, .jitter = 1e-4},
     25,
     24},
    {"5 % lost, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.2, .jitter = 1e-4, .lost = 0.05},
     12,
     11},
    {"5 % spurious, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.2, .jitter = 1e-4, .spurious = 0.05},
     12,
     11},
    {"5 % lost, exact times", "paper_beam.toml", {.off = 0.2, .lost = 0.05}, 12, 11},
    {"5 % spurious, exact times", "paper_beam.toml", {.off = 0.2, .spurious = 0.05}, 12, 11},
    {"2 % lost and 2 % spurious, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.2, .jitter = 1e-4, .lost = 0.02, .spurious = 0.02},
     12,
     11},
    {"damping off by up to 50 %, jitter 1e-4",
     "paper_beam.toml",
     {.off = 0.1, .damping_off = 0.5, .jitter = 1e-4},
     25,
     24},
    {"5 modes, 10 %, exact times", "paper_beam.toml", {.off = 0.1}, 15, 14, 5},
    {"5 modes, 10 %, jitter 1e-4", "paper_beam.toml", {.off = 0.1, .jitter = 1e-4}, 15, 14, 5},
    {"8 modes, 5 %, exact times", "paper_beam.toml", {.off = 0.05, .impacts = 250}, 6, 5, 8},
    {"12 modes, 3 %, exact times", "paper_beam.toml", {.off = 0.03, .impacts = 400}, 4, 3, 12},
    {"lab_rig, 10 %", "lab_rig.toml", {.off = 0.1}, 10, 10},
    {"two_stops_beam, 10 %", "two_stops_beam.toml", {.off = 0.1}, 10, 10},
    {"paper_beam_frame, 10 %", "paper_beam_frame.toml", {.off = 0.1}, 10, 10},
    {"paper_beam_chatter, 10 %", "paper_beam_chatter.toml", {.off = 0.1}, 10, 10},
    {"steel_ruler, 10 %", "steel_ruler.toml", {.off = 0.1}, 10, 10},
    {"non_proportional, 10 %", "non_proportional.toml", {.off = 0.1}, 10, 10},
    {"two_stops_beam, 10 %, jitter 1e-4",
     "two_stops_beam.toml",
     {.off = 0.1, .impacts = 400, .jitter = 1e-4},
     10,
     8},
    {"paper_beam_chatter, 10 %, jitter 1e-4",
     "paper_beam_chatter.toml",
     {.off = 0.1, .impacts = 400, .jitter = 1e-4},
     10,
     8},
    {"steel_ruler, 10 %, jitter 1e-5",
     "steel_ruler.toml",
     {.off = 0.1, .impacts = 400, .jitter = 1e-5},
     10,
     8},
};
// A simulated drift and its estimate; the jitter is not given.
void print_drifts(const std::filesystem::path& scenes, std::uint64_t first_seed) {
  constexpr int runs = 20;
  constexpr double jitter = 1e-4, end = 60.0, push = 0.05;
  std::printf(
      "\n| scene | drift | found | a fit too far off | least, median and most of found / drift | "
      "95 %% intervals cover |\n|---|---|---|---|---|---|\n");
  for (const char* name : {"paper_beam", "non_proportional"}) {
    const Scene scene = read_scene(scenes / (std::string(name) + ".toml"));
    IdentificationSettings settings;
    settings.unknowns = unknowns_named(scene, usual_keys(scene));
    for (Unknown& unknown : settings.unknowns) unknown.within = 0.05;
    settings.mend = false;
    for (const double drift : {0.0, 1e-9, 1e-8, 1e-7, 1e-6}) {
      int found = 0, far = 0, covered = 0;
      std::vector<double> ratios;
      for (int i = 0; i < runs; ++i) {
        const auto events = drifting_events(scene, drift, jitter, end, push,
                                            first_seed + static_cast<std::uint64_t>(i));
        const auto estimate = estimate_drift(scene, identify(scene, events, settings));
        if (!estimate) {
          ++far;
          continue;
        }
        if (estimate->low <= drift && drift <= estimate->high) ++covered;
        if (!estimate->found()) continue;
        ++found;
        ratios.push_back(estimate->drift / drift);
      }
      std::sort(ratios.begin(), ratios.end());
      std::printf("| %s | %.0e | %d/%d | %d | ", name, drift, found, runs, far);
      if (drift > 0.0 && !ratios.empty()) {
        std::printf("%.2f, %.2f, %.2f", ratios.front(), ratios[ratios.size() / 2], ratios.back());
      } else {
        std::printf("-");
      }
      std::printf(" | %d/%d |\n", covered, runs - far);
      std::fflush(stdout);
    }
  }
}

}  // namespace

void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed,
                 const std::string& only) {
  std::printf("seeds from %llu on\n\n", static_cast<unsigned long long>(first_seed));
  std::printf(
      "| trial | wanted | got | accepted though wrong | median of the worst error | 95 %% "
      "intervals cover | CPU [s], mean and most |\n|---|---|---|---|---|---|---|\n");
  for (const Row& row : rows) {
    if (only.empty() || std::string(row.name).find(only) != std::string::npos) {
      run_row(scenes, row, first_seed);
    }
  }
  if (only.empty() || only == "drift") print_drifts(scenes, first_seed);
}

}  // namespace sprag::identification_study
