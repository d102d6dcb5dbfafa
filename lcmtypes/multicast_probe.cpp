#include "lcmtypes/multicast_probe.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <random>
#include <system_error>

#include "lcmtypes/descriptor.h"

namespace sprag {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

Descriptor udp_socket() { return Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)); }

template <class Value>
bool set_option(const Descriptor& socket, int level, int option, const Value& value) {
  return ::setsockopt(socket.get(), level, option, &value, sizeof value) == 0;
}

std::string last_error() { return std::generic_category().message(errno); }

/// A packet like LCM's self test, with random bytes to identify it.
std::string probe_packet() {
  std::random_device random;
  std::string packet("LC02\0\0\0\0LCM_SELF_TEST\0sprag ", 28);
  for (int i = 0; i < 16; ++i) packet += static_cast<char>('a' + random() % 26);
  return packet;
}

/// Whether `packet` arrives before `deadline`; other packets on the port are skipped.
bool arrives(const Descriptor& receiver, const std::string& packet, Clock::time_point deadline) {
  std::array<char, 2048> data;
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    if (left <= 0ms) return false;
    pollfd ready{receiver.get(), POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(left.count())) <= 0) continue;
    const ssize_t size = ::recv(receiver.get(), data.data(), data.size(), MSG_DONTWAIT);
    if (size == static_cast<ssize_t>(packet.size()) &&
        std::equal(packet.begin(), packet.end(), data.begin()))
      return true;
  }
}

}  // namespace

std::optional<ProbeFailure> probe_multicast(const MulticastAddress& address) {
  using Cause = ProbeFailure::Cause;
  const Descriptor receiver = udp_socket(), sender = udp_socket();
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_port = htons(address.port);
  inet_pton(AF_INET, address.group.c_str(), &group.sin_addr);
  const auto* name = reinterpret_cast<const sockaddr*>(&group);

  const ip_mreq membership{group.sin_addr, {htonl(INADDR_ANY)}};
  if (!set_option(receiver, SOL_SOCKET, SO_REUSEADDR, 1) ||
      ::bind(receiver.get(), name, sizeof group) != 0) {
    return ProbeFailure{errno == EADDRINUSE ? Cause::port_taken : Cause::port_refused,
                        last_error()};
  }
  if (!set_option(receiver, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership) ||
      !set_option(sender, IPPROTO_IP, IP_MULTICAST_TTL, address.ttl) ||
      !set_option(sender, IPPROTO_IP, IP_MULTICAST_LOOP, 1)) {
    return ProbeFailure{Cause::no_multicast, last_error()};
  }

  const std::string packet = probe_packet();
  const auto deadline = Clock::now() + 1s;
  do {  // repeated, since a busy port may drop one
    if (::sendto(sender.get(), packet.data(), packet.size(), 0, name, sizeof group) < 0) {
      return ProbeFailure{Cause::no_multicast, last_error()};
    }
    if (arrives(receiver, packet, std::min(deadline, Clock::now() + 100ms))) return std::nullopt;
  } while (Clock::now() < deadline);
  return ProbeFailure{Cause::no_multicast, "packets sent to the group do not come back"};
}

}  // namespace sprag
