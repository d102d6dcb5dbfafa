// study: computes many runs of a scene with threads, shards or MPI ranks. Its quantities are
// described in docs/reference/study_files.md.
#include "command_line/program.h"
#include "tools/study/run.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Runs the study of a study file: a scene of which keys, disturbances of the events and "
      "starts "
      "vary. Rows go to DIR/rows.csv. A study that was ended goes on where it was when it is "
      "started "
      "again. Under mpirun all ranks compute; without it, threads.",
      "study");
  sprag::CommonOptions common;
  sprag::study::StudyRun run;
  sprag::add_common_options(*app, common);
  sprag::add_study(*app, common, run.study);
  sprag::add_file(*app, common, "--output", sprag::NamedFile::Use::written, run.output, "DIR",
                  "Folder of the results [the study's name]");
  sprag::add_text(*app, "--shard", run.shard, "i/n",
                  "Run the i-th of n equal parts alone, with files of its own");
  sprag::add_jobs(*app, run.jobs);
  sprag::add_count(*app, "--chunk", run.chunk, "n",
                   "Hand out and write so many runs together [as many as take a second]");

  sprag::study::Ranks ranks;
  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    return sprag::study::run_study(run, ranks, common, report);
  });
}
