// convergence: computes the figures of the charts that compare Sprag's own estimators and costs.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "command_line/program.h"
#include "studies/convergence/study.h"

namespace {

using namespace sprag::studies;

struct Study {
  const char* name;
  const char* columns;
  void (*run)(Table& table);
};

constexpr Study all[] = {{"observer", observer_columns, observer},
                         {"position_sensor", position_sensor_columns, position_sensor},
                         {"modes", modes_columns, modes},
                         {"growth", growth_columns, growth},
                         {"limit", limit_columns, limit},
                         {"stability", stability_columns, stability}};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Writes the figures of the charts in docs/measurements/speed_accuracy.md, one CSV a "
      "study.",
      "convergence");
  sprag::CommonOptions common;
  std::string out = "out/speed_accuracy";
  std::vector<std::string> names;
  sprag::add_common_options(app, common);
  app.add_option("--out", out, "Directory of the CSVs")->capture_default_str();
  std::vector<std::string> known;
  for (const Study& study : all) known.emplace_back(study.name);
  app.add_option("STUDY", names, "Which ones; all if none is named")
      ->check([&known](const std::string& name) {
        const bool is_known = std::find(known.begin(), known.end(), name) != known.end();
        return is_known ? std::string{} : sprag::choose(name, known);
      });

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json&) {
    std::filesystem::create_directories(out);
    for (const Study& study : all) {
      if (!names.empty() && std::find(names.begin(), names.end(), study.name) == names.end()) {
        continue;
      }
      std::cerr << study.name << '\n';
      Table table(out + "/" + study.name + ".csv", study.columns);
      study.run(table);
      table.close();
    }
    return sprag::exit_done;
  });
}
