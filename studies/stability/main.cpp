// stability: writes the curves of failures.h as CSV files, for charts.py to draw.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/output_file.h"
#include "studies/stability/failures.h"

namespace {

using sprag::stability::Curve;

// One file per curve: FOLDER/NAME_1.csv, FOLDER/NAME_2.csv, ...
bool write(const std::filesystem::path& folder, const std::string& name,
           const std::vector<Curve>& curves) {
  int number = 0;
  for (const Curve& curve : curves) {
    sprag::OutputFile file(folder / (name + "_" + std::to_string(++number) + ".csv"));
    file.write("# " + curve.name + "\n");
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      std::string line;
      sprag::append_number(line, curve.x[i]);
      line += ',';
      sprag::append_number(line, curve.y[i]);
      file.write(line + '\n');
    }
    if (!file.close()) {
      std::cerr << file.error() << '\n';
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Computes where methods for impacting machines fail.", "stability");
  std::filesystem::path folder;
  app.add_option("FOLDER", folder, "Where the curves go")
      ->required()
      ->check(CLI::ExistingDirectory);
  CLI11_PARSE(app, argc, argv);
  using namespace sprag::stability;
  return write(folder, "newton", newton_after_a_closed_clutch()) &&
                 write(folder, "restitution", unlike_restitution(100000)) &&
                 write(folder, "damping", no_damping(100.0)) &&
                 write(folder, "persistent", persistent_contact(60.0)) &&
                 write(folder, "chatter", event_storm(400)) &&
                 write(folder, "grazing", missed_touches(100000)) &&
                 write(folder, "activation", gap_activation()) &&
                 write(folder, "steps", step_limits())
             ? 0
             : 1;
}
