// view: a live page of a run. Its contents: docs/how-to/watch_in_a_browser.md.
#include "command_line/program.h"
#include "tools/view/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Shows a run in a browser while it goes on: the machine in motion, gaps with bands of two "
      "sigma, contacts, error energies, and the observer's health. Serves a page until a signal "
      "comes; it can only be looked at.",
      "view");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  sprag::view::ViewOptions options;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, options.scene);
  sprag::add_text(*app, "--http", options.http, "ADDRESS:PORT",
                  "Where the page is; port 0 takes one that is free [127.0.0.1:8080]");
  auto* replay = sprag::add_file(*app, common, "--replay", sprag::NamedFile::Use::read,
                                 options.replay.file, "FILE",
                                 "Show an LCM log or an events CSV; contacts without estimates are "
                                 "observed meanwhile");
  auto* speed = sprag::add_positive_or_max(*app, "--speed", options.replay.speed, "R",
                                           "Replay so many times as fast, or max [1]");
  auto* tick = sprag::add_positive(*app, "--tick", options.replay.tick, "H",
                                   "Step of the observer of a replay [0.001 s]");
  sprag::needs(speed, replay);
  sprag::needs(tick, replay);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::view::run_view(options, common, report);
  });
}
