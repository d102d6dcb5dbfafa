// Tests whether multicast works on this host. LCM itself fails without a route, and hangs for ten
// seconds if multicast is blocked, so this test comes first.
#pragma once

#include <optional>
#include <string>

#include "lcmtypes/lcm_url.h"

namespace sprag {

struct ProbeFailure {
  enum class Cause {
    port_taken,    ///< another program has bound the port exclusively
    port_refused,  ///< the port cannot be bound for another reason, for example a privileged one
    no_multicast   ///< no route, or packets do not come back
  };
  Cause cause = Cause::no_multicast;
  std::string what;  ///< the system's message
};

/// Joins the group, sends a datagram to it and waits up to one second for its return. The datagram
/// looks like LCM's self test, which receivers ignore. Returns the failure; nullopt if it returned.
std::optional<ProbeFailure> probe_multicast(const MulticastAddress& address);

}  // namespace sprag
