// sync_logger: the synchronization error energy V(t) of a master and its observer, as CSV.
#include "command_line/program.h"
#include "sprag/scene.h"
#include "tools/sync_logger/live.h"
#include "tools/sync_logger/offline.h"

int main(int argc, char** argv) {
  using Use = sprag::NamedFile::Use;
  const auto app = sprag::command_line(
      "Logs how far an observer is from its master: error energy V and its parts V_i.",
      "sync_logger");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  std::filesystem::path scene;
  sprag::LiveOptions live;
  sprag::OfflineOptions offline;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, scene);
  auto* duration =
      sprag::add_positive(*app, "--duration", live.duration, "T", "Stop at this simulated time");
  auto* csv = sprag::add_file(*app, common, "--csv", Use::written, live.csv, "F.csv",
                              "Write k,t,V,V1,...,Vf here, not to stdout");
  auto* record = sprag::add_file(*app, common, "--record", Use::written, live.record, "F.lcmlog",
                                 "Record all SPRAG_* channels as LCM log");
  auto* now = sprag::add_flag(*app, "--now", live.now, "Also log V of the provisional estimates");
  sprag::needs(now, csv);
  common.files.emplace_back([&live] {
    return sprag::NamedFile{"--now", live.now ? sprag::now_file(live.csv) : "", Use::written};
  });
  auto* truth = sprag::add_file(*app, common, "--truth", Use::read, offline.truth, "F.csv",
                                "Offline: states CSV of the master");
  auto* estimate = sprag::add_file(*app, common, "--estimate", Use::read, offline.estimate, "F.csv",
                                   "Offline: the observer's");
  for (auto* other : {estimate, csv}) sprag::needs(truth, other);
  for (auto* other : {duration, record, now}) sprag::excludes(truth, other);
  sprag::needs(estimate, truth);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Model model = sprag::load_scene(scene, common).model;
    offline.csv = live.csv;
    return offline.truth.empty() ? sprag::run_live(model, live, common, report)
                                 : sprag::run_offline(model, offline, report);
  });
}
