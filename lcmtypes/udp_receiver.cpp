#include "lcmtypes/udp_receiver.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <system_error>

#include "lcmtypes/big_endian.h"

namespace sprag {
namespace {

constexpr std::uint32_t short_magic = 0x4c433032;     // "LC02"
constexpr std::uint32_t fragment_magic = 0x4c433033;  // "LC03"
constexpr std::size_t header_size = 8;
constexpr std::size_t longest_name = 63;

constexpr std::size_t largest_datagram = 65536;
constexpr std::int64_t addresses_last = 1'000'000'000;  // ns

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

std::int64_t nanoseconds(clockid_t clock) {
  timespec time;
  clock_gettime(clock, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

std::string_view name(PacketFault fault) {
  constexpr std::array<std::string_view, packet_faults> names = {"none", "foreign", "fragment",
                                                                 "no_channel"};
  static_assert(static_cast<int>(PacketFault::no_channel) + 1 == packet_faults);
  return names.at(static_cast<std::size_t>(fault));
}

PacketFault read_packet(std::span<const std::uint8_t> bytes, Packet& packet) noexcept {
  if (bytes.size() < header_size) return PacketFault::foreign;
  const std::uint8_t* from = bytes.data();
  const auto magic = take<std::uint32_t>(from);
  if (magic == fragment_magic) return PacketFault::fragment;
  if (magic != short_magic) return PacketFault::foreign;
  const auto rest = bytes.subspan(header_size);
  const auto searched = rest.first(std::min(rest.size(), longest_name + 1));
  const auto end = std::find(searched.begin(), searched.end(), std::uint8_t{0});
  if (end == searched.end() || end == searched.begin()) return PacketFault::no_channel;
  const auto length = static_cast<std::size_t>(end - searched.begin());
  packet.channel = {reinterpret_cast<const char*>(rest.data()), length};
  packet.data = rest.subspan(length + 1);
  return PacketFault::none;
}

UdpReceiver::UdpReceiver(const MulticastAddress& address, int receive_buffer)
    : descriptor_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)),
      this_host_only_(address.ttl == 0),
      buffer_(largest_datagram) {
  if (!descriptor_) fail("socket");
  const auto set = [this](int level, int option, const auto& value) {
    return ::setsockopt(descriptor(), level, option, &value, sizeof value) == 0;
  };
  const int yes = 1;
  const int no = 0;
  if (!set(SOL_SOCKET, SO_RCVBUFFORCE, receive_buffer)) {
    set(SOL_SOCKET, SO_RCVBUF, receive_buffer);
  }
  set(SOL_SOCKET, SO_TIMESTAMPNS, yes);
  set(SOL_SOCKET, SO_RXQ_OVFL, yes);
  set(IPPROTO_IP, IP_MULTICAST_ALL, no);

  sockaddr_in any{};
  any.sin_family = AF_INET;
  any.sin_port = htons(address.port);
  ip_mreq membership{};
  inet_pton(AF_INET, address.group.c_str(), &membership.imr_multiaddr);
  if (!set(SOL_SOCKET, SO_REUSEADDR, yes) ||
      ::bind(descriptor(), reinterpret_cast<const sockaddr*>(&any), sizeof any) != 0 ||
      !set(IPPROTO_IP, IP_ADD_MEMBERSHIP, membership)) {
    fail("multicast");
  }
  if (this_host_only_) read_own_addresses();
}

bool UdpReceiver::receive(Datagram& datagram) {
  sockaddr_in sender{};
  iovec part{buffer_.data(), buffer_.size()};
  alignas(cmsghdr) std::array<char, 256> control;
  msghdr message{};
  message.msg_name = &sender;
  message.msg_namelen = sizeof sender;
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(descriptor(), &message, 0);
  if (size < 0) {
    if (errno == EAGAIN || errno == EINTR) return false;
    fail("recvmsg");
  }
  timespec arrival{};
  for (cmsghdr* head = CMSG_FIRSTHDR(&message); head != nullptr;
       head = CMSG_NXTHDR(&message, head)) {
    if (head->cmsg_level != SOL_SOCKET) continue;
    if (head->cmsg_type == SCM_TIMESTAMPNS) {
      std::memcpy(&arrival, CMSG_DATA(head), sizeof arrival);
    } else if (head->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(head), sizeof drops);
      note_drops(drops);
    }
  }
  datagram.bytes = {buffer_.data(), static_cast<std::size_t>(size)};
  datagram.utime = arrival.tv_sec != 0
                       ? std::int64_t{arrival.tv_sec} * 1'000'000 + arrival.tv_nsec / 1000
                       : nanoseconds(CLOCK_REALTIME) / 1000;
  datagram.sender = std::uint64_t{sender.sin_addr.s_addr} << 16U | sender.sin_port;
  datagram.other_host = this_host_only_ && !from_here(sender.sin_addr.s_addr);
  return true;
}

// `drops` is the kernel's count modulo 2^32. That of a waiting datagram may be older than
// last_drops_.
void UdpReceiver::note_drops(std::uint32_t drops) {
  const auto more = static_cast<std::int32_t>(drops - last_drops_);
  if (more <= 0) return;
  overflowed_ += more;
  last_drops_ = drops;
}

// SO_RXQ_OVFL reports drops only with the next received datagram, which may never arrive.
void UdpReceiver::count_drops() {
  std::array<std::uint32_t, SK_MEMINFO_VARS> figures{};
  socklen_t size = sizeof figures;
  if (::getsockopt(descriptor(), SOL_SOCKET, SO_MEMINFO, figures.data(), &size) == 0) {
    note_drops(figures[SK_MEMINFO_DROPS]);
  }
}

bool UdpReceiver::from_here(std::uint32_t address) {
  // On a host without addresses except the loopback, packets come from 0.0.0.0. The kernel drops
  // packets from outside with that address, as it does those with an address of this host.
  const auto known = [&] {
    return address == INADDR_ANY ||
           std::find(own_addresses_.begin(), own_addresses_.end(), address) != own_addresses_.end();
  };
  if (known()) return true;
  // This host may have received a new address since the list was read.
  if (nanoseconds(CLOCK_MONOTONIC) - addresses_read_ < addresses_last) return false;
  read_own_addresses();
  return known();
}

void UdpReceiver::read_own_addresses() {
  addresses_read_ = nanoseconds(CLOCK_MONOTONIC);
  ifaddrs* interfaces = nullptr;
  if (::getifaddrs(&interfaces) != 0) fail("getifaddrs");
  own_addresses_.clear();
  for (const ifaddrs* i = interfaces; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address;
    std::memcpy(&address, i->ifa_addr, sizeof address);
    own_addresses_.push_back(address.sin_addr.s_addr);
  }
  ::freeifaddrs(interfaces);
}

}  // namespace sprag
