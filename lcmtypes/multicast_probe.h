// Does multicast work on this host? LCM itself fails at once without a route, or hangs for ten
// seconds where multicast is blocked, so this asks first.
#pragma once

#include <optional>
#include <string>

#include "lcmtypes/lcm_url.h"

namespace sprag {

struct ProbeFailure {
  enum class Cause {
    port_taken,    ///< another program has bound it and does not share it
    port_refused,  ///< it cannot be bound for another reason, as a privileged one
    no_multicast   ///< no route, or packets do not come back
  };
  Cause cause = Cause::no_multicast;
  std::string what;  ///< the system's message
};

/// Joins the group, sends a datagram to it and waits up to one second for its return. To listeners
/// it is LCM's own self test, which they ignore. Returns what failed; nothing if it came back.
std::optional<ProbeFailure> probe_multicast(const MulticastAddress& address);

}  // namespace sprag
