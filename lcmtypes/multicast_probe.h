// Does multicast work on this host? LCM itself fails at once without a route, or hangs for ten
// seconds where multicast is blocked, so this asks first.
#pragma once

#include <string>

#include "lcmtypes/lcm_url.h"

namespace sprag {

/// Joins the group, sends a datagram to it and waits up to one second for its return. To listeners
/// it is LCM's own self test, which they ignore. Returns what failed; empty if it came back.
std::string probe_multicast(const MulticastAddress& address);

}  // namespace sprag
