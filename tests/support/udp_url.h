// An LCM address on a free port, because runs on one port receive each other's messages.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>

namespace sprag::test {

/// A UDP port that was free just now; the kernel does not assign it again soon.
inline std::uint16_t free_port() {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  socklen_t size = sizeof address;
  ::bind(descriptor, reinterpret_cast<sockaddr*>(&address), size);
  ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(descriptor);
  return ntohs(address.sin_port);
}

inline std::string udp_url(std::uint16_t port = free_port()) {
  return "udpm://239.255.76.67:" + std::to_string(port) + "?ttl=0";
}

}  // namespace sprag::test
