#include "tools/view/gateway/rules.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace sprag::view {
namespace {

constexpr std::uint16_t port_of_http = 80;

std::optional<std::uint16_t> port_of(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return port;
}

std::string bracketed(const std::string& address) {
  return address.find(':') == std::string::npos ? address : "[" + address + "]";
}

bool is_host(std::string_view host, const std::string& address, std::uint16_t port) {
  if (port == port_of_http && host == address) return true;
  return host == address + ":" + std::to_string(port);
}

bool is_here(std::string_view host, const Endpoint& here) {
  return is_host(host, bracketed(here.address), here.port) ||
         (is_loopback(here) && is_host(host, "localhost", here.port));
}

constexpr std::array<Header, 6> of_all{{
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
     "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    {"Referrer-Policy", "no-referrer"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Cache-Control", "no-store"},
}};

}  // namespace

std::optional<Endpoint> endpoint_of(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  const auto port = port_of(colon == std::string_view::npos ? text : text.substr(colon + 1));
  if (!port) return std::nullopt;
  Endpoint endpoint;
  endpoint.port = *port;
  std::string_view address = colon == std::string_view::npos ? "" : text.substr(0, colon);
  const bool in_brackets = address.starts_with('[') && address.ends_with(']');
  if (in_brackets) address = address.substr(1, address.size() - 2);
  if (!in_brackets && address.find(':') != std::string_view::npos) return std::nullopt;
  if (in_brackets && address.find(':') == std::string_view::npos) return std::nullopt;
  if (!address.empty() && address != "localhost") endpoint.address = address;
  return endpoint;
}

std::string text_of(const Endpoint& endpoint) {
  return bracketed(endpoint.address) + ":" + std::to_string(endpoint.port);
}

bool is_loopback(const Endpoint& endpoint) {
  return endpoint.address == "::1" || endpoint.address.starts_with("127.");
}

Verdict judge(const Request& request, const Endpoint& here, std::span<const PageFile> files) {
  if (!request.host || !is_here(*request.host, here)) {
    return {403, nullptr, "this host is not served here"};
  }
  if (request.method != "GET" && request.method != "HEAD") {
    return {405, nullptr, "only GET and HEAD: nothing can be changed here"};
  }
  if (request.target == stream_path) {
    if (!request.upgrade || request.method != "GET") {
      return {426, nullptr, "this is a WebSocket"};
    }
    const std::string expected = "http://" + std::string(*request.host);
    if (!request.origin || *request.origin != expected) {
      return {403, nullptr, "the stream is for the page that is served here"};
    }
    return {101};
  }
  const std::string_view path = request.target == "/" ? "/index.html" : request.target;
  const auto file = std::find_if(files.begin(), files.end(),
                                 [path](const PageFile& each) { return each.path == path; });
  if (file == files.end()) return {404, nullptr, "there is no such file"};
  return {200, &*file};
}

std::span<const Header> safety_headers() { return of_all; }

}  // namespace sprag::view
