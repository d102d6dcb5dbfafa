// check_scene: predicts whether the replica of a scene will synchronize with its master, and why.
#include <chrono>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/assessment.h"
#include "sprag/detail/analysis/guaranteed_widths.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/text/parameters_text.h"
#include "sprag/detail/text/printable.h"
#include "sprag/scene.h"
#include "tools/check_scene/json.h"

namespace {

constexpr int exit_may_not = 3;  // the replica may not synchronize, no failure
constexpr auto longest_trial = std::chrono::seconds(5);

}  // namespace

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Says whether an observer of the scene will find the machine's motion: first the default "
      "estimator, both, then Theorem 1 with the reasons. Exit code 0: the replica will synchronize "
      "by Theorem 1, 3: it may not.",
      "check_scene");
  sprag::CommonOptions common;
  std::filesystem::path file;
  bool json = false;
  double tolerance = 0.0;
  std::filesystem::path output;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, file);
  sprag::add_flag(*app, "--json", json, "Print one JSON object");
  bool machine = false;
  sprag::add_flag(*app, "--machine", machine,
                  "Check nothing: print contacts and outputs of the machine as one JSON object");

  CLI::Option* accuracy =
      sprag::add_positive(*app, "--accuracy", tolerance, "TOL",
                          "Also report the fewest modes that show the tip to TOL metres, and the "
                          "fewest coordinates with a correction for the omitted modes");
  sprag::needs(sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written, output,
                               "REDUCED.toml", "With --accuracy: write the scene in these"),
               accuracy);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene scene = sprag::load_scene(file, common);
    nlohmann::ordered_json object;
    if (machine) {
      sprag::write_machine(scene, object);
      sprag::print_result(object, "", true, report);
      return sprag::exit_done;
    }
    sprag::TrialLimits limits;
    limits.out_of_time = [begin = std::chrono::steady_clock::now()] {
      return std::chrono::steady_clock::now() - begin > longest_trial;
    };
    sprag::Assessment assessment = sprag::assess(scene, limits);
    if (tolerance > 0.0) sprag::assess_accuracy(scene, tolerance, limits, assessment);
    sprag::write_json(assessment, object);
    sprag::write_parameters(scene, object);
    const auto guaranteed = sprag::guaranteed_widths(scene);
    sprag::write_guaranteed(guaranteed, object);
    assessment.scene = sprag::printable(assessment.scene);
    sprag::print_result(object,
                        sprag::to_text(assessment) + sprag::parameters_text(scene) +
                            sprag::guaranteed_text(scene, guaranteed),
                        json, report);
    if (!output.empty()) {
      if (!assessment.accuracy) throw sprag::ModelError(assessment.findings.back().what);
      const sprag::Reduction& fewest = assessment.accuracy->fewest;
      sprag::write_scene(output, sprag::reduced_scene(scene, fewest.machine),
                         sprag::description(scene, fewest));
    }
    return assessment.synchronizes() ? sprag::exit_done : exit_may_not;
  });
}
