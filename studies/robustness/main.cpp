// robustness: measures how the estimators bear disturbed events and wrong machines, and writes CSV
// files for scripts/robustness to draw.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "studies/robustness/machines.h"
#include "studies/robustness/tables.h"

int main(int argc, char** argv) {
  CLI::App app("Measures how the estimators bear disturbed events and wrong machines.",
               "robustness");
  std::filesystem::path folder;
  std::vector<std::string> only;
  sprag::robustness::Options options;
  app.add_option("FOLDER", folder, "Where the CSV files go")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--only", only, "These studies alone");
  app.add_option("--runs", options.runs, "Runs at each point, seeds 1, 2, ...")
      ->check(CLI::PositiveNumber);
  app.add_option("--duration", options.sampling.duration, "Length of a run [s, simulated]")
      ->check(CLI::PositiveNumber);
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  using namespace sprag::robustness;
  try {
    const sprag::Scene scene = read_paper_beam(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
    std::vector<Measured> all;
    std::fprintf(stderr, "seeds 1 to %d\n", options.runs);
    for (const Study& study : studies(scene)) {
      if (!only.empty() && std::find(only.begin(), only.end(), study.name) == only.end()) continue;
      const int runs = std::min(options.runs, study.most_runs);
      const int total = static_cast<int>(study.amounts.size()) * runs;
      int done = 0;
      const auto progress = [&] {
        if (++done % runs != 0) return;
        std::fprintf(stderr, "\r%-12s %d of %d runs", study.name.c_str(), done, total);
      };
      all.push_back({study, measure(study, scene, options, progress)});
      std::fputc('\n', stderr);
    }
    write_tables(folder, all);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "robustness: %s\n", error.what());
    return 1;
  }
  return 0;
}
