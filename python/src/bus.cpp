#include "python/src/bus.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/messages.h"
#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene.h"

namespace sprag::python {
namespace {

template <class Message>
Refusal check_as(Bytes data) {
  static Message message{};  // under the interpreter's lock
  return decode(data, message);
}

std::string refusal(std::string_view channel, const py::bytes& bytes) {
  const Bytes data = from_bytes(bytes);
  const Refusal result = channel == contacts_channel     ? check_as<ContactMessage>(data)
                         : channel == truth_channel      ? check_as<state_t>(data)
                         : channel == outputs_channel    ? check_as<outputs_t>(data)
                         : channel == bounds_channel     ? check_as<bounds_t>(data)
                         : channel == parameters_channel ? check_as<parameters_t>(data)
                         : channel == health_channel     ? check_as<health_t>(data)
                         : channel == input_channel      ? check_as<InputMessage>(data)
                                                         : check_as<estimate_t>(data);
  return result == Refusal::none ? std::string() : std::string(name(result));
}

class Receiver {
 public:
  Receiver(const std::vector<std::string>& channels, const std::string& url,
           const std::optional<std::filesystem::path>& key)
      : bus_(url, to_key(key)) {
    for (const std::string& channel : channels) {
      bus_.subscribe(channel, [this](std::string_view name, Bytes data, std::int64_t utime) {
        messages_.append(py::make_tuple(py::str(name.data(), name.size()), to_bytes(data), utime));
      });
    }
  }

  py::list receive() {
    messages_ = py::list();
    bus_.handle(std::chrono::milliseconds(0));
    return std::move(messages_);
  }

  py::dict refused() const {
    const BusCounts& counts = bus_.counts();
    py::dict result;
    for (std::size_t i = 1; i < counts.faults.size(); ++i) {
      const std::string_view cause = name(static_cast<PacketFault>(i));
      result[py::str(cause.data(), cause.size())] = counts.faults[i];
    }
    result["other_host"] = counts.other_host;
    result["unauthenticated"] = counts.unauthenticated;
    return result;
  }
  std::int64_t overflowed() const { return bus_.counts().overflowed; }

 private:
  Bus bus_;
  py::list messages_;
};

// Follows one master, as an observer does, and merges its messages into one list of events.
class ContactFollower {
 public:
  ContactFollower(const Scene& scene, bool fresh, bool machine_time)
      : clock_(machine_time ? ContactClock{} : scene.clock),
        contacts_(static_cast<int>(scene.model.contacts.size())),
        tracker_(fresh ? Freshness::required : Freshness::any),
        events_(contacts_, usual_events) {}

  py::object take(const py::bytes& data, std::int64_t monotonic, std::int64_t utime,
                  bool appended) {
    ContactMessage message;
    if (decode(from_bytes(data), message) != Refusal::none || message.contacts != contacts_) {
      ++misfits;
      return py::none();
    }
    to_machine_time(clock_, message);
    const auto verdict = tracker_.receive(message, {monotonic, utime, appended});
    if (verdict == SessionTracker::Verdict::ignored) return py::none();
    bool begins = verdict == SessionTracker::Verdict::starts;
    py::object closed = py::none();
    if (begins) events_.restart(0, 0, no_horizon);
    const bool joins = message.records_total > message.records || message.horizon > near;
    const bool back =
        message.horizon < events_.horizon() || message.records_total < events_.next_record();
    if ((begins && joins) || (verdict == SessionTracker::Verdict::resumes && back)) {
      begins = true;
      events_.restart(message.records_total, message.closed, message.horizon);
      closed = contacts_of(message.closed);
    }
    events_.add(message);
    py::list events;
    for (const ContactEvent& event : events_.events()) {
      events.append(py::make_tuple(event.t, event.contact, static_cast<int>(event.kind)));
    }
    events_.drop(events_.events().size());
    return py::make_tuple(begins, message.session, message.speed, message.horizon, closed, events);
  }

  const MessageCounts& counts() const { return tracker_.counts(); }

  std::int64_t misfits = 0;

 private:
  static constexpr double near = 100.0;  // s; a later first message joins a running session
  static constexpr std::size_t usual_events = 4096;

  ContactClock clock_;
  int contacts_;
  SessionTracker tracker_;
  EventHistory events_;
};

// What the drawing of a machine and of its input needs besides the properties of a Scene.
py::dict drawing_of(const Scene& scene) {
  py::dict result;
  result["K"] = scene.kept ? scene.kept->K : scene.model.K;
  std::vector<Eigen::VectorXd> w;
  for (const Contact& contact : scene.model.contacts) w.push_back(contact.w);
  result["w"] = scene.kept ? scene.kept->given_w : w;
  const bool shaken = scene.frame && !scene.kept && !scene.frame->influence.isZero(0.0);
  result["influence"] = shaken ? py::cast(scene.frame->influence) : py::none();
  result["length"] = length_scale(scene.model, scene.prior.start);
  result["streamed"] = scene.stream_duration > 0.0;
  for (const Force& force : scene.model.forces) {
    if (!force.input) continue;
    result["gain"] = force.input->settings().gain;
    result["delay"] = force.input->settings().delay;
    break;
  }
  return result;
}

}  // namespace

void bind_bus(py::module_& module) {
  module.def("_refusal", &refusal, "channel"_a, "data"_a,
             "Why a message of a channel is refused; empty if it is valid.");
  module.def("_drawing_of", &drawing_of, "scene"_a);

  py::class_<Receiver>(module, "_Receiver", "The messages of some channels of the bus.")
      .def(py::init<const std::vector<std::string>&, const std::string&,
                    const std::optional<std::filesystem::path>&>(),
           "channels"_a, "url"_a, "key"_a)
      .def("receive", &Receiver::receive,
           "The messages that have arrived: channel, data, arrival [us].")
      .def_property_readonly("refused", &Receiver::refused)
      .def_property_readonly("overflowed", &Receiver::overflowed);

  py::class_<ContactFollower>(module, "_ContactFollower")
      .def(py::init<const Scene&, bool, bool>(), "scene"_a, "fresh"_a, "machine_time"_a,
           "fresh: a session begins with a recent message only; machine_time: of the messages, "
           "else they are on the scene's clock.")
      .def("take", &ContactFollower::take, "data"_a, "monotonic"_a, "utime"_a, "appended"_a = false,
           "Takes a message with its arrival [ns], [us]. None if it is ignored; else whether a "
           "session begins, session, speed, horizon, the closed contacts where events are missing "
           "before it, and new events: t, contact from 0, kind.")
      .def_readonly("misfits", &ContactFollower::misfits)
      .def_property_readonly("received",
                             [](const ContactFollower& self) { return self.counts().received; })
      .def_property_readonly("lost", [](const ContactFollower& self) { return self.counts().lost; })
      .def_property_readonly("sessions",
                             [](const ContactFollower& self) { return self.counts().sessions; });
}

}  // namespace sprag::python
