// A simulated bad network: takes LCM's packets from one port and sends them to another, and loses,
// duplicates, delays and reorders them by a seeded plan.
//
//   relay IN_PORT OUT_PORT [--seed N] [--loss P] [--double P] [--reorder P] [--delay MS]
//         [--outages N] [--outage S] [--every S] [--only CHANNEL]
//
// P: share of the packets. --delay: up to as many ms, drawn for each packet. --reorder: these
// packets wait another 5 to 50 ms. --outages: number of outages of --outage seconds each; --every:
// their distance in seconds, from the first packet on. --only: the plan holds for packets of this
// channel; others pass. Ends at SIGTERM and prints its counts.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <iostream>
#include <optional>
#include <queue>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/random.h"

namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

std::atomic<bool> stop = false;

struct Plan {
  std::uint64_t seed = 1;
  double loss = 0.0, doubling = 0.0, reordering = 0.0;
  double delay = 0.0;  // ms
  int outages = 0;
  double outage = 0.5, every = 1.5;  // s
  std::string only;                  // channel; empty: all
};

struct Waiting {
  Clock::time_point due;
  std::string bytes;

  bool operator>(const Waiting& other) const { return due > other.due; }
};

sockaddr_in group(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, "239.255.76.67", &address.sin_addr);
  return address;
}

int receiver(int port) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  const int yes = 1;
  const int buffer = 4'000'000;
  const sockaddr_in address = group(port);
  const ip_mreq membership{address.sin_addr, {htonl(INADDR_ANY)}};
  ::setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  ::setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
  if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::setsockopt(descriptor, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) !=
          0) {
    throw std::runtime_error("multicast does not work on this host");
  }
  return descriptor;
}

class Relay {
 public:
  Relay(int in, int out, const Plan& plan)
      : plan_(plan), random_(plan.seed), in_(receiver(in)), out_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    to_ = group(out);
    const int ttl = 0;
    ::setsockopt(out_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  }

  void run() {
    std::array<char, 65536> buffer;
    while (!stop) {
      pollfd ready{in_, POLLIN, 0};
      ::poll(&ready, 1, waiting_.empty() ? 20 : 1);
      for (ssize_t size = 0; size >= 0;) {
        size = ::recv(in_, buffer.data(), buffer.size(), MSG_DONTWAIT);
        if (size > 0) take({buffer.data(), static_cast<std::size_t>(size)});
      }
      for (; !waiting_.empty() && waiting_.top().due <= Clock::now(); waiting_.pop()) {
        send(waiting_.top().bytes);
      }
    }
    std::cerr << "taken " << taken_ << " lost " << lost_ << " doubled " << doubled_ << " reordered "
              << reordered_ << " lost in outages " << lost_in_outages_ << '\n';
  }

 private:
  void take(const std::string& bytes) {
    const auto now = Clock::now();
    if (!start_) start_ = now;
    ++taken_;
    // A packet has the channel's name after its magic number and sequence number.
    if (!plan_.only.empty() &&
        bytes.compare(8, plan_.only.size() + 1, plan_.only.c_str(), plan_.only.size() + 1) != 0) {
      send(bytes);
      return;
    }
    const bool lost = random_.chance(plan_.loss);
    const bool twice = random_.chance(plan_.doubling);
    if (in_outage(Seconds(now - *start_).count())) {
      ++lost_in_outages_;
      return;
    }
    if (lost) {
      ++lost_;
      return;
    }
    schedule(now, bytes);
    if (!twice) return;
    ++doubled_;
    schedule(now, bytes);
  }

  bool in_outage(double t) const {
    if (t > plan_.outages * plan_.every) return false;
    return t - plan_.every * std::floor(t / plan_.every) > plan_.every - plan_.outage;
  }

  void schedule(Clock::time_point now, const std::string& bytes) {
    double wait = plan_.delay > 0.0 ? random_.uniform(0.0, plan_.delay) : 0.0;
    if (random_.chance(plan_.reordering)) {
      ++reordered_;
      wait += random_.uniform(5.0, 50.0);
    }
    if (wait == 0.0) {
      send(bytes);
      return;
    }
    waiting_.push({now + std::chrono::duration_cast<Clock::duration>(Seconds(1e-3 * wait)), bytes});
  }

  void send(const std::string& bytes) {
    ::sendto(out_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
             sizeof to_);
  }

  Plan plan_;
  sprag::Random random_;
  int in_, out_;
  sockaddr_in to_{};
  std::optional<Clock::time_point> start_;
  std::priority_queue<Waiting, std::vector<Waiting>, std::greater<>> waiting_;
  long taken_ = 0, lost_ = 0, doubled_ = 0, reordered_ = 0, lost_in_outages_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Relays LCM packets badly.", "relay");
  int in = 0;
  int out = 0;
  Plan plan;
  app.add_option("IN_PORT", in)->required();
  app.add_option("OUT_PORT", out)->required();
  app.add_option("--seed", plan.seed);
  app.add_option("--loss", plan.loss);
  app.add_option("--double", plan.doubling);
  app.add_option("--reorder", plan.reordering);
  app.add_option("--delay", plan.delay);
  app.add_option("--outages", plan.outages);
  app.add_option("--outage", plan.outage);
  app.add_option("--every", plan.every);
  app.add_option("--only", plan.only);
  CLI11_PARSE(app, argc, argv);
  std::signal(SIGTERM, [](int) { stop = true; });
  Relay relay(in, out, plan);
  std::cerr << "listening, seed " << plan.seed << '\n';
  relay.run();
}
