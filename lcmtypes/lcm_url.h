// LCM addresses: PROVIDER://TARGET?name=value&name=value, e.g. udpm://239.255.76.67:7667?ttl=0.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "sprag/error.h"

namespace sprag {

/// UDP multicast on this host only (ttl=0).
inline constexpr const char* default_url = "udpm://239.255.76.67:7667?ttl=0";

/// An address that LCM would misread or reject. what() says what is allowed.
struct UrlError : Error {
  using Error::Error;
};

struct MulticastAddress {
  std::string group;  ///< IPv4, 224.0.0.0 to 239.255.255.255
  std::uint16_t port = 0;
  int ttl = 0;  ///< 0: this host only
};

struct LcmUrl {
  std::string text;
  std::optional<MulticastAddress> multicast;  ///< set for udpm
  std::optional<int> receive_buffer;          ///< recv_buf_size [bytes], if specified
  std::filesystem::path log;                  ///< LOG of file://LOG; else empty
  bool writes_log = false;                    ///< of file://LOG?mode=w
};

/// Parses an address of provider udpm, memq, file or tcpq; "udpm://" means LCM's default group and
/// port. Throws UrlError.
LcmUrl parse_url(const std::string& text);

}  // namespace sprag
