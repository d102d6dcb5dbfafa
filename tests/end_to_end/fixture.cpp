#include "tests/end_to_end/fixture.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <thread>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/states_file.h"

namespace sprag::test {

namespace {

// Limits for a hang, not for slowness: some of these tests take five seconds on an idle machine,
// and ten of them run in parallel.
constexpr auto patience = sanitized ? 300s : 90s;
constexpr unsigned alarm_seconds = sanitized ? 450 : 150;

const std::map<std::string, std::string> programs{
    {"check_scene", CHECK_SCENE}, {"diagnose", DIAGNOSE},
    {"identify", IDENTIFY},       {"import_events", IMPORT_EVENTS},
    {"master_sim", MASTER_SIM},   {"observer", OBSERVER},
    {"reduce", REDUCE},           {"sync_logger", SYNC_LOGGER}};

}  // namespace

std::string scene(const std::string& name) {
  return std::string(SPRAG_SOURCE_DIR) + "/scenes/" + name + ".toml";
}

std::vector<SyncLine> read_sync(const std::filesystem::path& file) {
  std::vector<SyncLine> rows;
  LineReader reader(file);
  std::string_view line;
  std::vector<std::string_view> fields;
  LineReader::Result result = reader.next(line);
  EXPECT_TRUE(result == LineReader::Result::line && line.starts_with("k,t,V,V1")) << file;
  while ((result = reader.next(line)) == LineReader::Result::line) {
    split_fields(line, fields);
    if (fields.size() < 4) break;
    const auto k = parse_integer(fields[0]);
    const auto t = parse_double(fields[1]);
    const auto v = parse_double(fields[2]);
    if (!k || !t || !v) break;
    rows.push_back({*k, *t, *v});
  }
  EXPECT_EQ(result, LineReader::Result::end) << file << ':' << reader.number() << ": " << line;
  return rows;
}

std::vector<StateLine> read_states_file(const std::filesystem::path& file) {
  std::vector<StateLine> rows;
  StatesReader reader(file);
  StateRow row;
  while (reader.next(row)) {
    StateLine& line = rows.emplace_back();
    line.k = row.k;
    line.t = row.t;
    line.values.assign(row.q.begin(), row.q.end());
    line.values.insert(line.values.end(), row.u.begin(), row.u.end());
  }
  EXPECT_FALSE(reader.damage()) << file << ':' << reader.damage()->line << ": "
                                << reader.damage()->what;
  return rows;
}

std::vector<double> read_column(const std::filesystem::path& file, const std::string& name) {
  std::istringstream lines(read_text(file));
  std::string line, cell;
  std::getline(lines, line);
  std::size_t column = 0;
  std::istringstream header(line);
  while (std::getline(header, cell, ',') && cell != name) ++column;
  EXPECT_EQ(cell, name) << file;
  std::vector<double> values;
  while (cell == name && std::getline(lines, line)) {
    std::istringstream row(line);
    std::string value;
    for (std::size_t i = 0; i <= column; ++i) std::getline(row, value, ',');
    values.push_back(std::strtod(value.c_str(), nullptr));
  }
  return values;
}

std::size_t count_rows(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  return static_cast<std::size_t>(std::max<std::ptrdiff_t>(std::ranges::count(text, '\n') - 1, 0));
}

void EndToEnd::SetUp() {
  deadline_ = std::chrono::steady_clock::now() + patience;
  ::alarm(alarm_seconds);  // last resort: the programs end with this process
}

void EndToEnd::TearDown() {
  for (const auto& process : processes_) process->kill();
  ::alarm(0);
  if (!HasFailure()) return;
  for (const auto& process : processes_) {
    std::cerr << "---- stderr of " << process->label() << ":\n" << process->err();
  }
}

std::chrono::milliseconds EndToEnd::left() const {
  const auto rest =
      std::chrono::ceil<std::chrono::milliseconds>(deadline_ - std::chrono::steady_clock::now());
  return std::max(rest, std::chrono::milliseconds(0));
}

Process& EndToEnd::start_command(const Arguments& command) {
  const std::string label = std::to_string(processes_.size()) + "_" +
                            std::filesystem::path(command.front()).filename().string();
  return *processes_.emplace_back(std::make_unique<Process>(command, directory_ / "", label));
}

// While the logger waits for a disk it writes nothing, and at its end it drops its queue. So it
// flushes to the disk only at its end.
Process& EndToEnd::start_recorder(const std::string& log, const std::string& channels) {
  Process& recorder = start_command(
      {LCM_LOGGER, "--lcm-url=" + url_, "-q", "--flush-interval=1000000", "-c", channels, log});
  EXPECT_TRUE(in_time([&] { return std::filesystem::exists(log); }));
  std::this_thread::sleep_for(200ms);
  return recorder;
}

void EndToEnd::end_recorder(Process& recorder) {
  std::this_thread::sleep_for(1s);  // messages may still be under way on a busy machine
  recorder.signal(SIGINT);
  end_of(recorder);
}

Process& EndToEnd::start(const std::string& program, const Arguments& arguments) {
  return start_command(Arguments{programs.at(program), "--url", url_} + arguments);
}

Ended EndToEnd::run(const std::string& program, const Arguments& arguments) {
  return end_of(start(program, arguments));
}

Ended EndToEnd::end_of(Process& process) { return end_of(process, left()); }

Ended EndToEnd::end_of(Process& process, std::chrono::milliseconds timeout) {
  const auto code = process.wait(timeout);
  if (!code) {
    ADD_FAILURE() << process.label() << " has not ended";
    process.kill();
  }
  return {code.value_or(-1), process.out(), process.err()};
}

Process& EndToEnd::start_listening(const std::string& program, const Arguments& arguments) {
  Process& process = start(program, arguments);
  EXPECT_TRUE(in_time([&] {
    return process.err().find("listening") != std::string::npos || !process.running();
  })) << program
      << " does not listen";
  return process;
}

Process& EndToEnd::start_master(const Arguments& arguments) {
  const std::string events = file("events_" + std::to_string(processes_.size()) + ".csv");
  const bool own = std::ranges::find(arguments, "--events") != arguments.end();
  Process& process =
      start("master_sim", own ? arguments : arguments + Arguments{"--events", events});
  const std::string path = own ? *(std::ranges::find(arguments, "--events") + 1) : events;
  EXPECT_TRUE(in_time([&] { return std::filesystem::exists(path) || !process.running(); }));
  return process;
}

void EndToEnd::wait_for_time(Process& master, double t) {
  EXPECT_TRUE(in_time([&] {
    const std::string progress = master.err();
    const std::size_t last = progress.rfind("t ");
    const bool there = last != std::string::npos && std::atof(progress.c_str() + last + 2) >= t;
    return there || !master.running();
  }));
  EXPECT_TRUE(master.running()) << "the master ended before t = " << t;
}

nlohmann::json EndToEnd::json(const std::string& name) const {
  return nlohmann::json::parse(text(name), nullptr, false);
}

std::string EndToEnd::simulate(const std::string& scene_file, const std::string& duration,
                               const std::string& tick) {
  const Ended ended =
      run("master_sim", {scene_file, "--no-lcm", "--speed", "max", "--duration", duration, "--tick",
                         tick, "--events", file("events.csv"), "--states", file("truth.csv")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  return file("events.csv");
}

std::string EndToEnd::replay(const std::string& scene_file, const std::string& recording,
                             const Arguments& more) {
  const std::string states = file("replay_" + std::to_string(replays_++) + ".csv");
  const Ended ended =
      run("observer", Arguments{scene_file, "--replay", recording, "--states", states} + more);
  EXPECT_EQ(ended.code, 0) << ended.err;
  return states;
}

}  // namespace sprag::test
