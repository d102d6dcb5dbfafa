// Who is answered, and with what. Any page that a browser has open can send requests to this
// machine: the Host must be exactly the address that was asked, so that a name that somebody lets
// point here is not heard, and a stream is opened for this page alone. Nothing can be changed.
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

/// "127.0.0.1:8080", "[::1]:8080", ":8080", "8080"; localhost is 127.0.0.1. Nothing if it is none.
/// Only the form is checked.
std::optional<Endpoint> endpoint_of(std::string_view text);

/// "127.0.0.1:8080", "[::1]:8080".
std::string text_of(const Endpoint& endpoint);

/// Whether only this host can reach it.
bool is_loopback(const Endpoint& endpoint);

/// A request, as far as it matters here. A header that is there more than once is not there.
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

/// What a request gets.
struct Verdict {
  int status;                      ///< 200 with `file`, 101, 403, 404, 405 or 426
  const PageFile* file = nullptr;  ///< for 200
  const char* why = "";            ///< for the others
};

/// `here`: the address at which the request arrived.
Verdict judge(const Request& request, const Endpoint& here, std::span<const PageFile> files);

/// What every answer says to the browser: that the page is made of its own files alone.
struct Header {
  std::string_view name, value;
};
std::span<const Header> safety_headers();

}  // namespace sprag::view
