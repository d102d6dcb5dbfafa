#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>

#include "lcmtypes/estimate_listener.h"
#include "lcmtypes/event_publisher.h"
#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "python/src/bus.h"
#include "python/src/long_call.h"
#include "python/src/members.h"

namespace sprag::python {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Several threads may share a listener. While it waits, it handles Python's signals every 100 ms.
class Listener {
 public:
  Listener(EstimateChannel channel, const std::string& url, const std::optional<Key>& key)
      : listener_(channel, url, key) {}

  std::optional<estimate_t> next(std::optional<double> timeout) {
    if (timeout && !(*timeout >= 0.0)) throw std::invalid_argument("timeout must be >= 0");
    constexpr milliseconds piece(100);
    // [s]: without a limit the conversion to the clock's duration would overflow.
    constexpr double longest = 1e9;
    const auto end =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
                           std::min(timeout.value_or(longest), longest)));
    while (true) {
      const auto left = std::chrono::ceil<milliseconds>(end - Clock::now());
      auto sample =
          locked(mutex_, [&] { return listener_.next(std::clamp(left, milliseconds(0), piece)); });
      if (sample || left <= milliseconds(0)) return sample;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
  }

  std::int64_t refused() {
    return locked(mutex_, [&] { return listener_.refused(); });
  }

 private:
  std::mutex mutex_;
  EstimateListener listener_;
};

void bind_publisher(py::module_& module) {
  ValueClass<EventPublisher>(
      module, "EventPublisher",
      "Publishes a machine as a master on the bus: takes contact events and maintains session, "
      "numbers, repetition, watermark and heartbeat. contacts: how many the machine has; speed: "
      "simulated s per s, inf without a pace; key: a file of 64 hexadecimal digits. Threads may "
      "share one. A context that closes at its end. Raises BusError, InputError or ValueError.")
      .def(py::init([](int contacts, double speed, const std::string& url,
                       const std::optional<std::filesystem::path>& key) {
             PublisherSettings settings{url, to_key(key), speed};
             return without_lock(
                 [&] { return std::make_unique<EventPublisher>(contacts, settings); });
           }),
           "contacts"_a, py::kw_only(), "speed"_a = 1.0, "url"_a = default_url,
           "key"_a = py::none())
      .def(
          "__enter__", [](EventPublisher& self) { return &self; },
          py::return_value_policy::reference_internal)
      .def("__exit__", [](EventPublisher& publisher,
                          const py::args&) { without_lock([&] { publisher.close(); }); })
      .def(
          "take",
          [](EventPublisher& publisher, double t, int contact, int kind) {
            const ContactEvent event = to_event(t, contact, kind, max_contacts);
            return without_lock([&] { return publisher.take(event); });
          },
          "t"_a, "contact"_a = 1, "kind"_a = static_cast<int>(ContactEventKind::pulse),
          "Takes an event at t [s] of a contact, from 1, of a ContactEventKind, in any order; it "
          "is sent when the horizon reaches it. False if it is not after the horizon.")
      .def("set_horizon", &EventPublisher::set_horizon, "t"_a,
           py::call_guard<py::gil_scoped_release>(),
           "Every event up to t [s] has been taken; never goes back. To be called with the "
           "machine's time at least ten times a second, also while nothing happens.")
      .def("close", &EventPublisher::close, py::call_guard<py::gil_scoped_release>(),
           "Ends the session: the last message is repeated for 0.2 s.")
      .get("session", "Random.", &EventPublisher::session)
      .get("sent", "Messages so far.",
           [](EventPublisher& publisher) { return without_lock([&] { return publisher.sent(); }); })
      .get("unsent", "Messages that could not be sent.", [](EventPublisher& publisher) {
        return without_lock([&] { return publisher.unsent(); });
      });
}

void bind_listener(py::module_& module) {
  value_class<estimate_t>(
      module, "LiveEstimate",
      "An observer's estimate of one tick, received from the bus. All arrays are read-only views.")
      .get("session", "The master's.", &estimate_t::session)
      .get("tick", "Number of the tick, from 0.", &estimate_t::tick)
      .get("settled_tick", "Last tick that is final; -1: none yet.", &estimate_t::settled_tick)
      .get("t", "Simulated time of the tick [s].", &estimate_t::t)
      .get("q", "Coordinates, f entries.", &estimate_t::q)
      .get("u", "Velocities, f entries.", &estimate_t::u)
      .get("closed", "The contacts that are closed, from 1.",
           [](const estimate_t& estimate) {
             return contacts_of(static_cast<ContactSet>(estimate.closed));
           })
      .get("from_filter", "Whether q and u are the timing filter's; else the replica's.",
           [](const estimate_t& estimate) { return estimate.from_filter == 1; })
      .get("sigma_q", "Standard deviations of q, f entries; none without a timing filter.",
           &estimate_t::sigma_q)
      .get("sigma_u", "Standard deviations of u, f entries.", &estimate_t::sigma_u)
      .get("sigma_gap", "Standard deviations of the gaps [m], m entries.", &estimate_t::sigma_g)
      .get("bound", "The replica's V is at most this; inf where nothing guarantees it.",
           &estimate_t::bound);

  ValueClass<Listener>(
      module, "EstimateListener",
      "Receives the estimates of observers on the bus: the provisional ones, or with settled=True "
      "the settled ones, in order. Raises BusError, InputError or ValueError.")
      .def(py::init([](bool settled, const std::string& url,
                       const std::optional<std::filesystem::path>& file) {
             const auto channel = settled ? EstimateChannel::settled : EstimateChannel::now;
             const std::optional<Key> key = to_key(file);
             return without_lock([&] { return std::make_unique<Listener>(channel, url, key); });
           }),
           py::kw_only(), "settled"_a = false, "url"_a = default_url, "key"_a = py::none())
      .def("next", &Listener::next, "timeout"_a = py::none(),
           "The next LiveEstimate; None once timeout [s] is over, if it is given. Other threads "
           "run meanwhile, and Ctrl-C interrupts it.")
      .get("refused", "Messages that were no estimates, or not made with the key.",
           &Listener::refused);
}

}  // namespace

void bind_live(py::module_& module) {
  bind_publisher(module);
  bind_listener(module);
}

}  // namespace sprag::python
