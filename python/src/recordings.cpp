#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/messages.h"
#include "observer/estimation.h"
#include "observer/messages.h"
#include "python/src/bindings.h"
#include "python/src/bus.h"
#include "recording/recording.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/message_builder.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/scene.h"

namespace sprag::python {
namespace {

constexpr double microseconds = 1e6;  // per second

int number_of_contacts(const Scene& scene) { return static_cast<int>(scene.model.contacts.size()); }

Scene without_stream(Scene scene) {
  scene.stream_duration = 0.0;
  return scene;
}

class LogRecording {
 public:
  LogRecording(InputFile file, const std::optional<std::filesystem::path>& key)
      : reader_(std::move(file)), key_(to_key(key)) {}

  py::tuple next() {
    while (reader_.next(record_)) {
      appended_ |= record_.appended;
      Bytes data(record_.data);
      if (key_ && !key_->verifies(record_.channel, data)) {
        ++unauthenticated;
        continue;
      }
      if (key_) data = data.first(data.size() - Key::tag_size);
      const bool first = record_.channel == contacts_channel && std::exchange(appended_, false);
      return py::make_tuple(record_.channel, to_bytes(data), record_.utime, first);
    }
    throw py::stop_iteration();
  }

  std::vector<std::pair<std::uint64_t, std::string>> damages() const {
    std::vector<std::pair<std::uint64_t, std::string>> result;
    for (const LogDamage& damage : reader_.damages())
      result.emplace_back(damage.begin, damage.what);
    return result;
  }

  std::int64_t unauthenticated = 0;

 private:
  ChannelLogReader reader_;
  std::optional<Key> key_;
  ChannelRecord record_;
  bool appended_ = false;  // no contact message since an appended recording began
};

// An events file as the messages of a master, in the machine's time.
class EventsRecording {
 public:
  // With watermarks `step` apart [s]; 0: a thousand in all.
  EventsRecording(InputFile input, const Scene& scene, double step)
      : builder_(1, 1.0, number_of_contacts(scene)) {
    const std::string name = input.path().string();
    const auto at_line = [&](const FileProblem& problem, const char* what) {
      return name + ':' + std::to_string(problem.line) + ": " + what + problem.what;
    };
    EventsFile file = read_events(std::move(input), number_of_contacts(scene));
    if (file.implausible) {
      throw InputError(at_line(file.implausible->problem, "") + " Correct or remove the row");
    }
    for (const FileProblem& row : file.skipped) problems.push_back(at_line(row, "skipped: "));
    if (file.damage) damages.emplace_back(file.damage->line, file.damage->what);
    if (const std::size_t before = to_machine_time(scene.clock, file); before > 0) {
      problems.push_back(name + ": " + std::to_string(before) +
                         " events before the machine's t = 0, by clock.offset, left out");
    }
    events_ = std::move(file.events);
    end_ = events_.empty() ? 0.0 : events_.back().t;
    step_ = step > 0.0 ? step : end_ / 1000.0;
  }

  py::tuple next() {
    if (!builder_.pending()) {
      if (sent_ == events_.size()) throw py::stop_iteration();
      horizon_ = std::min(static_cast<double>(++steps_) * step_, end_);
      const auto first = events_.begin() + static_cast<std::ptrdiff_t>(sent_);
      while (sent_ < events_.size() && events_[sent_].t <= horizon_) ++sent_;
      builder_.add({first, events_.begin() + static_cast<std::ptrdiff_t>(sent_)});
    }
    const Bytes data = encode(builder_.next(horizon_, 0), buffer_);
    return py::make_tuple(std::string(contacts_channel), to_bytes(data),
                          std::llround(microseconds * horizon_), false);
  }

  std::vector<std::string> problems;
  std::vector<std::pair<int, std::string>> damages;

 private:
  MessageBuilder builder_;
  std::vector<std::uint8_t> buffer_;
  std::vector<ContactEvent> events_;
  double step_ = 0.0, end_ = 0.0, horizon_ = 0.0;
  std::int64_t steps_ = 0;
  std::size_t sent_ = 0;
};

py::object open_recording(const std::filesystem::path& path, const Scene& scene,
                          const std::optional<std::filesystem::path>& key, double step) {
  InputFile file(path);
  if (!is_lcm_log(file)) return py::cast(EventsRecording(std::move(file), scene, step));
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError(path.string() + ": must be a file; its content is examined first");
  }
  return py::cast(LogRecording(std::move(file), key));
}

bool has_estimates(const std::filesystem::path& file) {
  ChannelLogReader log(file);
  ChannelRecord record;
  while (log.next(record)) {
    if (record.channel == settled_channel || record.channel == estimate_channel) return true;
  }
  return false;
}

// As `observer --replay`; its settled estimates are messages.
class RecordingObserver {
 public:
  // An events file has no samples of a streamed excitation: the scene's record is the excitation.
  RecordingObserver(const Scene& scene, double tick, bool of_log)
      : clock_(of_log ? scene.clock : ContactClock{}),
        estimation_(of_log ? scene : without_stream(scene), options_of(tick), 1),
        sessions_(Freshness::any, tick),
        sample_(estimation_.empty_sample()),
        names_(scene.model.outputs) {}

  void take(std::string_view channel, const py::bytes& data, std::int64_t monotonic,
            std::int64_t utime, bool appended) {
    if (channel == input_channel) {
      const bool known = estimation_.stream && decode(from_bytes(data), input_) == Refusal::none;
      if (known && estimation_.time_line.started() && input_.session == sessions_.session()) {
        estimation_.stream->take(input_);
      }
    } else if (channel == contacts_channel) {
      if (decode(from_bytes(data), message_) != Refusal::none) return;
      if (message_.contacts == estimation_.contacts) receive({monotonic, utime, appended});
    }
  }

  // The estimates of the next ticks that have settled, and whether they are all.
  py::tuple settle(std::int64_t ticks) {
    py::list messages;
    const auto add = [&](std::string_view channel, const auto& message) {
      messages.append(py::make_tuple(std::string(channel), to_bytes(encode(message, buffer_))));
    };
    const bool all = estimation_.time_line.run(
        0, [](const auto&) {},
        [&](const Estimation::State& state) {
          estimation_.describe(state, true, sample_);
          sample_.settled_tick = state.tick;
          fill(estimate_, sample_);
          add(settled_channel, estimate_);
          if (sample_.confidence.sigma_outputs.size() > 0) {
            fill(outputs_, sample_, true, names_);
            add(outputs_channel, outputs_);
          }
          if (sample_.confidence.bound_q.size() > 0) {
            fill(bounds_, sample_, names_);
            add(bounds_channel, bounds_);
          }
          return true;
        },
        ticks);
    return py::make_tuple(messages, all);
  }

 private:
  void receive(const Arrival& arrival) {
    to_machine_time(clock_, message_);
    const SessionTracker::Verdict verdict = sessions_.receive(message_, arrival);
    if (verdict == SessionTracker::Verdict::ignored) return;
    if (verdict == SessionTracker::Verdict::starts) {
      estimation_.restart(message_);
    } else {
      estimation_.receive(message_, verdict == SessionTracker::Verdict::resumes);
    }
    sample_.session = message_.session;
    sample_.utime = message_.utime;
  }

  static ObserverOptions options_of(double tick) {
    ObserverOptions options;
    options.tick = tick;
    return options;
  }

  ContactClock clock_;
  Estimation estimation_;
  SessionTracker sessions_;
  ContactMessage message_;
  InputMessage input_;
  EstimateSample sample_;
  std::vector<Output> names_;
  estimate_t estimate_{};
  outputs_t outputs_{};
  bounds_t bounds_{};
  std::vector<std::uint8_t> buffer_;
};

}  // namespace

void bind_recordings(py::module_& module) {
  const auto self = [](const py::object& of) { return of; };
  py::class_<LogRecording>(module, "_LogRecording")
      .def("__iter__", self)
      .def("__next__", &LogRecording::next)
      .def_property_readonly("damages", &LogRecording::damages,
                             "Damaged parts: first byte, what; the rest is used.")
      .def_readonly("unauthenticated", &LogRecording::unauthenticated);
  py::class_<EventsRecording>(module, "_EventsRecording")
      .def("__iter__", self)
      .def("__next__", &EventsRecording::next)
      .def_readonly("problems", &EventsRecording::problems)
      .def_readonly("damages", &EventsRecording::damages,
                    "Where reading stopped: line, what; everything before is used.");
  module.def(
      "_open_recording", &open_recording, "file"_a, "scene"_a, "key"_a, "step"_a,
      "The messages of an LCM log or of an events file: channel, data, arrival [us], whether "
      "it is the first contact message of an appended recording. An events file becomes "
      "messages `step` [s] apart; 0: a thousand of them.");
  module.def("_has_estimates", &has_estimates, "log"_a);

  py::class_<RecordingObserver>(module, "_RecordingObserver")
      .def(py::init<const Scene&, double, bool>(), "scene"_a, "tick"_a, "of_log"_a)
      .def("take", &RecordingObserver::take, "channel"_a, "data"_a, "monotonic"_a, "utime"_a,
           "appended"_a)
      .def("settle", &RecordingObserver::settle, "ticks"_a,
           "Messages with the estimates of at most so many ticks, and whether all have settled.");
}

}  // namespace sprag::python
