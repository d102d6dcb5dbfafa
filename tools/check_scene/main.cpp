// check_scene: predicts whether the replica of a scene will synchronize with its master, and why.
#include <chrono>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/analysis/guaranteed_widths.h"
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
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, file);
  sprag::add_flag(*app, "--json", json, "Print one JSON object");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene scene = sprag::load_scene(file, common);
    nlohmann::ordered_json object;
    sprag::TrialLimits limits;
    limits.out_of_time = [begin = std::chrono::steady_clock::now()] {
      return std::chrono::steady_clock::now() - begin > longest_trial;
    };
    sprag::Assessment assessment = sprag::assess(scene, limits);
    sprag::write_json(assessment, object);
    sprag::write_parameters(scene, object);
    const auto guaranteed = sprag::guaranteed_widths(scene);
    sprag::write_guaranteed(guaranteed, object);
    assessment.scene = sprag::printable(assessment.scene);
    sprag::print_result(object,
                        sprag::to_text(assessment) + sprag::parameters_text(scene) +
                            sprag::guaranteed_text(scene, guaranteed),
                        json, report);
    return assessment.synchronizes() ? sprag::exit_done : exit_may_not;
  });
}
