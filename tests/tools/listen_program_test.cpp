// listen as a process: a pipe, a pseudo-terminal and a socket, many edges, damaged lines, devices
// that restart and leave, and an observer that follows it.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/events_file.h"
#include "tests/support/program_test.h"
#include "tests/support/random.h"
#include "tests/support/streamed_scene.h"
#include "tests/support/udp_url.h"

namespace sprag {
namespace {

using enum ContactEventKind;
using test::Arguments;
using test::eventually;
using test::Process;
using test::read_text;
using test::streamed_scene;
using test::operator+;  // NOLINT(misc-unused-using-decls): used by operators
using test::write_text;

constexpr auto patience = std::chrono::seconds(120);  // of a hang

/// The device's end of a connection.
class Wire {
 public:
  Wire() = default;
  explicit Wire(int descriptor) : descriptor_(descriptor) {}
  Wire(Wire&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Wire& operator=(Wire&& other) noexcept {
    hang_up();
    descriptor_ = std::exchange(other.descriptor_, -1);
    return *this;
  }
  ~Wire() { hang_up(); }

  void send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
      ASSERT_GT(count, 0);
      bytes.remove_prefix(static_cast<std::size_t>(count));
    }
  }
  void hang_up() {
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  }

 private:
  int descriptor_ = -1;
};

struct Log {
  std::vector<std::vector<ContactEvent>> sessions;
  double horizon = -1.0;  // of the last message
};

/// The events of a log, by session. Each session ends before the next one begins.
Log read_log(const std::filesystem::path& file, const std::optional<Key>& key = std::nullopt) {
  Log result;
  std::vector<std::int64_t> known;
  ChannelLogReader reader(file);
  ChannelRecord record;
  ContactMessage message;
  while (reader.next(record)) {
    EXPECT_EQ(record.channel, contacts_channel);
    std::span<const std::uint8_t> data(record.data);
    if (key) data = data.first(data.size() - Key::tag_size);
    EXPECT_EQ(decode(data, message), Refusal::none);
    auto found = std::ranges::find(known, message.session);
    if (found == known.end()) {
      known.push_back(message.session);
      result.sessions.emplace_back();
      found = known.end() - 1;
    }
    EXPECT_EQ(found, known.end() - 1) << "an ended session sends on";
    auto& events = result.sessions[static_cast<std::size_t>(found - known.begin())];
    const auto first = message.records_total - message.records;
    EXPECT_LE(first, std::ssize(events)) << "events are missing between two messages";
    for (std::int64_t i = std::ssize(events); i < message.records_total; ++i)
      events.push_back(message.record[static_cast<std::size_t>(i - first)]);
    result.horizon = message.horizon;
  }
  EXPECT_TRUE(reader.damages().empty());
  return result;
}

class ListenProgramTest : public test::ProgramTest {
 protected:
  Process& start(const Arguments& arguments) {
    Arguments command = arguments;
    const std::string label = std::to_string(processes_.size()) + "_" +
                              std::filesystem::path(command.front()).filename().string();
    return *processes_.emplace_back(std::make_unique<Process>(command, directory_ / "", label));
  }

  Arguments listen(const Arguments& more) const {
    Arguments command{LISTEN,     scene_,
                      "--url",    url_,
                      "--report", path("report.json"),
                      "--record", path("run.lcmlog")};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }

  /// Starts listen with its standard input at a pipe, whose other end is `wire`.
  Process& start_at_pipe(const Arguments& more, Wire& wire) {
    const std::string pipe = path("pipe");
    EXPECT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    Arguments command{"sh", "-c", "exec \"$@\" < \"$0\"", pipe};
    const Arguments program = listen(more);
    command.insert(command.end(), program.begin(), program.end());
    Process& process = start(command);
    wire = Wire(::open(pipe.c_str(), O_WRONLY | O_CLOEXEC));
    return process;
  }

  /// A pseudo-terminal to which path("tty") leads.
  Wire open_terminal() {
    const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    EXPECT_EQ(::grantpt(terminal), 0);
    EXPECT_EQ(::unlockpt(terminal), 0);
    std::error_code none;
    std::filesystem::remove(path("tty"), none);
    std::filesystem::create_symlink(::ptsname(terminal), path("tty"));
    termios settings{};
    ::tcgetattr(terminal, &settings);
    ::cfmakeraw(&settings);
    ::tcsetattr(terminal, TCSANOW, &settings);
    return Wire(terminal);
  }

  Process& start_at_terminal(const Arguments& more, Wire& wire) {
    wire = open_terminal();
    Arguments arguments{"--serial", path("tty"), "--baud", "115200"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Process& process = start(listen(arguments));
    // The port is open. What arrives first may be the end of a line.
    wait_for(process, "no line for");
    wire.send("\n");
    return process;
  }

  static Wire connect_to(int port) {
    const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return Wire(client);
  }

  int port_of(Process& process) {
    const std::string before = "listening on 127.0.0.1:";
    wait_for(process, before);
    const std::string text = process.err();
    return std::stoi(text.substr(text.find(before) + before.size()));
  }

  Process& start_at_port(const Arguments& more, Wire& wire) {
    Arguments arguments{"--tcp", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Process& process = start(listen(arguments));
    wire = connect_to(port_of(process));
    return process;
  }

  static void wait_for(Process& process, const std::string& message) {
    ASSERT_TRUE(
        eventually([&] { return process.err().find(message) != std::string::npos; }, patience))
        << message << " in\n"
        << process.err();
  }

  /// A signal ends it, with exit code 0 only if it ends by itself within 0.9 s.
  static void interrupt(Process& process) {
    process.signal(SIGINT);
    EXPECT_EQ(process.wait(patience), 0) << process.err();
  }

  nlohmann::json report() const { return test::parse_json(read_text(directory_ / "report.json")); }

  std::string scene_ = SPRAG_SOURCE_DIR "/scenes/two_stops_beam.toml";
  std::string url_ = test::udp_url();
  std::vector<std::unique_ptr<Process>> processes_;
};

/// Edges of two contacts, 100 us apart, as a device prints them whose counter wraps at 2^32 us.
struct Stream {
  std::string bytes;
  std::vector<ContactEvent> events;
  std::int64_t bad_lines = 0;
};

Stream many_edges(int count, bool damaged, std::uint64_t seed) {
  Random random(seed);
  Stream stream;
  std::uint64_t time = (std::uint64_t{1} << 32) - static_cast<std::uint64_t>(count) * 50;
  std::array<int, 2> levels{0, 0};
  for (int i = 0; i < count; ++i, time += 100) {
    const int contact = random.integer(0, 1);
    int& level = levels[static_cast<std::size_t>(contact)];
    level = 1 - level;
    const std::string line = std::to_string(time % (std::uint64_t{1} << 32)) + "," +
                             std::to_string(contact + 1) + "," + std::to_string(level);
    if (damaged && random.chance(0.02)) {
      // A line that lost some bytes, and noise. The whole line follows.
      stream.bytes +=
          random.chance(0.5) ? line.substr(0, line.size() - 3) + "\n" : "\x1b[2J\xff\x80,\n";
      ++stream.bad_lines;
    }
    stream.bytes += line + (damaged && random.chance(0.5) ? "\r\n" : "\n");
    stream.events.push_back(
        {1e-6 * static_cast<double>(time), contact, level != 0 ? closes : opens});
  }
  return stream;
}

// 10 000 edges a second, torn at any byte, with CRLF, damaged lines and a counter that wraps.
TEST_F(ListenProgramTest, TenThousandEdgesASecondAreAllPublished) {
  constexpr int count = 20000;
  const Stream stream = many_edges(count, true, 7);
  Wire wire;
  char duration[32];
  std::snprintf(duration, sizeof duration, "%.17g", stream.events.back().t);
  // On a busy machine lines may wait.
  Process& process = start_at_terminal(
      {"--unit", "us", "--counter-bits", "32", "--latency", "60", "--duration", duration}, wire);
  Random random(8);
  const auto began = std::chrono::steady_clock::now();
  for (std::size_t at = 0; at < stream.bytes.size();) {
    const auto size =
        std::min(static_cast<std::size_t>(random.integer(1, 400)), stream.bytes.size() - at);
    wire.send(std::string_view(stream.bytes).substr(at, size));
    at += size;
    const double done = static_cast<double>(at) / static_cast<double>(stream.bytes.size());
    std::this_thread::sleep_until(began + std::chrono::duration<double>(1e-4 * count * done));
  }
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  const Log recorded = read_log(directory_ / "run.lcmlog");
  ASSERT_EQ(recorded.sessions.size(), 1U) << process.err();
  ASSERT_EQ(recorded.sessions[0].size(), stream.events.size()) << process.err();
  for (std::size_t i = 0; i < stream.events.size(); ++i) {
    const ContactEvent& event = recorded.sessions[0][i];
    ASSERT_EQ(event.contact, stream.events[i].contact) << i;
    ASSERT_EQ(event.kind, stream.events[i].kind) << i;
    ASSERT_NEAR(event.t, stream.events[i].t, 1e-9) << i;
  }
  EXPECT_EQ(report()["edges"], count);
  EXPECT_EQ(report()["bad_lines"], stream.bad_lines);
  EXPECT_EQ(report()["wraps"], 1);
  EXPECT_EQ(report()["unsent"], 0);
  EXPECT_EQ(process.err().find('\x1b'), std::string::npos) << "control characters of a line";
}

TEST_F(ListenProgramTest, ASerialPortThatWasGoneIsOpenedAgain) {
  Wire wire;
  Process& process = start_at_terminal({"--duration", "7.1", "--latency", "60"}, wire);
  wire.send("1,1,1\n");
  wait_for(process, "lines arrive again");
  wire.hang_up();
  std::filesystem::remove(path("tty"));
  wait_for(process, "the device is gone");
  wire = open_terminal();
  wait_for(process, "the device is back");
  wire.send("\n7,1,1\n7.1,1,0\n");
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  const Log recorded = read_log(directory_ / "run.lcmlog");
  EXPECT_EQ(recorded.sessions[0], (std::vector<ContactEvent>{{1.0, 0, closes}}));
  EXPECT_EQ(recorded.sessions[1], (std::vector<ContactEvent>{{7.0, 0, closes}, {7.1, 0, opens}}));
  EXPECT_EQ(report()["reconnections"], 1);
}

// The first bytes after a port is opened may be the end of a line, and a number that lacks digits
// looks like another one.
TEST_F(ListenProgramTest, ALineThatWasUnderWayWhenThePortWasOpenedIsSkipped) {
  Wire wire = open_terminal();
  Process& process = start(listen({"--serial", path("tty"), "--duration", "5"}));
  // The device prints all the time, and the port is opened in the midst of a line.
  ASSERT_TRUE(eventually(
      [&] {
        for (int i = 0; i < 1000; ++i) wire.send("12345678");
        return process.err().find("may have lost its begin") != std::string::npos;
      },
      patience))
      << process.err();
  wire.send(",1,1\n5,1,1\n");
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  EXPECT_EQ(report()["lines"], 1);
  EXPECT_EQ(report()["bad_lines"], 0) << process.err();
  EXPECT_EQ(read_log(directory_ / "run.lcmlog").sessions,
            (std::vector<std::vector<ContactEvent>>{{{5.0, 0, closes}}}));
}

TEST_F(ListenProgramTest, AnotherClientOfThePortBeginsANewSession) {
  Wire wire;
  Process& process = start_at_port({"--duration", "4"}, wire);
  wire.send("1,1,1\n1.01,1,");
  wire.hang_up();
  wait_for(process, "the client is gone");
  wire = connect_to(port_of(process));
  wire.send("4,2,1\n");
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  EXPECT_EQ(read_log(directory_ / "run.lcmlog").sessions,
            (std::vector<std::vector<ContactEvent>>{{{1.0, 0, closes}}, {{4.0, 1, closes}}}));
  EXPECT_NE(process.err().find(":2: the line is not complete; skipped: '1.01,1,'"),
            std::string::npos)
      << process.err();
}

TEST_F(ListenProgramTest, MessagesAreSignedAndRecordedWithTheirTags) {
  const std::string key = path("key");
  write_text(key, "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f\n");
  Wire wire;
  Process& process = start_at_pipe({"--key", key, "--speed", "max"}, wire);
  wire.send("1,1,1\n2,1,0\n");
  wire.hang_up();
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  EXPECT_EQ(read_log(directory_ / "run.lcmlog", Key(key)).sessions[0].size(), 2U);
  // The observer with this key accepts the tags.
  const Ended ended = run(OBSERVER, {scene_, "--replay", path("run.lcmlog"), "--key", key,
                                     "--events", path("events.csv"), "--tick", "0.5"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(read_text(directory_ / "events.csv"), "t,contact,closed\n1,1,1\n2,1,0\n");
}

/// Rows of a data logger: time, level, acceleration. The times of samples are those of the record;
/// a row without an acceleration is an edge. A pulse opens again after 10 us, or before the next
/// event.
std::vector<std::pair<double, std::string>> logger_rows(const std::vector<ContactEvent>& events,
                                                        const std::string& record) {
  std::map<double, std::pair<int, std::string>> changes;  // level, or -1, and sample
  for (std::size_t i = 0; i < events.size(); ++i) {
    const double t = events[i].t, next = i + 1 < events.size() ? events[i + 1].t : t + 1.0;
    changes[t].first = events[i].kind == opens ? 0 : 1;
    if (events[i].kind == pulse) changes[t + std::min(1e-5, 0.5 * (next - t))].first = 0;
  }
  std::istringstream samples(record);
  std::string line;
  std::getline(samples, line);
  while (std::getline(samples, line)) {
    const auto [at, is_new] = changes.try_emplace(std::stod(line), -1, "");
    EXPECT_TRUE(is_new);
    at->second.second = line.substr(line.find(',') + 1);
  }
  std::vector<std::pair<double, std::string>> rows;
  int level = 0;
  for (const auto& [t, change] : changes) {
    if (change.first >= 0) level = change.first;
    char start[40];
    std::snprintf(start, sizeof start, "%.15f,%d,", t, level);
    rows.emplace_back(t, start + change.second + "\n");
  }
  return rows;
}

// The excitation of the machine is known from the rows only, not from the record.
TEST_F(ListenProgramTest, TheEstimateOfAShakenMachineEqualsItsReplayAndTheMachine) {
  scene_ = write_text(path("streamed.toml"), streamed_scene());
  const Ended simulated =
      run(MASTER_SIM, {scene_, "--duration", "6", "--speed", "max", "--no-lcm", "--tick", "0.005",
                       "--events", path("machine.csv"), "--states", path("true.csv")});
  ASSERT_EQ(simulated.code, 0) << simulated.err;
  const auto rows = logger_rows(read_events(directory_ / "machine.csv", 1).events,
                                read_text(SPRAG_SOURCE_DIR "/scenes/records/swept_base.csv"));
  const auto observe = [&](const Arguments& source, const std::string& states) -> Process& {
    return start(Arguments{OBSERVER, scene_, "--duration", "5.9", "--tick", "0.005", "--states",
                           path(states)} +
                 source);
  };
  Process& observer = observe({"--url", url_}, "live.csv");
  wait_for(observer, "waiting for a master");
  Wire wire;
  Process& process =
      start_at_pipe({"--speed", "4", "--latency", "60", "--columns", "time,hit,ax", "--level",
                     "1=hit", "--input", "ax", "--pulse-shorter-than", "2e-5"},
                    wire);
  const auto began = std::chrono::steady_clock::now();
  for (const auto& [t, row] : rows) {
    std::this_thread::sleep_until(began + std::chrono::duration<double>(t / 4.0));
    wire.send(row);
  }
  wire.hang_up();
  EXPECT_EQ(process.wait(patience), 0) << process.err();
  EXPECT_EQ(observer.wait(patience), 0) << observer.err();
  Process& offline = observe({"--replay", path("run.lcmlog")}, "replay.csv");
  EXPECT_EQ(offline.wait(patience), 0) << offline.err();
  const std::string states = read_text(directory_ / "live.csv");
  EXPECT_TRUE(states == read_text(directory_ / "replay.csv"));
  EXPECT_EQ(std::ranges::count(states, '\n'), 1182);
  StatesReader estimate(directory_ / "live.csv"), truth(directory_ / "true.csv");
  StateRow a, b;
  while (estimate.next(a) && truth.next(b)) {
    if (a.t > 4.5) {
      EXPECT_NEAR(a.q[0], b.q[0], 1e-6) << "tick " << a.k;
    }
  }
  EXPECT_EQ(report()["bad_lines"], 0) << process.err();
  EXPECT_EQ(report()["input"]["samples"], 3001);
  EXPECT_EQ(report()["input"]["missing_samples"], 0);
  EXPECT_EQ(report()["unsent"], 0);
}

TEST_F(ListenProgramTest, ASignalEndsItWhereverItWaits) {
  Wire wire;
  Process& at_pipe = start_at_pipe({}, wire);
  wait_for(at_pipe, "no line for");
  interrupt(at_pipe);
  Process& at_port = start(listen({"--tcp", "0"}));
  (void)port_of(at_port);
  interrupt(at_port);
}

TEST_F(ListenProgramTest, BadUsageIsRefusedWithExitCode2) {
  write_text(path("plain"), "1,1,1\n");
  const std::string clocked =
      write_text(path("clock.toml"), read_text(scene_) + "\n[clock]\nrate = 1.0002\n");
  const std::string streamed = write_text(path("streamed.toml"), streamed_scene());
  const struct {
    std::string scene;
    Arguments arguments;
    const char* why;
  } cases[] = {
      {scene_, {"--serial", path("absent")}, "cannot be opened"},
      {scene_, {"--serial", path("plain")}, "is not a serial port"},
      {scene_, {"--serial", path("plain"), "--baud", "12345"}, "--baud is 12345"},
      {scene_, {"--serial", path("plain"), "--tcp", "0"}, "--tcp"},
      {scene_, {"--baud", "9600"}, "--serial"},
      {scene_, {"--tcp", "192.168.0.1:5"}, "127.0.0.1:PORT"},
      {scene_, {"--tcp", "65536"}, "65535"},
      {scene_, {"--level", "3=D0"}, "contact 3"},
      {scene_, {"--columns", "a,b"}, "--time NAME"},
      {scene_, {"--stamp", "arrival", "--speed", "max"}, "--speed"},
      {scene_, {"--impacts-at", "rising", "--pulse-shorter-than", "1"}, "--pulse-shorter-than"},
      {scene_, {"--record", path("x.csv")}, ".lcmlog"},
      {scene_, {"--record", scene_}, "SCENE and --record are the same file"},
      {scene_, {"--unit", "h"}, "choose s, ms, us, ns"},
      {scene_, {"--counter-bits", "65"}, "from 1 to 64"},
      {scene_, {"--input", "ax"}, "must have a streamed excitation"},
      {streamed,
       {"--input", "ax", "--columns", "time,hit", "--level", "1=hit"},
       "no column 'ax' (--input)"},
      {streamed, {"--input", "ax", "--stamp", "arrival"}, "--input and --stamp arrival"},
      {clocked, {"--rate", "1.0002"}, "--rate and clock.rate"}};
  for (const auto& [scene, arguments, why] : cases) {
    const Ended ended = run(LISTEN, Arguments{scene, "--url", url_} + arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(why), std::string::npos) << ended.err;
  }
}

TEST_F(ListenProgramTest, ASourceWithoutAUsableLineIsAFailure) {
  Wire wire;
  Process& process = start_at_pipe({}, wire);
  wire.send("garbage\n");
  wire.hang_up();
  EXPECT_EQ(process.wait(patience), 1);
  EXPECT_NE(process.err().find("without an edge that can be used"), std::string::npos)
      << process.err();
}

}  // namespace
}  // namespace sprag
