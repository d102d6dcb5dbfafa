// sync_logger: the synchronization error energy V(t) of a master and its observer, as CSV.
#include <nlohmann/json.hpp>

#include "lcmtypes/program.h"
#include "mechanics/scene.h"
#include "tools/sync_logger/live.h"
#include "tools/sync_logger/offline.h"

int main(int argc, char** argv) {
  CLI::App app("Logs how far an observer is from its master: error energy V and its parts V_i.",
               "sync_logger");
  sprag::CommonOptions common;
  std::string scene;
  sprag::LiveOptions live;
  sprag::OfflineOptions offline;
  sprag::add_common_options(app, common);
  app.add_option("SCENE", scene, "Scene file (TOML)")->required();
  auto* duration =
      sprag::add_positive(app, "--duration", live.duration, "T", "Stop at this simulated time");
  auto* csv = app.add_option("--csv", live.csv, "Write k,t,V,V1,...,Vf here, not to stdout")
                  ->type_name("F.csv");
  auto* record = app.add_option("--record", live.record, "Record all SPRAG_* channels as LCM log")
                     ->type_name("F.lcmlog");
  auto* now =
      app.add_flag("--now", live.now, "Also log V of the provisional estimates")->needs(csv);
  auto* truth = app.add_option("--truth", offline.truth, "Offline: states CSV of the master")
                    ->type_name("F.csv");
  auto* estimate =
      app.add_option("--estimate", offline.estimate, "Offline: the observer's")->type_name("F.csv");
  truth->needs(estimate)->needs(csv)->excludes(duration)->excludes(record)->excludes(now);
  estimate->needs(truth);

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Model model = sprag::read_scene(scene).model;
    offline.csv = live.csv;
    return offline.truth.empty() ? sprag::run_live(model, live, common, report)
                                 : sprag::run_offline(model, offline, report);
  });
}
