#include "lcmtypes/bus.h"

#include <lcm/lcm.h>
#include <poll.h>

#include <cerrno>
#include <exception>
#include <system_error>
#include <utility>
#include <vector>

#include "lcmtypes/multicast_probe.h"

namespace sprag {

namespace {

constexpr int wanted_receive_buffer = 4'000'000;
// A packet without an end of its channel name arrives with a negative size, read as unsigned. LCM
// itself accepts messages up to this size.
constexpr std::uint32_t largest_message = 1U << 28U;
constexpr int largest_batch = 1000;

struct Subscription {
  Bus::Handler handler;
  std::exception_ptr* failure;  // the bus's own, thrown on by Bus::handle()
};

void call_handler(const lcm_recv_buf_t* received, const char* channel, void* user) noexcept {
  auto& subscription = *static_cast<Subscription*>(user);
  if (received->data_size > largest_message) return;
  try {
    subscription.handler(channel,
                         {static_cast<const std::uint8_t*>(received->data), received->data_size},
                         received->recv_utime);
  } catch (...) {
    if (!*subscription.failure) *subscription.failure = std::current_exception();
  }
}

/// `text` as an expression that matches it alone: LCM takes channel names for regular expressions.
std::string escaped(std::string_view text) {
  std::string expression;
  for (const char c : text) {
    if (std::string_view(R"(\^$.|?*+()[]{})").find(c) != std::string_view::npos) expression += '\\';
    expression += c;
  }
  return expression;
}

/// Probes multicast and returns the address with a receive buffer that the kernel grants.
std::string prepared(const LcmUrl& url) {
  if (!url.multicast) return url.text;
  const MulticastProbe probe = probe_multicast(*url.multicast, wanted_receive_buffer);
  if (!probe.failure.empty()) {
    throw BusError(url.text + ": multicast does not work on this host (" + probe.failure +
                   "). As root:\n"
                   "    ip link set lo up\n"
                   "    ip route add 224.0.0.0/4 dev lo");
  }
  if (url.sets_receive_buffer || probe.receive_buffer <= 0) return url.text;
  // More than the kernel grants would make LCM warn at every start.
  return url.text + (url.text.find('?') == std::string::npos ? "?" : "&") +
         "recv_buf_size=" + std::to_string(probe.receive_buffer);
}

}  // namespace

struct Bus::Impl {
  explicit Impl(const std::string& address) : url(address), lcm(nullptr, lcm_destroy) {
    lcm.reset(lcm_create(prepared(parse_url(url)).c_str()));
    if (!lcm) throw BusError(url + ": LCM cannot open it");
  }

  int descriptor() const {
    const int result = lcm_get_fileno(lcm.get());
    if (result < 0) throw BusError(url + ": LCM cannot receive");
    return result;
  }

  void subscribe(const std::string& expression, Handler handler) {
    subscriptions.push_back(
        std::make_unique<Subscription>(Subscription{std::move(handler), &failure}));
    lcm_subscription_t* subscription =
        lcm_subscribe(lcm.get(), expression.c_str(), call_handler, subscriptions.back().get());
    if (subscription == nullptr) throw BusError(url + ": cannot subscribe to " + expression);
    lcm_subscription_set_queue_capacity(subscription, 0);
    descriptor();  // where multicast is blocked, this alone shows it
  }

  std::string url;
  std::exception_ptr failure;
  std::vector<std::unique_ptr<Subscription>> subscriptions;
  std::unique_ptr<lcm_t, decltype(&lcm_destroy)> lcm;  // goes first: it calls the subscriptions
};

Bus::Bus(const std::string& url) : impl_(std::make_unique<Impl>(url)) {}
Bus::Bus(Bus&&) noexcept = default;
Bus& Bus::operator=(Bus&&) noexcept = default;
Bus::~Bus() = default;

void Bus::subscribe(std::string_view channel, Handler handler) {
  impl_->subscribe(escaped(channel), std::move(handler));
}

void Bus::subscribe_prefix(std::string_view prefix, Handler handler) {
  impl_->subscribe(escaped(prefix) + ".*", std::move(handler));
}

bool Bus::publish(const char* channel, std::span<const std::uint8_t> data) noexcept {
  return lcm_publish(impl_->lcm.get(), channel, data.data(),
                     static_cast<unsigned int>(data.size())) == 0;
}

int Bus::handle(std::chrono::milliseconds timeout) {
  // lcm_handle_timeout aborts where there is no descriptor, and calls a signal an error.
  pollfd ready{impl_->descriptor(), POLLIN, 0};
  int wait = static_cast<int>(timeout.count());
  for (int handled = 0; handled < largest_batch; ++handled) {
    const int count = ::poll(&ready, 1, wait);
    if (count == 0 || (count < 0 && errno == EINTR)) return handled;
    if (count < 0) throw BusError(impl_->url + ": " + std::generic_category().message(errno));
    if (lcm_handle(impl_->lcm.get()) != 0) {
      if (handled > 0) return handled;  // the error comes again
      throw BusError(impl_->url + ": LCM has nothing more to read");
    }
    if (impl_->failure) std::rethrow_exception(std::exchange(impl_->failure, nullptr));
    wait = 0;
  }
  return largest_batch;
}

int Bus::fileno() { return impl_->descriptor(); }

}  // namespace sprag
