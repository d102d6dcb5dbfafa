#include "studies/bench_latency/latency.h"

#include <fcntl.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contact_messages.h"
#include "lcmtypes/messages.h"
#include "lcmtypes/wall_clock.h"
#include "observer/wake.h"

namespace sprag::bench_latency {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t millisecond = 1'000'000;

/// A process that is ended together with this one.
class Child {
 public:
  template <typename Body>
  explicit Child(const Body& body) : pid_(::fork()) {
    if (pid_ < 0) throw std::runtime_error("fork failed");
    if (pid_ > 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    body();
    ::_exit(127);
  }
  ~Child() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool running() const { return ::waitpid(pid_, nullptr, WNOHANG) == 0; }

 private:
  pid_t pid_;
};

using Payload = std::array<std::uint8_t, 1272>;  // the size of contacts_t

/// Sends every datagram back to its sender.
void echo_udp(int socket) {
  ::signal(SIGTERM, SIG_DFL);
  Payload payload;
  while (true) {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t bytes = ::recvfrom(socket, payload.data(), payload.size(), 0,
                                     reinterpret_cast<sockaddr*>(&from), &size);
    if (bytes < 0) return;
    ::sendto(socket, payload.data(), static_cast<std::size_t>(bytes), 0,
             reinterpret_cast<const sockaddr*>(&from), size);
  }
}

void echo_lcm(const std::string& url) {
  ::signal(SIGTERM, SIG_DFL);
  lcm_t* lcm = lcm_create(url.c_str());
  if (lcm == nullptr) return;
  lcm_subscribe(
      lcm, "PING",
      [](const lcm_recv_buf_t* received, const char*, void* user) {
        lcm_publish(static_cast<lcm_t*>(user), "PONG", received->data, received->data_size);
      },
      lcm);
  while (lcm_handle(lcm) == 0) {
  }
}

class UdpPing {
 public:
  UdpPing() : far_(open()), near_(open()), echo_([this] { echo_udp(far_); }) {
    socklen_t size = sizeof to_;
    ::getsockname(far_, reinterpret_cast<sockaddr*>(&to_), &size);
  }
  ~UdpPing() {
    ::close(far_);
    ::close(near_);
  }
  UdpPing(const UdpPing&) = delete;
  UdpPing& operator=(const UdpPing&) = delete;

  /// Round trip [ns]; negative if no reply came.
  std::int64_t measure() {
    const std::int64_t start = monotonic_now();
    ::sendto(near_, payload_.data(), payload_.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
             sizeof to_);
    pollfd ready{near_, POLLIN, 0};
    if (::poll(&ready, 1, 1000) != 1) return -1;
    (void)::recv(near_, payload_.data(), payload_.size(), 0);
    return monotonic_now() - start;
  }

 private:
  static int open() {
    const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in any{};
    any.sin_family = AF_INET;
    any.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (socket < 0 || ::bind(socket, reinterpret_cast<const sockaddr*>(&any), sizeof any) != 0) {
      throw std::runtime_error("UDP does not work on this host");
    }
    return socket;
  }

  Payload payload_{};
  int far_, near_;
  sockaddr_in to_{};
  Child echo_;
};

class LcmPing {
 public:
  explicit LcmPing(const std::string& url)
      : echo_([&url] { echo_lcm(url); }), lcm_(lcm_create(url.c_str())) {
    if (lcm_ == nullptr) throw std::runtime_error("LCM cannot open " + url);
    lcm_subscribe(
        lcm_, "PONG",
        [](const lcm_recv_buf_t*, const char*, void* user) { ++*static_cast<int*>(user); },
        &answers_);
  }
  ~LcmPing() { lcm_destroy(lcm_); }
  LcmPing(const LcmPing&) = delete;
  LcmPing& operator=(const LcmPing&) = delete;

  std::int64_t measure() {
    const int before = answers_;
    const std::int64_t start = monotonic_now();
    lcm_publish(lcm_, "PING", payload_.data(), static_cast<unsigned>(payload_.size()));
    while (answers_ == before) {
      if (lcm_handle_timeout(lcm_, 1000) <= 0) return -1;
    }
    return monotonic_now() - start;
  }

 private:
  Payload payload_{};
  Child echo_;
  lcm_t* lcm_;
  int answers_ = 0;
};

/// Simulates the machine: a contact that closes and opens, at speed 1.
class Machine {
 public:
  Machine(const std::string& url, std::optional<Key> key, int contacts)
      : bus_(url, key), start_(monotonic_now()) {
    report_.session = static_cast<std::int64_t>(std::random_device{}());
    report_.contacts = contacts;
    report_.speed = 1.0;
    bus_.subscribe(estimate_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                            std::int64_t) {
      if (decode(data, estimate_) != Refusal::none) return;
      if (estimate_.session != report_.session) return;
      received_ = true;
      if (estimate_.t >= event_ && static_cast<ContactSet>(estimate_.closed) == report_.closed) {
        arrived_ = monotonic_now();
      }
    });
  }

  void heartbeat() {
    report_.horizon = now();
    send();
    bus_.handle(0ms);
  }

  bool received() const { return received_; }

  /// Time from the sending of an event to the first estimate that contains it [ns]; negative if
  /// none came.
  std::int64_t measure() {
    bus_.handle(0ms);
    event_ = report_.horizon = now();
    report_.closed ^= 1U;
    if (report_.records == max_records) {
      std::rotate(report_.record.begin(), report_.record.begin() + 1, report_.record.end());
    } else {
      ++report_.records;
    }
    ++report_.records_total;
    report_.record[static_cast<std::size_t>(report_.records) - 1] = {
        event_, 0, report_.closed != 0 ? ContactEventKind::closes : ContactEventKind::opens};
    arrived_ = 0;
    const std::int64_t start = monotonic_now();
    send();
    const std::int64_t latest = start + 1000 * millisecond;
    while (arrived_ == 0 && monotonic_now() < latest) bus_.handle(10ms);
    return arrived_ == 0 ? -1 : arrived_ - start;
  }

 private:
  double now() const { return 1e-9 * static_cast<double>(monotonic_now() - start_); }

  void send() {
    ++report_.sequence;
    report_.utime = wall_clock_us();
    (void)bus_.publish(contacts_channel, encode(report_, buffer_));
  }

  Bus bus_;
  std::int64_t start_;
  ContactMessage report_;
  std::vector<std::uint8_t> buffer_;
  estimate_t estimate_{};
  double event_ = 0.0;
  std::int64_t arrived_ = 0;
  bool received_ = false;
};

/// Simulates a device that prints the edges of the contact for `listen`.
class Device {
 public:
  Device(const std::string& url, std::optional<Key> key, int lines)
      : bus_(url, key), lines_(lines), start_(monotonic_now()) {
    bus_.subscribe(estimate_channel, [this](std::string_view, std::span<const std::uint8_t> data,
                                            std::int64_t) {
      if (decode(data, estimate_) != Refusal::none) return;
      received_ = true;
      if (estimate_.t >= event_ && static_cast<ContactSet>(estimate_.closed) == closed_) {
        arrived_ = monotonic_now();
      }
    });
  }

  void heartbeat() {
    print();
    bus_.handle(0ms);
  }

  bool received() const { return received_; }

  /// Time from the writing of a line to the first estimate that contains its edge [ns]; negative if
  /// none came.
  std::int64_t measure() {
    bus_.handle(0ms);
    closed_ ^= 1U;
    arrived_ = 0;
    const std::int64_t start = monotonic_now();
    print();
    const std::int64_t latest = start + 1000 * millisecond;
    while (arrived_ == 0 && monotonic_now() < latest) bus_.handle(10ms);
    return arrived_ == 0 ? -1 : arrived_ - start;
  }

 private:
  void print() {
    event_ = 1e-9 * static_cast<double>(monotonic_now() - start_);
    char line[64];
    const int size = std::snprintf(line, sizeof line, "%.9f,1,%d\n", event_, closed_ != 0 ? 1 : 0);
    if (::write(lines_, line, static_cast<std::size_t>(size)) != size)
      throw std::runtime_error("listen does not read its lines");
    event_ = std::strtod(line, nullptr);
  }

  Bus bus_;
  int lines_;  // file descriptor
  std::int64_t start_;
  estimate_t estimate_{};
  double event_ = 0.0;
  ContactSet closed_ = 0;
  std::int64_t arrived_ = 0;
  bool received_ = false;
};

/// Replaces this process by an observer or by `listen`.
void become(const std::string& program, const Options& options, const CommonOptions& common,
            const std::string& url, const std::vector<std::string>& more) {
  std::vector<std::string> arguments{program, options.scene.string(), "--url", url};
  if (!common.key.empty()) arguments.insert(arguments.end(), {"--key", common.key.string()});
  arguments.insert(arguments.end(), more.begin(), more.end());
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  ::dup2(::open("/dev/null", O_WRONLY), STDERR_FILENO);
  ::execv(program.c_str(), pointers.data());
}

void wait(std::int64_t ns) { sleep_until(monotonic_now() + ns); }

}  // namespace

double Samples::us(double p) const {
  if (ns.empty()) return 0.0;
  std::vector<std::int64_t> sorted = ns;
  std::sort(sorted.begin(), sorted.end());
  return 1e-3 * static_cast<double>(
                    sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))]);
}

std::vector<Samples> measure(const Options& options, const CommonOptions& common, int contacts) {
  LcmPing lcm(options.lcm_url);
  UdpPing udp;
  std::vector<std::string> observing{"--estimator", "replica", "--tick",
                                     std::to_string(options.tick)};
  if (options.real_time) observing.emplace_back("--realtime");
  const auto observe = [&](const std::string& url) {
    become(options.observer, options, common, url, observing);
  };
  const Child observer([&] { observe(common.url); });
  const Child second_observer([&] { observe(options.listen_url); });
  int pipe[2];
  if (::pipe2(pipe, O_CLOEXEC) != 0) throw std::runtime_error("there is no pipe");
  const Child listen([&] {
    ::dup2(pipe[0], STDIN_FILENO);
    become(options.listen, options, common, options.listen_url, {"--latency", "1"});
  });
  ::close(pipe[0]);
  Machine machine(common.url, key_of(common), contacts);
  Device device(options.listen_url, key_of(common), pipe[1]);
  while (!machine.received() || !device.received()) {
    machine.heartbeat();
    device.heartbeat();
    wait(10 * millisecond);
    if (!observer.running() || !second_observer.running())
      throw std::runtime_error(options.observer + " does not run");
    if (!listen.running()) throw std::runtime_error(options.listen + " does not run");
  }
  std::mt19937 random(1);
  std::vector<Samples> samples{
      {"event to estimate", {}}, {"LCM ping", {}}, {"UDP ping", {}}, {"line to estimate", {}}};
  for (int i = 0; i < options.events && !stop_requested(); ++i) {
    wait(2 * millisecond + static_cast<std::int64_t>(random() % (2 * millisecond)));
    machine.heartbeat();
    wait(2 * millisecond);
    samples[0].add(machine.measure());
    wait(2 * millisecond);
    machine.heartbeat();
    samples[1].add(lcm.measure());
    wait(2 * millisecond);
    samples[2].add(udp.measure());
    machine.heartbeat();
    device.heartbeat();
    wait(2 * millisecond + static_cast<std::int64_t>(random() % (2 * millisecond)));
    samples[3].add(device.measure());
    machine.heartbeat();
  }
  ::close(pipe[1]);
  return samples;
}

}  // namespace sprag::bench_latency
