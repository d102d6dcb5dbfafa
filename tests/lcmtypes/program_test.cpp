// Would catch a command line or exception with a wrong exit code, and a report without its error.
#include "command_line/program.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>

#include "lcmtypes/bus.h"
#include "sprag/detail/files/csv.h"
#include "sprag/scene_file.h"
#include "tests/support/process.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

struct Outcome {
  int code;
  std::string out, err;
};

struct TestProgram {
  CommonOptions common;
  double tick = 0.001, speed = 1.0;
  int method = 0;
  std::filesystem::path input;
  std::function<int(nlohmann::ordered_json&)> run = [](auto&) { return exit_done; };

  Outcome operator()(std::vector<const char*> arguments) {
    CLI::App app("What it does.", "tester");
    common.files.clear();
    add_common_options(app, common);
    add_positive(app, "--tick", tick, "h", "Step");
    add_positive_or_max(app, "--speed", speed, "R", "Speed");
    add_choice<int>(app, "--method", method, {{"one", 1}, {"two", 2}, {"three", 3}}, "Method");
    add_file(app, common, "--input", NamedFile::Use::read, input, "FILE", "Reads");
    arguments.insert(arguments.begin(), "tester");
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code =
        run_program(static_cast<int>(arguments.size()), arguments.data(), app, common, run);
    return {code, testing::internal::GetCapturedStdout(), testing::internal::GetCapturedStderr()};
  }
};

template <class Error>
std::function<int(nlohmann::ordered_json&)> throwing(const char* what) {
  return [what](nlohmann::ordered_json&) -> int { throw Error(what); };
}

TEST(ProgramTest, HelpAndVersionExitWithZero) {
  const Outcome version = TestProgram{}({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_TRUE(version.out.starts_with("tester ") && version.out.ends_with("\n")) << version.out;
  const Outcome help = TestProgram{}({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_NE(help.out.find("--report"), std::string::npos);
}

TEST(ProgramTest, BadCommandLinesExitWithTwo) {
  EXPECT_EQ(TestProgram{}({"--nonsense"}).code, 2);
  EXPECT_EQ(TestProgram{}({"surplus"}).code, 2);
  EXPECT_EQ(TestProgram{}({"--report"}).code, 2);
  const Outcome url = TestProgram{}({"--url", "udpm://10.0.0.1:5"});
  EXPECT_EQ(url.code, 2);
  EXPECT_NE(url.err.find("--url"), std::string::npos);
}

TEST(ProgramTest, NumbersAreCheckedAndMessageGivesRange) {
  for (const char* bad :
       {"0", "-1", "-0", "nan", "inf", "-inf", "1e999", "1x", "", "0x10", "max"}) {
    const Outcome outcome = TestProgram{}({"--tick", bad});
    EXPECT_EQ(outcome.code, 2) << bad;
    EXPECT_NE(outcome.err.find("--tick"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("finite number > 0"), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(TestProgram{}({"--speed", "inf"}).code, 2);
  TestProgram program;
  EXPECT_EQ(program({"--tick", "2.5e-4", "--speed=max"}).code, 0);
  EXPECT_EQ(program.tick, 2.5e-4);
  EXPECT_TRUE(std::isinf(program.speed));
}

TEST(ProgramTest, InvalidChoiceIsReportedWithValidOnes) {
  const Outcome outcome = TestProgram{}({"--method", "kalman"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_TRUE(outcome.err.starts_with("--method: kalman; choose one, two or three\n"))
      << outcome.err;
  EXPECT_EQ(TestProgram{}({"--method", "1"}).code, 2);
  EXPECT_EQ(TestProgram{}({"--method", ""}).code, 2);
  TestProgram program;
  EXPECT_EQ(program({"--method", "two"}).code, 0);
  EXPECT_EQ(program.method, 2);
}

TEST(ProgramTest, ReportOverInputIsRefusedBeforeTheRun) {
  const test::TemporaryDirectory directory;
  const std::string file = test::write_text(directory / "file", "precious");
  TestProgram program;
  program.run = [](auto&) -> int { throw std::logic_error("runs"); };
  const Outcome outcome = program({"--input", file.c_str(), "--report", file.c_str()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.err, "tester: --report and --input are the same file, " + file + "\n");
  EXPECT_EQ(test::read_text(file), "precious");
}

TEST(ProgramTest, ExceptionsBecomeExitCodesAndMessages) {
  TestProgram program;
  const auto expect = [&program](int code, std::function<int(nlohmann::ordered_json&)> run) {
    program.run = std::move(run);
    const Outcome outcome = program({});
    EXPECT_EQ(outcome.code, code);
    EXPECT_EQ(outcome.err, "tester: what happened\n");
  };
  expect(2, throwing<SceneError>("what happened"));
  expect(2, throwing<ModelError>("what happened"));
  expect(2, throwing<InputError>("what happened"));
  expect(2, throwing<UsageError>("what happened"));
  expect(2, throwing<UrlError>("what happened"));
  expect(1, throwing<BusError>("what happened"));
  expect(1, throwing<std::runtime_error>("what happened"));
}

// A name in an error does not start a new line; only the two lines that repair a route do.
TEST(ProgramTest, NamesInErrorsAreEscaped) {
  TestProgram program;
  program.run = throwing<InputError>("a\ntester: all is well\x1b[31m: No such file");
  EXPECT_EQ(program({}).err, "tester: a\\ntester: all is well\\x1b[31m: No such file\n");
  program.run = throwing<BusError>("no route\n    ip route");
  EXPECT_EQ(program({}).err, "tester: no route\n    ip route\n");
  const Outcome usage = TestProgram{}({"--tick", "\x1b[31m\xff"});
  EXPECT_EQ(usage.err.find_first_of("\x1b\xff"), std::string::npos) << usage.err;
}

TEST(ProgramTest, ReportHoldsTheFiguresAndTheError) {
  const test::TemporaryDirectory directory;
  const std::string file = (directory / "report.json").string();
  TestProgram program;
  program.run = [](nlohmann::ordered_json& report) {
    report["rows"] = 3;
    report["name"] = "caf\xe9";  // not UTF-8
    return exit_done;
  };
  EXPECT_EQ(program({"--report", file.c_str()}).code, 0);
  auto report = test::parse_json(test::read_text(file));
  EXPECT_EQ(report["program"], "tester");
  EXPECT_TRUE(report.contains("version"));
  EXPECT_EQ(report["command"], (std::vector<std::string>{"--report", file}));
  EXPECT_EQ(report["rows"], 3);
  EXPECT_EQ(report["exit"], 0);
  EXPECT_FALSE(report.contains("error"));

  program.run = throwing<BusError>("lost");
  EXPECT_EQ(program({"--report", file.c_str()}).code, 1);
  report = test::parse_json(test::read_text(file));
  EXPECT_EQ(report["error"], "lost");
  EXPECT_EQ(report["exit"], 1);
}

TEST(ProgramTest, ReportThatCannotBeWrittenIsAFailure) {
  EXPECT_EQ(TestProgram{}({"--report", "/nowhere/report.json"}).code, 1);
  const Outcome full = TestProgram{}({"--report", "/dev/full"});
  EXPECT_EQ(full.code, 1);
  EXPECT_NE(full.err.find("/dev/full: No space left"), std::string::npos);
}

TEST(ProgramTest, AnInterruptedProgramHasFailedUnlessItRunsUntilASignal) {
  TestProgram program;
  program.run = [](auto&) -> int {
    std::raise(SIGTERM);
    check_interrupt();
    return exit_done;
  };
  const Outcome failed = program({});
  EXPECT_EQ(failed.code, 1);
  EXPECT_EQ(failed.err, "tester: interrupted\n");
  program.common.runs_until_signal = true;
  EXPECT_EQ(program({}).code, 0);
  program.run = [](auto&) {
    check_interrupt();  // a new run begins without a request
    return exit_done;
  };
  EXPECT_EQ(program({}).code, 0);
}

TEST(ProgramTest, SignalsSetTheStopFlag) {
  std::signal(SIGHUP, SIG_DFL);  // even if the tests run under nohup
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    TestProgram program;
    program.run = [signal](nlohmann::ordered_json&) {
      EXPECT_FALSE(stop_requested());
      std::raise(signal);
      EXPECT_TRUE(stop_requested());
      return exit_done;
    };
    EXPECT_EQ(program({}).code, 0);
  }
}

}  // namespace
}  // namespace sprag
