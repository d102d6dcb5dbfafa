#include "lcmtypes/lcm_url.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>

namespace sprag {

namespace {

constexpr std::array<std::string_view, 4> providers = {"udpm", "memq", "file", "tcpq"};

std::optional<int> parse_int(std::string_view text, int lowest, int highest) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (value < lowest || value > highest) return std::nullopt;
  return value;
}

MulticastAddress parse_target(const std::string& url, std::string_view target) {
  if (target.empty()) target = "239.255.76.67:7667";
  const std::size_t colon = target.find(':');
  MulticastAddress address;
  address.group = target.substr(0, colon);
  in_addr group{};
  if (inet_pton(AF_INET, address.group.c_str(), &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr)))
    throw UrlError(url + ": the address must be a multicast group, 224.0.0.0 to 239.255.255.255");
  const auto port = colon == std::string_view::npos ? std::nullopt
                                                    : parse_int(target.substr(colon + 1), 1, 65535);
  if (!port) throw UrlError(url + ": the port must be in 1 to 65535");
  address.port = static_cast<std::uint16_t>(*port);
  return address;
}

}  // namespace

LcmUrl parse_url(const std::string& text) {
  const std::size_t scheme = text.find("://");
  if (scheme == std::string::npos ||
      std::ranges::find(providers, std::string_view(text).substr(0, scheme)) == providers.end())
    throw UrlError(text +
                   ": must be udpm://GROUP:PORT?ttl=N, memq://, file://LOG or tcpq://HOST:PORT");
  LcmUrl url;
  url.text = text;
  const std::string_view rest = std::string_view(text).substr(scheme + 3);
  const std::size_t question = std::min(rest.find('?'), rest.size());
  std::string_view arguments = rest.substr(std::min(question + 1, rest.size()));
  if (text.starts_with("file")) {
    url.log = rest.substr(0, question);
    url.writes_log = arguments.find("mode=w") != std::string_view::npos;
  }
  if (!text.starts_with("udpm")) return url;

  url.multicast = parse_target(text, rest.substr(0, question));
  while (!arguments.empty()) {
    const std::size_t end = arguments.find_first_of("&,");
    const std::string_view argument = arguments.substr(0, end);
    if (argument.starts_with("recv_buf_size=")) {
      url.receive_buffer = parse_int(argument.substr(14), 1, 1 << 30);
      if (!url.receive_buffer) throw UrlError(text + ": recv_buf_size must be in 1 to 1073741824");
    }
    if (argument.starts_with("ttl=")) {
      const auto ttl = parse_int(argument.substr(4), 0, 255);
      if (!ttl) throw UrlError(text + ": ttl must be in 0 to 255");
      url.multicast->ttl = *ttl;
    }
    arguments.remove_prefix(end == std::string_view::npos ? arguments.size() : end + 1);
  }
  return url;
}

}  // namespace sprag
