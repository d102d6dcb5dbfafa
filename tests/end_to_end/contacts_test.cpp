// A live observer of machines with dependent contacts, and with many contacts.
#include <algorithm>
#include <csignal>
#include <fstream>
#include <sstream>

#include "sprag/detail/files/events_writer.h"
#include "tests/end_to_end/fixture.h"
#include "tests/end_to_end/played_master.h"

namespace sprag::test {
namespace {

using enum ContactEventKind;

class ContactsTest : public EndToEnd {
 protected:
  /// Sends `events` to a live observer, whose result must equal its replay of the same events.
  nlohmann::json observe(const std::string& machine, const std::string& estimator, int contacts,
                         const std::vector<ContactEvent>& events, std::string& err) {
    EventsWriter writer(file("events.csv"));
    for (const ContactEvent& event : events) writer.write(event);
    EXPECT_TRUE(writer.close());
    const Arguments how{"--duration", "1", "--estimator", estimator};
    Process& observer = start_listening(
        "observer",
        Arguments{machine, "--states", file("live.csv"), "--report", file("live.json")} + how);
    PlayedMaster master(url(), contacts);
    master.add(events);
    master.play_until(1.25);
    const Ended ended = end_of(observer);
    EXPECT_EQ(ended.code, 0) << ended.err;
    err = ended.err;
    EXPECT_TRUE(text("live.csv") == read_text(replay(machine, file("events.csv"), how)))
        << "live differs from the replay";
    return json("live.json");
  }
};

// Both stops of the beam are reported closed: w and -w.
TEST_F(ContactsTest, OppositeContactsAreHeldTogether) {
  std::string err;
  const nlohmann::json report = observe(scene("two_stops_beam"), "both", 2,
                                        {{0.1, 1, closes},
                                         {0.2, 0, closes},
                                         {0.5, 1, opens},
                                         {0.6, 1, closes},
                                         {0.8, 0, opens},
                                         {0.9, 1, opens}},
                                        err);
  EXPECT_GE(report["redundant_closings"], 1);
  EXPECT_EQ(report["refused_impacts"], 0);
  EXPECT_NE(err.find("contact 1 is reported closed beside others that hold its direction"),
            std::string::npos)
      << err;
}

// With both contacts locked, a pair of modes with one shape remains, which has no exact flow. The
// observer leaves one of them open and reports it.
TEST_F(ContactsTest, IncompatibleClosedContactsAreReported) {
  std::ofstream(file("defective.toml")) << R"(
force = [{ direction = [0, 0, -1, -1], constant = 3 }]
contact = [{ direction = [0, 0, 1, 0], clearance = 0.2 },
           { direction = [0, 0, 0, 1], clearance = 0.2 }]
impact = { restitution = 0 }
master = { q = [0, 0, 0, 0] }
replica = { q = [0.1, 0.1, 0, 0], uncertainty = 1 }
[system]
M = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
C = [[0.4, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0.1, 0], [0, 0, 0, 0.1]]
K = [[1.04, 0.2, -0.1, -0.1], [0.2, 1, -0.1, -0.2], [-0.1, -0.1, 5, 0], [-0.1, -0.2, 0, 4]]
)";
  std::string err;
  const nlohmann::json report =
      observe(file("defective.toml"), "replica", 2,
              {{0.1, 0, closes}, {0.2, 1, closes}, {0.9, 0, opens}, {0.9, 1, opens}}, err);
  EXPECT_GE(report["refused_impacts"], 1);
  EXPECT_NE(err.find("cannot be held together"), std::string::npos) << err;
  EXPECT_TRUE(report["confidence"]["bound"]["final"].is_null());
}

/// A beam with `contacts` contacts.
std::string beam_with(int contacts) {
  std::ostringstream text;
  text << "[beam]\nmodes = " << contacts
       << "\nlength = 1.0\nbending_stiffness = 1.0\nmass_per_length = 1.0\n"
          "damping = 0.17\n[excitation]\namplitude = 0.03\nfrequency = 9.5\n"
          "[impact]\nlaw = \"poisson\"\nrestitution = 0.7\n";
  for (int i = 1; i <= contacts; ++i) {
    text << "[[contact]]\nposition = " << 0.3 + 0.7 * i / contacts << "\nclearance = 0.05\n";
  }
  text << "[master]\nq = [-0.05]\nu = [0.0]\n[replica]\nq = [0.1]\nu = [0.0]\n";
  return text.str();
}

/// Largest resident memory [MB] of a process so far.
double largest_memory(const Process& process) {
  const std::string status = read_text("/proc/" + std::to_string(process.id()) + "/status");
  return std::stod(status.substr(status.find("VmHWM:") + 6)) / 1024.0;
}

// The sets of two locked contacts, built at start, would take a gigabyte.
TEST_F(ContactsTest, SixtyOfABeamWithSixtyModesStartSmall) {
  if (sanitized) GTEST_SKIP() << "a sanitizer takes its own memory";
  std::ofstream(file("sixty.toml")) << beam_with(60);
  Process& observer = start_listening("observer", {file("sixty.toml"), "--estimator", "both"});
  std::this_thread::sleep_for(1s);
  EXPECT_LE(largest_memory(observer), 64.0);
}

// Sets of locked contacts without a prepared flow: the flow builder builds them beside the loop,
// with the same result.
TEST_F(ContactsTest, ManyCombinationsEqualTheReplay) {
  constexpr int contacts = sanitized ? 16 : 60;
  std::ofstream(file("many.toml")) << beam_with(contacts);
  std::vector<ContactEvent> events;
  for (int i = 0; i < 12; ++i) events.push_back({0.1 + 0.01 * i, (7 * i) % contacts, closes});
  for (int i = 0; i < 12; ++i) events.push_back({0.5 + 0.01 * i, (7 * i) % contacts, opens});
  std::string err;
  const nlohmann::json report = observe(file("many.toml"), "replica", contacts, events, err);
  if (!sanitized) {
    EXPECT_GT(report["flows_awaited"], 0);
  }
}

}  // namespace
}  // namespace sprag::test
