// bench_latency: from the sending of a contact event to the estimate that contains it, beside a
// bare LCM ping and a bare UDP ping of the same size in the same run. All three go there and back.
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
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/contacts_codec.h"
#include "lcmtypes/program.h"
#include "lcmtypes/state_codec.h"
#include "mechanics/scene.h"
#include "observer/wake.h"

namespace {

using namespace std::chrono_literals;

constexpr auto patience = 1s;
constexpr std::int64_t millisecond = 1'000'000;

struct Options {
  std::string scene;
  std::string observer;
  double tick = 1e-3;
  int events = 2000;
  bool real_time = false;
  std::string lcm_url = "udpm://239.255.76.67:7677?ttl=0";
};

/// A process that ends with this one.
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

using Payload = sprag::ContactsMessage;

/// Sends every datagram back to where it came from.
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

  /// There and back [ns]; negative if nothing came back.
  std::int64_t measure() {
    const std::int64_t start = sprag::monotonic_now();
    ::sendto(near_, payload_.data(), payload_.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
             sizeof to_);
    pollfd ready{near_, POLLIN, 0};
    if (::poll(&ready, 1, 1000) != 1) return -1;
    (void)::recv(near_, payload_.data(), payload_.size(), 0);
    return sprag::monotonic_now() - start;
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
    const std::int64_t start = sprag::monotonic_now();
    lcm_publish(lcm_, "PING", payload_.data(), static_cast<unsigned>(payload_.size()));
    while (answers_ == before) {
      if (lcm_handle_timeout(lcm_, 1000) <= 0) return -1;
    }
    return sprag::monotonic_now() - start;
  }

 private:
  Payload payload_{};
  Child echo_;
  lcm_t* lcm_;
  int answers_ = 0;
};

/// Plays the machine: a contact that closes and opens, at speed 1.
class Machine {
 public:
  Machine(const std::string& url, std::optional<sprag::Key> key, int contacts)
      : bus_(url, std::move(key)), start_(sprag::monotonic_now()) {
    report_.session = static_cast<std::int64_t>(std::random_device{}());
    report_.contacts = contacts;
    report_.speed = 1.0;
    bus_.subscribe(sprag::estimate_channel,
                   [this](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
                     if (sprag::decode(data, estimate_) != sprag::Refusal::none) return;
                     if (estimate_.session != report_.session) return;
                     heard_ = true;
                     if (estimate_.t >= event_ && estimate_.closed == report_.closed) {
                       arrived_ = sprag::monotonic_now();
                     }
                   });
  }

  void heartbeat() {
    report_.horizon = now();
    send();
    bus_.handle(0ms);
  }

  bool heard() const { return heard_; }

  /// From the sending of an event to the first estimate that contains it [ns]; negative if none
  /// came.
  std::int64_t measure() {
    bus_.handle(0ms);
    event_ = report_.horizon = now();
    report_.closed ^= 1U;
    if (report_.records == sprag::max_records) {
      std::rotate(report_.record.begin(), report_.record.begin() + 1, report_.record.end());
    } else {
      ++report_.records;
    }
    ++report_.records_total;
    report_.record[static_cast<std::size_t>(report_.records) - 1] = {
        event_, 0,
        report_.closed != 0 ? sprag::ContactEventKind::closes : sprag::ContactEventKind::opens};
    arrived_ = 0;
    const std::int64_t start = sprag::monotonic_now();
    send();
    const std::int64_t latest = start + 1000 * millisecond;
    while (arrived_ == 0 && sprag::monotonic_now() < latest) bus_.handle(10ms);
    return arrived_ == 0 ? -1 : arrived_ - start;
  }

 private:
  double now() const { return 1e-9 * static_cast<double>(sprag::monotonic_now() - start_); }

  void send() {
    ++report_.sequence;
    report_.utime = sprag::wall_clock_us();
    encode(report_, message_);
    (void)bus_.publish(sprag::contacts_channel, message_);
  }

  sprag::Bus bus_;
  std::int64_t start_;
  sprag::ContactReport report_;
  Payload message_{};
  sprag::EstimateSample estimate_;
  double event_ = 0.0;
  std::int64_t arrived_ = 0;
  bool heard_ = false;
};

struct Samples {
  const char* what;
  std::vector<std::int64_t> ns;
  int lost = 0;

  void add(std::int64_t value) {
    if (value < 0) {
      ++lost;
    } else {
      ns.push_back(value);
    }
  }

  double us(double p) {
    if (ns.empty()) return 0.0;
    const auto rank = static_cast<std::size_t>(p * static_cast<double>(ns.size() - 1));
    std::nth_element(ns.begin(), ns.begin() + static_cast<std::ptrdiff_t>(rank), ns.end());
    return 1e-3 * static_cast<double>(ns[rank]);
  }
};

void wait(std::int64_t ns) { sprag::sleep_until(sprag::monotonic_now() + ns); }

std::vector<Samples> measure(const Options& options, const sprag::CommonOptions& common,
                             int contacts) {
  LcmPing lcm(options.lcm_url);
  UdpPing udp;
  const Child observer([&] {
    const std::string tick = std::to_string(options.tick);
    std::vector<const char*> arguments{options.observer.c_str(),
                                       options.scene.c_str(),
                                       "--url",
                                       common.url.c_str(),
                                       "--tick",
                                       tick.c_str()};
    const std::string key = common.key.string();
    if (!key.empty()) arguments.insert(arguments.end(), {"--key", key.c_str()});
    if (options.real_time) arguments.push_back("--realtime");
    arguments.push_back(nullptr);
    ::dup2(::open("/dev/null", O_WRONLY), STDERR_FILENO);
    ::execv(options.observer.c_str(), const_cast<char* const*>(arguments.data()));
  });
  Machine machine(common.url, sprag::key_of(common), contacts);
  while (!machine.heard()) {
    machine.heartbeat();
    wait(10 * millisecond);
    if (!observer.running()) throw std::runtime_error(options.observer + " does not run");
  }
  std::mt19937 random(1);
  std::vector<Samples> samples{{"event to estimate", {}}, {"LCM ping", {}}, {"UDP ping", {}}};
  for (int i = 0; i < options.events && !sprag::stop_requested(); ++i) {
    wait(2 * millisecond + static_cast<std::int64_t>(random() % (2 * millisecond)));
    machine.heartbeat();
    wait(2 * millisecond);
    samples[0].add(machine.measure());
    wait(2 * millisecond);
    machine.heartbeat();
    samples[1].add(lcm.measure());
    wait(2 * millisecond);
    samples[2].add(udp.measure());
  }
  return samples;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Measures the time from the sending of a contact event to the estimate that contains it, "
      "beside bare LCM and UDP pings.",
      "bench_latency");
  sprag::CommonOptions common;
  Options options;
  sprag::add_common_options(app, common);
  app.add_option("SCENE", options.scene, "Scene file (TOML)")->required();
  app.add_option("--observer", options.observer, "The observer's program")
      ->type_name("FILE")
      ->default_val(SPRAG_OBSERVER);
  app.add_option("--ping-url", options.lcm_url, "LCM address of the ping")->capture_default_str();
  sprag::add_positive(app, "--tick", options.tick, "h", "The observer's tick [1e-3]");
  app.add_option("--events", options.events, "How many events and pings")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_flag("--realtime", options.real_time, "Run the observer with --realtime");

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const auto contacts = sprag::read_scene(options.scene).model.contacts.size();
    std::vector<Samples> samples = measure(options, common, static_cast<int>(contacts));
    std::printf("%-20s %8s %8s %8s %8s  [us, there and back]\n", "", "p50", "p99", "p99.9", "max");
    for (Samples& s : samples) {
      std::printf("%-20s %8.0f %8.0f %8.0f %8.0f", s.what, s.us(0.5), s.us(0.99), s.us(0.999),
                  s.us(1.0));
      if (s.lost > 0) std::printf("  %d lost", s.lost);
      std::printf("\n");
      report[s.what] = {{"count", s.ns.size()}, {"lost", s.lost},         {"p50_us", s.us(0.5)},
                        {"p99_us", s.us(0.99)}, {"p999_us", s.us(0.999)}, {"max_us", s.us(1.0)}};
    }
    return sprag::exit_done;
  });
}
