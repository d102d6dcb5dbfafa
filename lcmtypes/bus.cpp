#include "lcmtypes/bus.h"

#include <lcm/lcm.h>
#include <poll.h>

#include <cerrno>
#include <exception>
#include <mutex>
#include <system_error>
#include <utility>
#include <vector>

#include "lcmtypes/channel_log.h"
#include "lcmtypes/multicast_probe.h"
#include "lcmtypes/udp_receiver.h"
#include "lcmtypes/wall_clock.h"

namespace sprag {

namespace {

constexpr int wanted_receive_buffer = 4'000'000;
constexpr int largest_batch = 1000;

void probe(const LcmUrl& url) {
  if (!url.multicast) return;
  const std::optional<ProbeFailure> failure = probe_multicast(*url.multicast);
  if (!failure) return;
  const std::string port = std::to_string(url.multicast->port);
  switch (failure->cause) {
    case ProbeFailure::Cause::port_taken:
      throw BusError(url.text + ": UDP port " + port + " is in use (" + failure->what +
                     ") by another program that does not share it. End that program, or choose "
                     "another port with --url in all programs of this run");
    case ProbeFailure::Cause::port_refused:
      throw BusError(url.text + ": UDP port " + port + " cannot be used (" + failure->what +
                     "). Choose another port with --url in all programs of this run");
    case ProbeFailure::Cause::no_multicast:
      throw BusError(url.text + ": multicast does not work on this host (" + failure->what +
                     "). As root:\n"
                     "    ip link set lo up\n"
                     "    ip route add 224.0.0.0/4 dev lo");
  }
}

}  // namespace

struct Bus::Impl {
  struct Subscription {
    std::string channel;
    bool is_prefix;
    Bus::Handler handler;

    bool wants(std::string_view name) const {
      return is_prefix ? name.starts_with(channel) : name == channel;
    }
  };

  Impl(const std::string& address, std::optional<Key> secret)
      : url(parse_url(address)), key(secret), lcm(nullptr, lcm_destroy) {
    if (url.writes_log) {
      log.emplace(url.log);
      if (!log->good()) throw BusError(log->error());
      return;
    }
    probe(url);
    lcm.reset(lcm_create(url.text.c_str()));
    if (!lcm) throw BusError(url.text + ": LCM cannot open it");
  }

  void subscribe(std::string_view channel, bool is_prefix, Handler handler) {
    if (log)
      throw BusError(url.text + ": is a log that is written; nothing can be received from it");
    subscriptions.push_back({std::string(channel), is_prefix, std::move(handler)});
    if (url.multicast) {
      if (!udp) open();
      return;
    }
    if (subscriptions.size() > 1) return;
    // LCM treats channel names as regular expressions, so this subscribes to all and wants()
    // selects.
    lcm_subscription_t* all = lcm_subscribe(lcm.get(), ".*", take_from_lcm, this);
    if (all == nullptr) throw BusError(url.text + ": cannot be subscribed to");
    lcm_subscription_set_queue_capacity(all, 0);
    descriptor();
  }

  void open() {
    try {
      udp = std::make_unique<UdpReceiver>(*url.multicast,
                                          url.receive_buffer.value_or(wanted_receive_buffer));
    } catch (const std::system_error& error) {
      throw BusError(url.text + ": " + error.what());
    }
  }

  int descriptor() const {
    const int result = udp ? udp->descriptor() : lcm ? lcm_get_fileno(lcm.get()) : -1;
    if (result < 0) throw BusError(url.text + ": LCM cannot receive");
    return result;
  }

  /// Waits up to `wait` ms and handles the packets that have arrived. Returns their number.
  int handle(int wait) {
    // lcm_handle_timeout aborts without a descriptor and reports a signal as an error.
    pollfd ready{descriptor(), POLLIN, 0};
    for (int handled = 0; handled < largest_batch; ++handled) {
      const int count = ::poll(&ready, 1, wait);
      if (count == 0 || (count < 0 && errno == EINTR)) return handled;
      if (count < 0) throw BusError(url.text + ": " + std::generic_category().message(errno));
      if (!take() && !udp) {
        if (handled > 0) return handled;  // the next call reports the error
        throw BusError(url.text + ": LCM has nothing more to read");
      }
      wait = 0;
    }
    return largest_batch;
  }

  /// Handles one packet, if there is one. Throws the exception of a handler, or BusError.
  bool take() {
    if (udp) return take_from_udp();
    const bool taken = lcm_handle(lcm.get()) == 0;
    if (failure) std::rethrow_exception(std::exchange(failure, nullptr));
    return taken;
  }

  bool take_from_udp() {
    UdpReceiver::Datagram datagram;
    try {
      if (!udp->receive(datagram)) return false;
    } catch (const std::system_error& error) {
      throw BusError(url.text + ": " + error.what());
    }
    counts.overflowed = udp->overflowed();
    sender = datagram.sender;
    if (datagram.other_host) {
      ++counts.other_host;
      return true;
    }
    Packet packet;
    const PacketFault fault = read_packet(datagram.bytes, packet);
    ++counts.faults[static_cast<std::size_t>(fault)];
    if (fault == PacketFault::none) deliver(packet.channel, packet.data, datagram.utime);
    return true;
  }

  // An exception must not propagate through LCM's C code.
  static void take_from_lcm(const lcm_recv_buf_t* received, const char* channel,
                            void* user) noexcept {
    auto& self = *static_cast<Impl*>(user);
    try {
      self.deliver(channel, {static_cast<const std::uint8_t*>(received->data), received->data_size},
                   received->recv_utime);
    } catch (...) {
      if (!self.failure) self.failure = std::current_exception();
    }
  }

  void deliver(std::string_view channel, std::span<const std::uint8_t> data, std::int64_t utime) {
    bool verified = !key;
    for (const Subscription& subscription : subscriptions) {
      if (!subscription.wants(channel)) continue;
      if (!verified && !key->verifies(channel, data)) {
        ++counts.unauthenticated;
        return;
      }
      verified = true;
      subscription.handler(channel, key ? data.first(data.size() - Key::tag_size) : data, utime);
    }
  }

  std::function<void(std::string_view, std::span<const std::uint8_t>)> copy;
  LcmUrl url;
  std::optional<Key> key;
  std::vector<Subscription> subscriptions;
  std::unique_ptr<UdpReceiver> udp;  // only with a subscription over multicast
  std::mutex log_mutex;
  std::optional<ChannelLogWriter> log;  // replaces lcm, which does not report a full disk
  BusCounts counts;
  std::uint64_t sender = 0;  // of the packet being handled
  std::exception_ptr failure;
  std::unique_ptr<lcm_t, decltype(&lcm_destroy)> lcm;  // destroyed first: it calls take_from_lcm
};

Bus::Bus(const std::string& url, std::optional<Key> key)
    : impl_(std::make_unique<Impl>(url, key)) {}
Bus::Bus(Bus&&) noexcept = default;
Bus& Bus::operator=(Bus&&) noexcept = default;
Bus::~Bus() = default;

void Bus::subscribe(std::string_view channel, Handler handler) {
  impl_->subscribe(channel, false, std::move(handler));
}

void Bus::subscribe_prefix(std::string_view prefix, Handler handler) {
  impl_->subscribe(prefix, true, std::move(handler));
}

bool Bus::publish(const char* channel, std::span<const std::uint8_t> data) noexcept {
  // Grows once to the largest message of the thread.
  static thread_local std::vector<std::uint8_t> tagged;
  if (impl_->key) {
    const Key::Tag tag = impl_->key->tag(channel, data);
    tagged.assign(data.begin(), data.end());
    tagged.insert(tagged.end(), tag.begin(), tag.end());
    data = tagged;
  }
  if (impl_->url.multicast && data.size() > largest_packet_message) return false;
  if (impl_->copy) impl_->copy(channel, data);
  if (impl_->log) {
    const std::lock_guard lock(impl_->log_mutex);
    return impl_->log->write(wall_clock_us(), channel, data);
  }
  return lcm_publish(impl_->lcm.get(), channel, data.data(),
                     static_cast<unsigned int>(data.size())) == 0;
}

void Bus::copy_published(
    std::function<void(std::string_view, std::span<const std::uint8_t>)> copy) {
  impl_->copy = std::move(copy);
}

void Bus::finish() {
  if (impl_->log && !impl_->log->close()) throw BusError(impl_->log->error());
}

int Bus::handle(std::chrono::milliseconds timeout) {
  const int handled = impl_->handle(static_cast<int>(timeout.count()));
  if (impl_->udp && handled < largest_batch) {
    impl_->udp->count_drops();
    impl_->counts.overflowed = impl_->udp->overflowed();
  }
  return handled;
}

std::span<const std::uint8_t> Bus::as_sent(std::span<const std::uint8_t> data) const {
  return impl_->key ? std::span(data.data(), data.size() + Key::tag_size) : data;
}

std::uint64_t Bus::sender() const { return impl_->sender; }

const BusCounts& Bus::counts() const { return impl_->counts; }

}  // namespace sprag
