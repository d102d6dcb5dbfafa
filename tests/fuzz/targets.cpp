#include "tests/fuzz/targets.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/messages.h"
#include "lcmtypes/udp_receiver.h"
#include "observer/master_clock.h"
#include "recording/session_tracker.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/scene_file.h"
#include "tests/support/tracking_estimators.h"

namespace sprag::fuzz {
namespace {

void require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

/// A file in memory with a path.
class MemoryFile {
 public:
  explicit MemoryFile(Input content = {}) : descriptor_(::memfd_create("fuzz", 0)) {
    require(descriptor_ >= 0, "memfd_create");
    require(::write(descriptor_, content.data(), content.size()) ==
                static_cast<ssize_t>(content.size()),
            "write");
  }
  ~MemoryFile() { ::close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

/// Takes values from the front of the input; zeros after its end.
class Reader {
 public:
  explicit Reader(Input input) : rest_(input) {}

  bool empty() const { return rest_.empty(); }

  template <typename Value>
  Value value() {
    Value result{};
    const std::size_t size = std::min(sizeof result, rest_.size());
    std::copy_n(rest_.begin(), size, reinterpret_cast<std::uint8_t*>(&result));
    rest_ = rest_.subspan(size);
    return result;
  }

  Input bytes(std::size_t count) {
    const Input result = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(result.size());
    return result;
  }

  /// Often a plausible time, sometimes any double.
  double time() {
    const auto kind = value<std::uint8_t>();
    return kind % 8 == 0 ? value<double>() : 1e-2 * value<std::uint16_t>();
  }

 private:
  Input rest_;
};

/// A report with the right hash and arbitrary fields.
std::vector<std::uint8_t> report_of(Reader& reader) {
  ContactMessage report;
  report.session = reader.value<std::uint8_t>() % 3;
  report.sequence = reader.value<std::int16_t>();
  report.utime = reader.value<std::int64_t>();
  report.speed = reader.value<std::uint8_t>() % 4 == 0 ? reader.value<double>() : 1.0;
  report.horizon = reader.time();
  report.closed = reader.value<std::uint8_t>() % 4;
  report.contacts = reader.value<std::uint8_t>() % 4 == 0 ? reader.value<std::int32_t>() : 2;
  report.records = reader.value<std::uint8_t>() % 16;
  report.records_total = reader.value<std::uint8_t>() % 4 == 0 ? reader.value<std::int64_t>()
                                                               : reader.value<std::uint8_t>();
  for (int i = 0; i < report.records; ++i) {
    const auto what = reader.value<std::uint8_t>();
    report.record[static_cast<std::size_t>(i)] = {reader.time(), what % 3,
                                                  static_cast<ContactEventKind>(what / 3 % 5)};
  }
  std::vector<std::uint8_t> message;
  encode(report, message);
  return message;
}

Model machine() {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = 0.1 * Eigen::MatrixXd::Identity(1, 1);
  model.K = Eigen::MatrixXd::Identity(1, 1);
  for (int i = 0; i < 2; ++i) {
    Contact contact;
    contact.w = Eigen::VectorXd::Constant(1, i == 0 ? 1.0 : -1.0);
    contact.clearance = 0.5;
    contact.restitution = 0.7;
    model.contacts.push_back(contact);
  }
  return model;
}

}  // namespace

void message(Input input) {
  static const Model model = machine();
  static ReplicaEstimator replica(model, 1e-2);
  const State start{Eigen::VectorXd::Constant(1, 0.3), Eigen::VectorXd::Zero(1)};
  TimeLine line(replica, 2, start, 16);
  SessionTracker sessions(Freshness::any, 1e-2);
  MasterClock clock;
  Reader reader(input);
  Arrival arrival{1'000'000'000, 1'700'000'000'000'000};
  std::int64_t next_settled = 0;
  state_t state{};
  estimate_t estimate{};
  health_t health{};
  outputs_t outputs{};
  bounds_t bounds{};
  parameters_t parameters{};
  while (!reader.empty()) {
    arrival.monotonic += 1'000'000LL * reader.value<std::uint8_t>();
    arrival.wall += 1000LL * reader.value<std::uint8_t>();
    ContactMessage report;
    if (reader.value<std::uint8_t>() % 8 == 0) {
      const Input bytes = reader.bytes(reader.value<std::uint16_t>());
      (void)decode(bytes, state);
      (void)decode(bytes, estimate);
      (void)decode(bytes, health);
      (void)decode(bytes, outputs);
      (void)decode(bytes, bounds);
      (void)decode(bytes, parameters);
      Packet packet;
      if (read_packet(bytes, packet) != PacketFault::none) continue;
      if (decode(packet.data, report) != Refusal::none) continue;
    } else if (decode(report_of(reader), report) != Refusal::none) {
      continue;
    }
    if (report.contacts != 2) continue;
    switch (sessions.receive(report, arrival)) {
      case SessionTracker::Verdict::ignored:
        continue;
      case SessionTracker::Verdict::starts:
        clock.restart();
        clock.observe(report, arrival);
        line.restart(report);
        next_settled = line.handed_out() + 1;
        break;
      case SessionTracker::Verdict::continues:
        clock.observe(report, arrival);
        if (line.receive(report)) next_settled = line.handed_out() + 1;
        break;
      case SessionTracker::Verdict::resumes:
        clock.restart();
        clock.observe(report, arrival);
        if (line.resume(report)) next_settled = line.handed_out() + 1;
        break;
    }
    const double now = clock.simulated(arrival.monotonic);
    (void)clock.local(now);
    line.run(
        now > 0.0 ? last_tick(now, line.h()) : 0, [](const auto&) {},
        [&](const auto& settled) {
          require(settled.tick == next_settled++, "settled ticks come once and in order");
          require(settled.tick <= line.settled_tick(), "settled ticks are settled");
          return true;
        },
        64);
    const auto& events = line.events().events();
    require(std::is_sorted(events.begin(), events.end(),
                           [](const auto& a, const auto& b) { return a.t < b.t; }),
            "events are in order");
  }
}

void log(Input input) {
  const MemoryFile file(input);
  ChannelLogReader reader(file.path());
  ChannelRecord record;
  const MemoryFile copy;
  ChannelLogWriter writer(copy.path());
  std::size_t bytes = 0;
  int records = 0;
  while (reader.next(record)) {
    bytes += record.channel.size() + record.data.size();
    ++records;
    writer.write(record.utime, record.channel, record.data);
  }
  require(bytes <= input.size(), "no more is read than is there");
  require(writer.close(), "what was read can be written");
  ChannelLogReader again(copy.path());
  while (again.next(record)) --records;
  require(records == 0 && again.damages().empty(), "what was written is read again");
}

void events(Input input) {
  constexpr int contacts = 3;
  const MemoryFile file(input);
  EventsFile read;
  try {
    read = read_events(file.path(), contacts);
  } catch (const InputError&) {  // of another machine
    return;
  }
  ContactSet chi = 0;
  double last = 0.0;
  const MemoryFile copy;
  EventsWriter writer(copy.path());
  for (const ContactEvent& event : read.events) {
    require(event.t >= last, "events are in order");
    require(event.contact >= 0 && event.contact < contacts, "contacts are the machine's");
    require(contains(chi, event.contact) == (event.kind == ContactEventKind::opens),
            "events do not contradict each other");
    chi = after(chi, event);
    last = event.t;
    writer.write(event);
  }
  require(writer.close(), "what was read can be written");
  const EventsFile again = read_events(copy.path(), contacts);
  require(!again.damage && again.skipped.empty() && again.events == read.events,
          "what was written is read again");
}

void scene(Input input) {
  constexpr Eigen::Index most_coordinates = 12;
  try {
    const Scene read =
        parse_scene({reinterpret_cast<const char*>(input.data()), input.size()}, "fuzz.toml");
    if (read.model.coordinates() > most_coordinates) return;
    Replica replica(read.model, 1e-2);
    Replica::State state;
    replica.start(read.prior.start, 0, 0, state);
    for (int k = 0; k < 3; ++k) replica.tick({}, state);
    require(state.tick == 3, "a replica ticks");
  } catch (const SceneError&) {
  } catch (const ModelError&) {
  }
}

}  // namespace sprag::fuzz
