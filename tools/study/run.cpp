#include "tools/study/run.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "command_line/printable.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/study/quantities.h"
#include "sprag/detail/study/study_file.h"
#include "tools/study/manifest.h"
#include "tools/study/row_file.h"
#include "tools/study/schedule.h"

namespace sprag::study {
namespace {

using Json = nlohmann::ordered_json;
using std::filesystem::path;

struct Shard {
  int i = 1, n = 1;
};

Shard parse_shard(const std::string& text) {
  Shard shard;
  const char* const end = text.data() + text.size();
  const auto [slash, error] = std::from_chars(text.data(), end, shard.i);
  const bool divided = error == std::errc{} && slash != end && *slash == '/';
  const auto last = divided ? std::from_chars(slash + 1, end, shard.n)
                            : std::from_chars_result{end, std::errc::invalid_argument};
  if (last.ec != std::errc{} || last.ptr != end || shard.i < 1 || shard.n < shard.i) {
    throw UsageError("--shard: " + text + " is not allowed; must be i/n with 1 <= i <= n");
  }
  return shard;
}

// Part i of n of the indices, i from 1.
Range part_of(std::int64_t total, int i, int n) {
  const auto begin = [&](int parts) { return total / n * parts + total % n * parts / n; };
  return {begin(i - 1), begin(i)};
}

std::string shard_name(int i, int n) {
  return "shard-" + std::to_string(i) + "-of-" + std::to_string(n);
}

// The files of a study or a shard.
struct Files {
  path rows, partly, manifest;
};

Files files_of(const path& folder, const Shard& shard, bool whole) {
  const std::string stem = whole ? "rows" : shard_name(shard.i, shard.n);
  return {folder / (stem + ".csv"), folder / (stem + ".part.csv"),
          folder / ((whole ? "manifest" : stem) + ".json")};
}

void refuse_overwriting(const Study& study, const Files& files, const CommonOptions& common) {
  std::vector<NamedFile> named;
  named.push_back({"STUDY", study.file, NamedFile::Use::read});
  for (const path& input : study.inputs)
    named.push_back({"a file of STUDY", input, NamedFile::Use::read});
  for (const path& file : {files.rows, files.partly, files.manifest}) {
    named.push_back({"--output", file, NamedFile::Use::written});
  }
  if (!common.report.empty()) {
    named.push_back({"--report", common.report, NamedFile::Use::written});
  }
  if (const std::string clash = overwritten(named); !clash.empty()) throw OverwriteError(clash);
}

Layout layout_of(const Study& study) {
  Layout layout;
  const std::vector<std::string> names = columns(study);
  for (const std::string& name : names) layout.header += (layout.header.empty() ? "" : ",") + name;
  layout.fields = names.size();
  if (study.record.poincare) {
    layout.n_field =
        static_cast<std::size_t>(std::find(names.begin(), names.end(), "n") - names.begin());
    layout.n_last = study.stroboscope.periods;
  }
  return layout;
}

// The shards in the folder, finished or not.
std::vector<RowSource> shards_in(const path& folder, const Study& study, const Layout& layout,
                                 const Origin& whole) {
  std::vector<RowSource> sources;
  std::vector<path> manifests;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("shard-") && name.ends_with(".json")) manifests.push_back(entry.path());
  }
  std::sort(manifests.begin(), manifests.end());
  for (const path& file : manifests) {
    Origin origin = whole;
    int matched = 0;
    const std::string name = file.filename().string();
    if (std::sscanf(name.c_str(), "shard-%d-of-%d.json%n", &origin.shard, &origin.shards,
                    &matched) != 2 ||
        matched != static_cast<int>(name.size()) || origin.shard < 1 ||
        origin.shards < origin.shard) {
      continue;
    }
    const Shard shard{origin.shard, origin.shards};
    origin.indices = part_of(study.indices(), shard.i, shard.n);
    check_manifest(file, manifest(study, origin));
    const Files files = files_of(folder, shard, false);
    const bool finished = std::filesystem::exists(files.rows);
    const path& rows = finished ? files.rows : files.partly;
    if (!std::filesystem::exists(rows)) continue;
    if (!finished) const RowFile unused(rows);  // throws if another process computes it
    sources.push_back({rows, read_rows(rows, layout, origin.indices), false});
  }
  return sources;
}

void refuse_overlaps(const std::vector<RowSource>& sources) {
  std::vector<std::pair<Range, const RowSource*>> ranges;
  for (const RowSource& source : sources) {
    for (const Range& range : source.contents.ranges()) ranges.emplace_back(range, &source);
  }
  std::sort(ranges.begin(), ranges.end(),
            [](const auto& a, const auto& b) { return a.first.first < b.first.first; });
  for (std::size_t i = 1; i < ranges.size(); ++i) {
    if (ranges[i].first.first >= ranges[i - 1].first.end) continue;
    throw InputError(ranges[i].second->file.string() + ": has runs that " +
                     ranges[i - 1].second->file.string() + " has too; remove one of them");
  }
}

// Progress on stderr: on a terminal an updated line, else a line per minute.
class ProgressLine {
 public:
  void show(const Progress& progress) {
    const double now = progress.seconds;
    if (now - shown_ < (terminal_ ? 0.5 : 60.0)) return;
    shown_ = now;
    print(describe(progress));
  }
  void last(const Progress& progress) {
    print(describe(progress));
    if (terminal_) std::fputc('\n', stderr);
  }

 private:
  void print(const std::string& line) {
    if (terminal_) {
      std::fprintf(stderr, "\r%-*s", static_cast<int>(width_), line.c_str());
      width_ = line.size();
    } else {
      std::fprintf(stderr, "study: %s\n", line.c_str());
    }
  }

  bool terminal_ = ::isatty(STDERR_FILENO) == 1;
  double shown_ = 0.0;
  std::size_t width_ = 0;
};

// The name of a study must not be a path that leads out of the working directory.
path folder_named(const Study& study) {
  const path folder(study.name);
  const bool plain = printable(study.name) == study.name && folder == folder.filename();
  if (plain && folder != "." && folder != ".." && !folder.empty()) return folder;
  throw UsageError(study.file + ": name is \"" + printable(study.name) +
                   "\", which no folder in the working directory can have; use --output FOLDER");
}

// Preparations of rank 0 before the computation.
struct Session {
  Files files;
  Layout layout;
  Origin origin;
  std::vector<RowSource> sources;  // this session's file last
  std::optional<RowFile> output;   // none: all runs have been computed
  std::int64_t failures = 0;       // failed runs of earlier sessions

  Session(const Study& study, const StudyRun& run, const CommonOptions& common, Origin given)
      : layout(layout_of(study)), origin(std::move(given)) {
    const path folder = run.output.empty() ? folder_named(study) : run.output;
    const bool whole = run.shard.empty();
    files = files_of(folder, {origin.shard, origin.shards}, whole);
    refuse_overwriting(study, files, common);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (!std::filesystem::is_directory(folder)) {
      throw UsageError("--output: " + folder.string() + " is no folder and cannot be made one");
    }
    const Json now = manifest(study, origin);
    check_manifest(files.manifest, now);
    if (std::filesystem::exists(files.rows)) {
      if (!std::filesystem::exists(files.manifest)) {
        throw InputError(files.rows.string() +
                         ": is there without a manifest; move it away, or use another --output");
      }
      return;
    }
    if (std::filesystem::exists(files.partly) && !std::filesystem::exists(files.manifest)) {
      throw InputError(files.partly.string() +
                       ": is there without a manifest; move it away, or use another --output");
    }
    if (whole) sources = shards_in(folder, study, layout, origin);
    write_manifest(files.manifest, now);
    output.emplace(files.partly);
    const Contents own = read_rows(files.partly, layout, origin.indices);
    output->go_on(own, layout);
    sources.push_back({files.partly, own, true});
    refuse_overlaps(sources);
    for (const RowSource& source : sources) failures += source.contents.failures;
  }

  std::vector<Range> missing() const {
    std::vector<Range> done;
    for (const RowSource& source : sources) {
      const std::vector<Range> ranges = source.contents.ranges();
      done.insert(done.end(), ranges.begin(), ranges.end());
    }
    return missing_ranges(origin.indices, done);
  }

  // Sorts the rows and finishes the study.
  void complete(const Study& study) {
    output->close();
    RowSource& own = sources.back();
    own.contents = read_rows(own.file, layout, origin.indices);
    if (own.contents.segments.empty() && sources.size() > 1) {
      std::filesystem::remove(own.file);
      sources.pop_back();
    }
    merge_rows(sources, layout, files.rows);
    std::error_code ignored;
    std::filesystem::remove(files.partly, ignored);
    Json finished = manifest(study, origin);
    finished["finished"] = true;
    write_manifest(files.manifest, finished);
  }
};

void fill_report(const Study& study, const Session& session, const Progress& progress,
                 Json& report) {
  report["study"] = study.name;
  report["rows"] = session.files.rows.string();
  report["points"] = study.points;
  report["runs"] = session.origin.indices.size();
  report["before"] = progress.before;
  report["done"] = progress.done;
  if (session.output) report["failed"] = session.failures + progress.failures;
  report["workers"] = session.origin.workers;
  report["hosts"] = session.origin.hosts;
  report["seconds"] = progress.seconds;
  report["computing_seconds"] = progress.busy;
  if (progress.done > 0) {
    // Time of all workers outside of runs.
    report["overhead_seconds_per_run"] =
        (progress.seconds * session.origin.workers - progress.busy) /
        static_cast<double>(progress.done);
  }
}

struct Leaving {
  Ranks& ranks;
  ~Leaving() { ranks.leave(); }
};

// In place of the hash of a study: rank 0 has refused the study.
constexpr std::uint64_t refused = 0;

// A rank other than 0: computes the runs that rank 0 assigns.
int serve(const StudyRun& run, Ranks& ranks) {
  const std::uint64_t hash = ranks.from_manager(refused);
  if (hash == refused) return exit_usage;  // rank 0 prints the reason
  try {
    const Study study = read_study(run.study, scenes_folder());
    if (study.hash != hash) {
      throw InputError(run.study.string() + ": is another one, or of another scene, on this host");
    }
    Measurement measurement(study);
    ranks.serve(
        [&](Range range, std::string& text) { return measurement.append_rows(range, text); });
  } catch (...) {
    ranks.give_up();
    throw;
  }
  return exit_done;
}

}  // namespace

int run_study(const StudyRun& run, Ranks& ranks, CommonOptions& common, Json& report) {
  ranks.begin();
  const Leaving leaving{ranks};
  const bool first = ranks.rank() == 0;
  if (!first) common.report.clear();
  if (ranks.size() > 1 && run.jobs > 0) {
    throw UsageError("--jobs is for one process; under mpirun each rank is a worker");
  }
  const int cores = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1U));
  const int threads = run.jobs > 0 ? run.jobs : cores;
  if (!first) return serve(run, ranks);

  std::optional<Study> study;
  std::optional<Session> session;
  try {
    study.emplace(read_study(run.study, scenes_folder()));
    for (const std::string& remark : study->scene.remarks) {
      std::cerr << remark << '\n';
    }
    const Shard shard = run.shard.empty() ? Shard{} : parse_shard(run.shard);
    session.emplace(*study, run, common,
                    Origin{.version = report.at("version"),
                           .workers = ranks.size() > 1 ? ranks.size() : threads,
                           .hosts = ranks.hosts(),
                           .chunk = run.chunk,
                           .shard = shard.i,
                           .shards = shard.n,
                           .indices = part_of(study->indices(), shard.i, shard.n)});
  } catch (...) {
    ranks.from_manager(refused);
    throw;
  }
  ranks.from_manager(study->hash == refused ? 1 : study->hash);

  Coordinator coordinator(session->output ? session->missing() : std::vector<Range>{},
                          {.total = session->origin.indices.size(),
                           .workers = session->origin.workers,
                           .chunk = run.chunk,
                           .longest = std::max(16384 / rows_of_run(*study), 1)},
                          [&](const Chunk& chunk) { session->output->append(chunk); });
  const auto make_compute = [&]() -> Compute {
    const auto measurement = std::make_shared<Measurement>(*study);
    return [measurement](Range range, std::string& text) {
      return measurement->append_rows(range, text);
    };
  };
  ProgressLine line;
  const auto on_wait = [&] { line.show(coordinator.progress()); };
  const auto conclude = [&] {
    const Progress progress = coordinator.progress();
    fill_report(*study, *session, progress, report);
    line.last(progress);
  };
  try {
    if (ranks.size() > 1) {
      ranks.manage(coordinator, make_compute, on_wait);
    } else {
      run_threads(coordinator, threads, make_compute, on_wait);
    }
    if (session->output) session->complete(*study);
  } catch (...) {
    conclude();
    std::cerr << "study: the runs that are done are kept in " << session->files.partly.string()
              << "; the same command goes on\n";
    throw;
  }
  conclude();
  return exit_done;
}

}  // namespace sprag::study
