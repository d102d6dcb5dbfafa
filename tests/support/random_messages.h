// Random messages of every type, with values that validate() accepts, and random changes of their
// bytes.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "lcmtypes/messages.h"
#include "sprag/contact_event.h"
#include "tests/support/random.h"

namespace sprag::test {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();

inline std::int64_t random_count(Random& random) {
  return static_cast<std::int64_t>(std::exp(random.uniform(0.0, 36.0))) - 1;
}

inline std::vector<double> random_values(Random& random, std::int32_t n) {
  std::vector<double> values(static_cast<std::size_t>(n));
  for (double& value : values) value = random.uniform(-2.0, 2.0);
  return values;
}

/// Standard deviations or half-widths, some of them infinite.
inline std::vector<double> random_widths(Random& random, std::int32_t n) {
  std::vector<double> values(static_cast<std::size_t>(n));
  for (double& value : values) value = random.chance(0.1) ? unbounded : random.uniform(0.0, 2.0);
  return values;
}

inline std::vector<std::string> random_names(Random& random, std::int32_t n, int shortest,
                                             int longest) {
  std::vector<std::string> names(static_cast<std::size_t>(n));
  for (std::string& name : names) {
    name.resize(static_cast<std::size_t>(random.integer(shortest, longest)));
    for (char& c : name) c = static_cast<char>(random.integer(0x20, 0x7e));
  }
  return names;
}

inline void fill(Random& random, contacts_t& message) {
  message = {};
  message.session = random_count(random);
  message.sequence = random_count(random);
  message.utime = random_count(random);
  message.speed = random.chance(0.2) ? unbounded : random.uniform(1e-3, 2.0);
  message.contacts = random.integer(1, max_contacts);
  message.closed = static_cast<std::int64_t>((bit(message.contacts) - 1) &
                                             static_cast<ContactSet>(random_count(random)));
  message.records = random.integer(0, 120);
  message.records_total = message.records + random_count(random);
  for (int i = 0; i < message.records; ++i) {
    if (random.chance(0.7)) message.horizon += random.uniform(0.0, 1.0);
    message.t[i] = message.horizon;
    message.contact[i] = static_cast<std::int8_t>(random.integer(1, message.contacts));
    message.kind[i] = static_cast<std::int8_t>(random.integer(1, 3));
  }
}

inline void fill(Random& random, input_t& message) {
  message = {};
  message.session = random_count(random);
  message.sequence = random_count(random);
  message.utime = random_count(random);
  message.t0 = random.uniform(-1.0, 1.0);
  message.dt = random.uniform(1e-4, 1e-2);
  message.channels = random.integer(1, 8);
  message.n = random.integer(1, 150 / message.channels);
  message.total = message.n + random_count(random);
  for (int i = 0; i < message.n * message.channels; ++i) {
    message.value[i] = random.uniform(-1.0, 1.0);
  }
}

inline void fill(Random& random, state_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random);
  message.t = random.uniform(0.0, 10.0);
  message.f = random.integer(1, 40);
  message.q = random_values(random, message.f);
  message.u = random_values(random, message.f);
  message.closed = random_count(random);
}

inline void fill(Random& random, estimate_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random);
  message.t = random.uniform(0.0, 10.0);
  message.f = random.integer(1, 40);
  message.q = random_values(random, message.f);
  message.u = random_values(random, message.f);
  message.closed = random_count(random);
  message.settled_tick = random_count(random) - 1;
  message.estimators = static_cast<std::int8_t>(random.integer(1, 3));
  message.from_filter = static_cast<std::int8_t>(random.integer(0, 1));
  message.bound = random.chance(0.5) ? unbounded : random.uniform(0.0, 1.0);
  const bool has_filter = message.estimators > 1;
  message.deviations = has_filter ? message.f : 0;
  message.sigma_q = random_widths(random, message.deviations);
  message.sigma_u = random_widths(random, message.deviations);
  message.gaps = has_filter ? random.integer(1, max_contacts) : 0;
  message.sigma_g = random_widths(random, message.gaps);
  const bool closed_once = random.chance(0.7);
  message.closing = closed_once ? random.uniform(0.0, 10.0) : -1.0;
  message.closing_contact = closed_once ? random.integer(1, max_contacts) : 0;
  message.replica_gap = random.uniform(-1.0, 1.0);
  message.filter_gap = random.uniform(-1.0, 1.0);
  message.sigma_filter_gap = random.uniform(0.0, 1.0);
  message.inconsistencies = random_count(random);
  const bool failed_once = random.chance(0.3);
  message.suspect_t = failed_once ? random.uniform(0.0, 10.0) : -1.0;
  message.suspect_contact = failed_once ? random.integer(1, max_contacts) : 0;
  message.suspicion = static_cast<std::int8_t>(failed_once ? random.integer(1, 3) : 0);
}

inline void fill(Random& random, outputs_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random);
  message.t = random.uniform(0.0, 10.0);
  message.settled = static_cast<std::int8_t>(random.integer(0, 1));
  message.from_filter = static_cast<std::int8_t>(random.integer(0, 1));
  message.n = random.integer(0, 20);
  message.name = random_names(random, message.n, 1, 30);
  message.value = random_values(random, message.n);
  message.sigma = random_widths(random, message.n);
}

inline void fill(Random& random, parameters_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random);
  message.t = random.uniform(0.0, 10.0);
  message.n = random.integer(0, 20);
  message.key = random_names(random, message.n, 1, 30);
  message.value = random_values(random, message.n);
  message.sigma = random_widths(random, message.n);
  message.accepted = random.chance(0.3) ? -1.0 : random.uniform(0.0, 10.0);
  message.known = random.chance(0.3) ? -1.0 : random.uniform(0.0, 10.0);
  message.identifications = random_count(random);
  message.from_filter = static_cast<std::int8_t>(random.integer(0, 1));
}

inline void fill(Random& random, bounds_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random);
  message.t = random.uniform(0.0, 10.0);
  message.bound = random.chance(0.5) ? unbounded : random.uniform(0.0, 1.0);
  message.refutations = random_count(random);
  message.n = random.integer(0, 40);
  message.name = random_names(random, message.n, 2, 10);
  message.half_width = random_widths(random, message.n);
}

inline void fill(Random& random, health_t& message) {
  message.session = random_count(random);
  message.utime = random_count(random);
  message.tick = random_count(random) - 1;
  message.t = random.chance(0.2) ? -1.0 : random.uniform(0.0, 10.0);
  message.last = static_cast<std::int8_t>(random.integer(0, 1));
  message.master = static_cast<std::int8_t>(random.integer(0, 3));
  message.estimate = static_cast<std::int8_t>(random.integer(0, 3));
  message.input = static_cast<std::int8_t>(random.integer(0, 2));
  message.speed = random.chance(0.2) ? unbounded : random.uniform(0.0, 2.0);
  for (double* time : {&message.period, &message.real_time_factor, &message.latency_p50,
                       &message.latency_p99, &message.latency_max, &message.lateness_p50,
                       &message.lateness_p99, &message.lateness_max}) {
    *time = random.uniform(0.0, 2.0);
  }
  for (std::int64_t* count : {&message.latencies,
                              &message.sessions,
                              &message.ticks,
                              &message.deadlines,
                              &message.missed_deadlines,
                              &message.real_time_losses,
                              &message.events,
                              &message.late_events,
                              &message.lost_events,
                              &message.gaps,
                              &message.skipped_events,
                              &message.rollbacks,
                              &message.inconsistencies,
                              &message.messages,
                              &message.lost_messages,
                              &message.doubled_messages,
                              &message.reordered_messages,
                              &message.other_masters,
                              &message.stale,
                              &message.overflowed,
                              &message.unsent}) {
    *count = random_count(random);
  }
  message.causes = random.integer(0, 20);
  message.cause = random_names(random, message.causes, 1, 63);
  message.refused.resize(static_cast<std::size_t>(message.causes));
  for (std::int64_t& count : message.refused) count = random_count(random);
}

/// Changes an encoded message, except its type hash, in one to four places: a byte, a number of
/// four bytes that may be a length, or the length of the whole.
inline void mutate(Random& random, std::vector<std::uint8_t>& bytes) {
  for (int changes = random.integer(1, 4); changes > 0 && bytes.size() > 12; --changes) {
    const auto at = static_cast<std::size_t>(random.integer(8, static_cast<int>(bytes.size()) - 4));
    const int kind = random.integer(0, 9);
    if (kind < 6) {
      bytes[at] = static_cast<std::uint8_t>(random.integer(0, 255));
    } else if (kind < 8) {
      const bool huge = random.chance(0.5);
      for (std::size_t i = 0; i < 4; ++i) {
        bytes[at + i] = static_cast<std::uint8_t>(huge ? random.integer(0, 255) : 0);
      }
      if (!huge) bytes[at + 3] = static_cast<std::uint8_t>(random.integer(0, 255));
    } else if (kind == 8) {
      bytes.resize(at);
    } else {
      bytes.resize(bytes.size() + static_cast<std::size_t>(random.integer(1, 40)));
    }
  }
}

}  // namespace sprag::test
