#include "studies/adaptation/table.h"

#include <algorithm>
#include <cstdio>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene_file.h"
#include "studies/adaptation/bound.h"
#include "studies/adaptation/trial.h"

namespace sprag::adaptation_study {
namespace {

struct Row {
  const char* name;
  const char* scene;
  Trial trial;
};

std::vector<Row> rows() {
  const std::vector<Move> moves{{"impact.restitution", -0.1}, {"beam.bending_stiffness", 0.02}};
  return {
      {"exact times", "paper_beam.toml", {}},
      {"jitter 1e-4", "paper_beam.toml", {.jitter = 1e-4}},
      {"jitter 1e-3", "paper_beam.toml", {.jitter = 1e-3}},
      {"jitter 1e-4, they move",
       "paper_beam.toml",
       {.jitter = 1e-4, .walk = 1e-3, .moves = moves, .duration = 100.0}},
      {"jitter 1e-4, 2 % lost", "paper_beam.toml", {.lost = 0.02, .jitter = 1e-4}},
      {"jitter 1e-4, 2 % spurious", "paper_beam.toml", {.spurious = 0.02, .jitter = 1e-4}},
      {"two_stops_beam, exact times", "two_stops_beam.toml", {}},
  };
}

}  // namespace

void print_table(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs) {
  for (Row row : rows()) {
    const Scene scene = read_scene(scenes / row.scene);
    std::vector<double> floors, of_replica, worse, accepted, seconds;
    std::int64_t inconsistencies = 0;
    for (int i = 0; i < runs; ++i) {
      const Outcome outcome = run(scene, row.trial, first_seed + static_cast<std::uint64_t>(i));
      const double half = 0.5 * row.trial.duration;
      floors.push_back(outcome.floor(half));
      of_replica.push_back(outcome.floor(half, &Tick::V_replica));
      worse.push_back(outcome.worse_than_replica(10.0));
      seconds.push_back(outcome.longest_identification);
      if (!outcome.accepted.empty()) accepted.push_back(outcome.accepted.front());
      inconsistencies += outcome.inconsistencies;
    }
    std::printf("| %s | %zu/%d, %.1f | %.1e, %.1e | %.1e | %.2f %% | %.1f | %.2f |\n", row.name,
                accepted.size(), runs, median(accepted), median(floors),
                *std::max_element(floors.begin(), floors.end()), median(of_replica),
                100.0 * *std::max_element(worse.begin(), worse.end()),
                static_cast<double>(inconsistencies) / runs,
                *std::max_element(seconds.begin(), seconds.end()));
    std::fflush(stdout);
  }
}

void print_single(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs) {
  const Scene scene = read_scene(scenes / "paper_beam.toml");
  std::vector<std::string> keys;
  for (const Unknown& unknown : unknowns_of(scene)) keys.push_back(unknown.key);
  keys.emplace_back();
  for (const std::string& key : keys) {
    for (const double off : {0.1, 0.2}) {
      const Trial trial{.off = off, .only = key, .jitter = 1e-4};
      std::vector<double> replica, both, adaptive;
      for (int i = 0; i < runs; ++i) {
        const Outcome outcome = run(scene, trial, first_seed + static_cast<std::uint64_t>(i));
        const double half = 0.5 * trial.duration;
        replica.push_back(outcome.floor(half, &Tick::V_replica));
        both.push_back(outcome.floor(half, &Tick::V_both));
        adaptive.push_back(outcome.floor(half));
      }
      std::printf("| %s | %g | %.1e | %.1e | %.1e |\n",
                  key.empty() ? "all but the amplitude" : key.c_str(), off, median(replica),
                  median(both), median(adaptive));
      std::fflush(stdout);
    }
  }
}

void print_bound(const std::filesystem::path& scenes, std::uint64_t first_seed, int runs) {
  const Scene scene = read_scene(scenes / "paper_beam.toml");
  const Trial trial{.jitter = 1e-4, .duration = 100.0};
  std::vector<Outcome> outcomes;
  for (int i = 0; i < runs; ++i) {
    outcomes.push_back(run(scene, trial, first_seed + static_cast<std::uint64_t>(i)));
  }
  for (const int impacts : {25, 30, 40, 60, 80, 100, 140}) {
    double t = 0.0;
    std::vector<double> V;
    for (const Outcome& outcome : outcomes) {
      t = outcome.events[static_cast<std::size_t>(impacts - 1)];
      const auto tick = std::find_if(outcome.ticks.begin(), outcome.ticks.end(),
                                     [&](const Tick& of) { return of.t > t + 6.0 * trial.jitter; });
      V.push_back(tick->V);
    }
    std::printf(
        "| %d | %.1f | %.1e | %.1e | %.1e |\n", impacts, t, least_V(scene, impacts, trial.jitter),
        std::accumulate(V.begin(), V.end(), 0.0) / static_cast<double>(V.size()), median(V));
    std::fflush(stdout);
  }
}

void print_chart(const std::filesystem::path& scenes, std::uint64_t seed) {
  std::printf("trial,t,adaptive,replica,both\n");
  for (const Row& row : rows()) {
    if (row.trial.lost + row.trial.spurious > 0.0 ||
        row.scene != std::string_view("paper_beam.toml")) {
      continue;
    }
    const Outcome outcome = run(read_scene(scenes / row.scene), row.trial, seed);
    // The median of each half unit of time. Around a jittered event V is briefly that of two
    // machines on either side of an impact.
    constexpr std::size_t shown = 50;
    const auto& ticks = outcome.ticks;
    for (std::size_t k = 0; k + shown <= ticks.size(); k += shown) {
      const std::span<const Tick> of(&ticks[k], shown);
      const auto usual = [of](double Tick::*V) {
        std::vector<double> values;
        for (const Tick& tick : of) values.push_back(tick.*V);
        return median(values);
      };
      std::printf("\"%s\",%.9g,%.4e,%.4e,%.4e\n", row.name, of.back().t, usual(&Tick::V),
                  usual(&Tick::V_replica), usual(&Tick::V_both));
    }
  }
}

}  // namespace sprag::adaptation_study
