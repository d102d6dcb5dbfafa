// Decides which HTTP requests are answered, and how. Any page open in a browser can send requests
// to this machine. The Host header must therefore equal the address at which the request arrived,
// against DNS rebinding, and the stream requires the Origin of this page. Access is read-only.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace sprag::view {

/// An address to listen on.
struct Endpoint {
  std::string address = "127.0.0.1";  ///< of IPv4, or of IPv6 without brackets
  std::uint16_t port = 8080;          ///< 0: any that is free
};

/// Parses "127.0.0.1:8080", "[::1]:8080", ":8080" or "8080"; localhost is 127.0.0.1. Returns
/// nothing for any other form. Only the form is checked.
std::optional<Endpoint> endpoint_of(std::string_view text);

/// "127.0.0.1:8080", "[::1]:8080".
std::string text_of(const Endpoint& endpoint);

/// Whether only this host can reach the address.
bool is_loopback(const Endpoint& endpoint);

/// The parts of a request that the rules use. A header that occurs more than once counts as absent.
struct Request {
  std::string_view method, target;
  std::optional<std::string_view> host, origin;
  bool upgrade = false;  ///< to a WebSocket
};

/// A file of the page.
struct PageFile {
  std::string_view path;  ///< "/page.js"
  std::string_view type;  ///< "text/javascript"
  std::span<const unsigned char> bytes;
};

inline constexpr std::string_view stream_path = "/stream";

/// Answer to a request.
struct Verdict {
  int status;                      ///< 200 with `file`, 101, 403, 404, 405 or 426
  const PageFile* file = nullptr;  ///< for 200
  const char* why = "";            ///< body of a refusal
};

/// `here`: the address at which the request arrived.
Verdict judge(const Request& request, const Endpoint& here, std::span<const PageFile> files);

/// Headers of every answer. They restrict the page to its own files.
struct Header {
  std::string_view name, value;
};
std::span<const Header> safety_headers();

}  // namespace sprag::view
