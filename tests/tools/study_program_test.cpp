// study as users start it: alone, as shards, under mpirun; killed and restarted.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program_test.h"

namespace sprag {
namespace {

using test::Arguments;
using test::eventually;
using test::read_text;
using test::write_text;
using namespace std::chrono_literals;

class StudyProgramTest : public test::ProgramTest {
 protected:
  StudyProgramTest() {
    // mpirun refuses root without these variables. Leaks of Open MPI itself are ignored.
    ::setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1);
    ::setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
    ::setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
  }

  /// A study of 12 * runs runs, about half a millisecond each.
  std::string study(int runs, const std::string& name = "study") {
    return write_text(path(name + ".toml"), R"(
scene = ")" SPRAG_SOURCE_DIR R"(/scenes/lab_rig.toml"
duration = 5.0
samples = 50
tick = 0.02
seed = 3
estimators = ["replica", "both"]
record = ["V_floor", "time_below", "nees", "trusted", "impacts"]
runs = )" + std::to_string(runs) + R"(
[start]
replica = 0.4
[vary]
events.jitter = { log = [1e-6, 1e-3], points = 4 }
observer.impact.restitution = { relative = [-0.1, 0.1], points = 3 }
disturbance.lost = { linear = [0.0, 0.1], random = true }
)");
  }

  Ended run_study(const std::string& file, const std::string& folder, Arguments more = {}) {
    more.insert(more.begin(), {file, "--output", path(folder)});
    return run(STUDY, more);
  }

  static Arguments mpirun(int ranks) {
    return {MPIRUN, "--oversubscribe", "--bind-to", "none", "-n", std::to_string(ranks), STUDY};
  }

  std::string rows(const std::string& folder) const {
    return read_text(path(folder + "/rows.csv"));
  }
  std::size_t rows_so_far(const std::string& folder) const {
    const std::string text = read_text(path(folder + "/rows.part.csv"));
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  }

  /// The rows of a run with one thread.
  std::string reference(const std::string& file) {
    const Ended ended = run_study(file, "reference", {"--jobs", "1"});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return rows("reference");
  }

  /// Starts it in small chunks and ends it by `end` as soon as there are more than `rows` rows.
  void break_off(Arguments command, const std::string& file, const std::string& folder,
                 std::size_t rows, const std::function<void(test::Process&)>& end) {
    command.insert(command.end(), {file, "--output", path(folder), "--chunk", "3"});
    test::Process process(command, directory_ / "", "broken_off");
    ASSERT_TRUE(eventually([&] { return rows_so_far(folder) > rows; }, 60s)) << process.err();
    end(process);
    ASSERT_TRUE(process.wait(60s)) << "does not end";
    EXPECT_NE(process.wait(0s), 0);
    EXPECT_FALSE(std::filesystem::exists(path(folder + "/rows.csv")))
        << "too soon to be broken off";
  }
};

#ifdef __SANITIZE_THREAD__
#define SKIP_WITHOUT_MPI() GTEST_SKIP() << "Open MPI's own locks are not in one order"
#else
#define SKIP_WITHOUT_MPI() \
  if (std::string(MPIRUN).empty()) GTEST_SKIP() << "built without MPI, or there is no mpirun"
#endif

TEST_F(StudyProgramTest, RowsDoNotDependOnThreadsAndChunks) {
  const std::string file = study(5);
  const std::string expected = reference(file);
  EXPECT_EQ(std::count(expected.begin(), expected.end(), '\n'), 61);
  EXPECT_EQ(run_study(file, "three", {"--jobs", "3", "--chunk", "1"}).code, 0);
  EXPECT_EQ(rows("three"), expected);
  const Ended again = run_study(file, "three");
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(rows("three"), expected);
}

TEST_F(StudyProgramTest, RowsDoNotDependOnRanks) {
  SKIP_WITHOUT_MPI();
  const std::string file = study(5);
  const std::string expected = reference(file);
  for (const int ranks : {1, 2, 3, 5}) {
    Arguments command = mpirun(ranks);
    const std::string program = command.front();
    command.erase(command.begin());
    const std::string folder = "ranks_" + std::to_string(ranks);
    command.insert(command.end(), {file, "--output", path(folder), "--chunk", "2", "--report",
                                   path("report.json")});
    const Ended ended = run(program, command);
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_EQ(rows(folder), expected) << ranks;
    const auto report = nlohmann::json::parse(read_text(path("report.json")));
    if (ranks > 1) {
      EXPECT_EQ(report["workers"], ranks);
    }
    EXPECT_EQ(report["done"], 60);
  }
}

TEST_F(StudyProgramTest, ShardsCombineToStudy) {
  const std::string file = study(5);
  const std::string expected = reference(file);
  for (const char* shard : {"3/4", "1/4", "4/4"}) {
    const Ended ended = run_study(file, "shards", {"--shard", shard});
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
  // The second shard is interrupted; merging computes the missing rows.
  run_study(file, "shards", {"--shard", "2/4", "--jobs", "1"});
  const std::string whole = read_text(path("shards/shard-2-of-4.csv"));
  std::filesystem::remove(path("shards/shard-2-of-4.csv"));
  write_text(path("shards/shard-2-of-4.part.csv"), whole.substr(0, whole.size() / 2));
  const Ended ended = run_study(file, "shards", {"--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(rows("shards"), expected);
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_GT(report["done"], 0);
  EXPECT_LT(report["done"], 15);
}

TEST_F(StudyProgramTest, KilledStudyIsResumed) {
  const std::string file = study(40);
  std::size_t kept = 0;
  for (const int signal : {SIGTERM, SIGKILL}) {
    break_off({STUDY}, file, "killed", kept + 30,
              [&](test::Process& process) { process.signal(signal); });
    if (HasFatalFailure()) return;
    kept = rows_so_far("killed");
  }
  const Ended ended = run_study(file, "killed", {"--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_EQ(report["before"], kept - 1);
  EXPECT_EQ(report["done"], 480 - (kept - 1));
  EXPECT_EQ(rows("killed"), reference(file));
}

TEST_F(StudyProgramTest, StudyWithKilledRankIsResumed) {
  SKIP_WITHOUT_MPI();
  const std::string file = study(40);
  break_off(mpirun(3), file, "killed", 30, [&](test::Process& process) {
    // A rank: a child of mpirun.
    const std::string id = std::to_string(process.id());
    std::istringstream children(read_text("/proc/" + id + "/task/" + id + "/children"));
    pid_t first = 0, second = 0;
    children >> first >> second;
    ASSERT_GT(second, 0);
    ::kill(second, SIGKILL);
  });
  if (HasFatalFailure()) return;
  Arguments command = mpirun(2);
  const std::string program = command.front();
  command.erase(command.begin());
  command.insert(command.end(), {file, "--output", path("killed")});
  const Ended ended = run(program, command);
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(rows("killed"), reference(file));
}

TEST_F(StudyProgramTest, FullDiskKeepsWrittenRows) {
  const std::string file = study(20);
  std::filesystem::create_directory(path("full"));
  // A limit of 20 KiB per file simulates the full disk.
  const Ended full = run("/bin/sh", {"-c", "ulimit -f 40; exec \"$0\" \"$@\"", STUDY, file,
                                     "--output", path("full"), "--chunk", "7"});
  EXPECT_EQ(full.code, 1) << full.err;
  EXPECT_NE(full.err.find("rows.part.csv: File too large"), std::string::npos) << full.err;
  const std::string kept = read_text(path("full/rows.part.csv"));
  EXPECT_GT(kept.size(), 15000U);
  EXPECT_EQ(kept.back(), '\n');
  const Ended ended = run_study(file, "full");
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(rows("full"), reference(file));
}

TEST_F(StudyProgramTest, FailedRunHasARow) {
  // Each axis alone is outside the support, but both together are inside.
  const std::string file = write_text(path("inside.toml"), R"(
scene = ")" SPRAG_SOURCE_DIR R"(/scenes/lab_rig.toml"
duration = 1.0
record = ["impacts"]
[vary]
contact.1.clearance = [0.01, 0.002]
master.q.2 = [0.0, -0.005]
)");
  const Ended ended = run_study(file, "inside", {"--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.err.find("4 of 4 runs"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("1 failed"), std::string::npos) << ended.err;
  std::istringstream lines(rows("inside"));
  std::string line;
  for (int i = 0; i < 5; ++i) std::getline(lines, line);
  EXPECT_TRUE(line.starts_with("3,3,0,0.002")) << line;
  EXPECT_NE(line.find(",nan,"), std::string::npos) << line;
  EXPECT_NE(line.find("starts inside the support of contact 1"), std::string::npos) << line;
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_EQ(report["failed"], 1);
}

TEST_F(StudyProgramTest, AStroboscopeHasARowForEachPoint) {
  // Its orbit has the period of the force, in closed form.
  const std::string file = write_text(path("orbit.toml"), R"(
scene = ")" SPRAG_SOURCE_DIR R"(/scenes/impact_oscillator.toml"
record = ["poincare", "attractor", "impacts_per_period", "lyapunov"]
[machine]
transient = 20
periods = 40
coordinates = ["u1"]
[vary]
force.1.frequency = [34.0, 26.0, 20.0]
)");
  const Ended ended = run_study(file, "orbit", {"--chunk", "1"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  std::istringstream lines(rows("orbit"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line,
            "index,point,run,force.1.frequency,n,impacts_per_period,lyapunov,attractor.period,"
            "attractor.u1,u1,failure");
  for (int i = 0; i < 40; ++i) {
    std::getline(lines, line);
    double frequency = 0.0, impacts = 0.0, lyapunov = 0.0, of_attractor = 0.0, u = 0.0;
    int n = 0, period = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "0,0,0,%lf,%d,%lf,%lf,%d,%lf,%lf,", &frequency, &n,
                          &impacts, &lyapunov, &period, &of_attractor, &u),
              7)
        << line;
    EXPECT_EQ(frequency, 34.0);
    EXPECT_EQ(n, i + 1);
    EXPECT_EQ(impacts, 1.0);
    EXPECT_LT(lyapunov, -0.01);
    EXPECT_EQ(period, 1);
    EXPECT_NEAR(u, 0.1855338168983542, 1e-9);
    EXPECT_NEAR(of_attractor, u, 1e-9);
  }
  // Interrupted within the rows of a run.
  const std::string whole = rows("orbit");
  std::filesystem::remove(path("orbit/rows.csv"));
  write_text(path("orbit/rows.part.csv"), whole.substr(0, whole.size() / 2));
  EXPECT_EQ(run_study(file, "orbit").code, 0);
  EXPECT_EQ(rows("orbit"), whole);
}

TEST_F(StudyProgramTest, FolderOfOtherStudyIsRefused) {
  const std::string file = study(1);
  ASSERT_EQ(run_study(file, "folder").code, 0);
  const std::string before = rows("folder");
  const std::string changed = write_text(path("changed.toml"), read_text(file) + "# changed\n");
  for (const std::string& another : {changed, study(2)}) {
    const Ended other = run_study(another, "folder");
    EXPECT_EQ(other.code, 2);
    EXPECT_NE(other.err.find("belongs to another study"), std::string::npos) << other.err;
    EXPECT_EQ(rows("folder"), before);
  }
  study(1);
  std::filesystem::remove(path("folder/manifest.json"));
  EXPECT_EQ(run_study(file, "folder").code, 2);
  EXPECT_EQ(rows("folder"), before);
}

// Without --output the study's name becomes a folder here, so that a path is refused.
TEST_F(StudyProgramTest, ANameThatIsAPathIsRefused) {
  const std::string text = read_text(study(1));
  for (const char* name : {"../out", "/tmp/out", ".", "..", "", "a/b", "a\\nb", "\\u001b[31m"}) {
    const std::string file =
        write_text(path("named.toml"), "name = \"" + std::string(name) + "\"\n" + text);
    const Ended ended = run(STUDY, {file});
    EXPECT_EQ(ended.code, 2) << name;
    EXPECT_NE(ended.err.find("use --output FOLDER"), std::string::npos) << ended.err;
    EXPECT_EQ(ended.err.find('\x1b'), std::string::npos);
    EXPECT_EQ(run_study(file, "out").code, 0) << name;
    std::filesystem::remove_all(path("out"));
  }
}

TEST_F(StudyProgramTest, BadUsageIsRefused) {
  const std::string file = study(1);
  for (const char* shard : {"0/4", "5/4", "1", "1/", "a/b", "1/2/3"}) {
    const Ended ended = run_study(file, "folder", {"--shard", shard});
    EXPECT_EQ(ended.code, 2) << shard;
    EXPECT_NE(ended.err.find("must be i/n"), std::string::npos) << ended.err;
  }
  EXPECT_EQ(run_study(path("none.toml"), "folder").code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("folder")));
  // A result that would overwrite an input.
  std::filesystem::create_directory(path("own"));
  std::filesystem::rename(file, path("own/rows.csv"));
  const std::string text = read_text(path("own/rows.csv"));
  EXPECT_EQ(run_study(path("own/rows.csv"), "own").code, 2);
  EXPECT_EQ(read_text(path("own/rows.csv")), text);
}

#if !SPRAG_HAS_MPI
TEST_F(StudyProgramTest, WithoutMpiSeveralRanksAreRefused) {
  const Ended ended =
      run("/usr/bin/env", {"OMPI_COMM_WORLD_SIZE=2", STUDY, study(1), "--output", path("folder")});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("without MPI"), std::string::npos) << ended.err;
  EXPECT_FALSE(std::filesystem::exists(path("folder")));
}
#endif

}  // namespace
}  // namespace sprag
