// calibration: compares the standard deviations that an estimator claims with its errors, on many
// machines, jitters and seeds.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "command_line/program.h"
#include "sprag/detail/files/output_file.h"
#include "studies/calibration/machines.h"
#include "studies/calibration/table.h"

namespace {

using namespace sprag::calibration;
using sprag::EstimatorKind;

struct Arguments {
  std::vector<std::string> scenes;
  std::vector<double> jitters{1e-6, 1e-5, 1e-4, 1e-3, 1e-2};
  std::vector<EstimatorKind> estimators{EstimatorKind::timing};
  Options options;
  bool json = false;
  std::filesystem::path csv;
};

void run(const Arguments& arguments) {
  sprag::OutputFile out = sprag::OutputFile::standard_output();
  std::optional<sprag::OutputFile> csv;
  if (!arguments.csv.empty()) csv.emplace(arguments.csv);
  if (csv) csv->write(csv_header());
  if (!arguments.json) out.write(table_header());
  std::fprintf(stderr, "seeds 1, 2, ... to the number in the row\n");
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  int missing = 0;
  const auto names = arguments.scenes.empty() ? usual_machines() : arguments.scenes;
  for (const std::string& name : names) {
    for (const sprag::Scene& scene : machines(name)) {
      study(scene, arguments.jitters, arguments.estimators, arguments.options, [&](const Row& row) {
        if (!row.missed.empty()) ++missing;
        rows.push_back(to_json(row));
        if (csv) csv->write(csv_row(row));
        if (csv) csv->flush();
        if (arguments.json) return;
        out.write(table_row(row));
        out.flush();
      });
    }
  }
  if (arguments.json) out.write(rows.dump(2) + "\n");
  if (csv && !csv->close()) throw std::runtime_error(csv->error());
  if (!out.close()) throw std::runtime_error(out.error());
  std::fprintf(stderr, "%d of %zu rows miss a bar\n", missing, rows.size());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Holds the standard deviations that an estimator claims against its errors. SCENE is a scene "
      "file, modes:N (the paper's beam with N modes), or a random machine, random:SEED or, where "
      "contacts chatter, chatter:SEED, or FIRST-LAST for SEED; without any twelve machines.",
      "calibration");
  Arguments arguments;
  Options& options = arguments.options;
  app.add_option("SCENE", arguments.scenes);
  app.add_option("--jitter", arguments.jitters, "Standard deviations of event times [s]")
      ->delimiter(',')
      ->check(CLI::NonNegativeNumber);
  app.add_option("--seeds", options.seeds,
                 "Runs of each row, seeds 1, 2, ...; a fifth of them beyond 40 coordinates")
      ->check(CLI::PositiveNumber);
  app.add_option("--estimator", arguments.estimators, "timing, both, or timing,both")
      ->delimiter(',')
      ->transform(CLI::CheckedTransformer(std::map<std::string, EstimatorKind>{
          {"timing", EstimatorKind::timing}, {"both", EstimatorKind::both}}));
  app.add_option(
         "--duration", options.duration,
         "Length of a run [s, simulated]; default 120 periods of the slowest mode or excitation, "
         "or 2500 events")
      ->check(CLI::PositiveNumber);
  app.add_option("--tick", options.tick, "Default: a twenty-thousandth of the duration [s]")
      ->check(CLI::PositiveNumber);
  app.add_option("--start", options.start,
                 "scene: where the scene says; prior: the estimate off the machine by its stated "
                 "uncertainty; "
                 "machine: the machine off the estimate by that, another path each run")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Start>{
          {"scene", Start::scene}, {"prior", Start::prior}, {"machine", Start::machine}}));
  app.add_option(
         "--trouble", options.trouble,
         "none, spurious, missing, mixed or wrong: a tenth more events, a tenth less, both, "
         "or one parameter off by 1 to 5 %")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Trouble>{{"none", Trouble::none},
                                                                 {"spurious", Trouble::spurious},
                                                                 {"missing", Trouble::missing},
                                                                 {"mixed", Trouble::mixed},
                                                                 {"wrong", Trouble::wrong}}));
  using enum sprag::ConfidenceLevel;
  app.add_option("--confidence", options.confidence, "low, medium or high, as in scene files")
      ->transform(CLI::CheckedTransformer(std::map<std::string, sprag::ConfidenceLevel>{
          {name(low), low}, {name(medium), medium}, {name(high), high}}));
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  app.add_flag("--json", arguments.json, "Print one JSON array instead of a table");
  app.add_option("--csv", arguments.csv, "Also write the rows here");
  return sprag::run_program(argc, argv, app, {}, [&](nlohmann::ordered_json&) {
    run(arguments);
    return sprag::exit_done;
  });
}
