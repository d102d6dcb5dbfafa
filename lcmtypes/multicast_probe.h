// Does multicast work on this host? LCM itself fails at once without a route, or hangs for ten
// seconds where multicast is blocked, so this asks first.
#pragma once

#include <string>

#include "lcmtypes/lcm_url.h"

namespace sprag {

struct MulticastProbe {
  std::string failure;     ///< empty: a datagram came back
  int receive_buffer = 0;  ///< what the kernel grants of the size asked for [bytes]
};

/// Joins the group, sends a datagram to it and waits up to one second for its return. To listeners
/// it is LCM's own self test, which they ignore. Asks for `receive_buffer` bytes on the way.
MulticastProbe probe_multicast(const MulticastAddress& address, int receive_buffer);

}  // namespace sprag
