#include "tools/listen/source.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "command_line/program.h"
#include "lcmtypes/descriptor.h"

namespace sprag {

namespace {

class StandardInput : public EdgeSource {
 public:
  StandardInput() : EdgeSource("stdin") {}
  int descriptor() const override { return STDIN_FILENO; }

  bool read(Intake& intake, IntakeSink&, double now) override {
    const auto bytes = bytes_of(STDIN_FILENO);
    if (bytes) intake.take(*bytes, now);
    return bytes.has_value();
  }
};

struct Rate {
  int baud;
  speed_t code;
};

constexpr std::array rates{
    Rate{1200, B1200},       Rate{2400, B2400},       Rate{4800, B4800},
    Rate{9600, B9600},       Rate{19200, B19200},     Rate{38400, B38400},
    Rate{57600, B57600},     Rate{115200, B115200},   Rate{230400, B230400},
    Rate{460800, B460800},   Rate{500000, B500000},   Rate{576000, B576000},
    Rate{921600, B921600},   Rate{1000000, B1000000}, Rate{1500000, B1500000},
    Rate{2000000, B2000000}, Rate{3000000, B3000000}, Rate{4000000, B4000000}};

speed_t code_of(int baud) {
  const auto* const rate = std::ranges::find(rates, baud, &Rate::baud);
  if (rate != rates.end()) return rate->code;
  std::string text = "--baud is " + std::to_string(baud) + "; choose one of";
  for (const Rate& known : rates) text += ' ' + std::to_string(known.baud);
  throw UsageError(text);
}

class SerialPort : public EdgeSource {
 public:
  SerialPort(const std::string& device, int baud) : EdgeSource(device), rate_(code_of(baud)) {
    if (const std::string why = open(); !why.empty()) throw UsageError(name_ + ": " + why);
  }

  int descriptor() const override { return port_.get(); }

  bool read(Intake& intake, IntakeSink& sink, double now) override {
    const auto bytes = bytes_of(port_.get());
    if (!bytes) {
      port_ = Descriptor();
      intake.disconnect();
      sink.notice("the device is gone; it is opened again when it is back");
      return true;
    }
    if (!bytes->empty() && std::exchange(fresh_, false) &&
        (!waits_since_ || now - *waits_since_ < under_way)) {
      sink.notice("the first line may have lost its begin, and is skipped");
      intake.skip_line();
    }
    intake.take(*bytes, now);
    return true;
  }

  void revive(IntakeSink& sink, double now) override {
    if (port_ && !waits_since_) waits_since_ = now;
    if (port_ || now - tried_ < pause) return;
    tried_ = now;
    if (!open().empty()) return;
    ++reconnections_;
    sink.notice("the device is back: a new session begins with its next line");
  }

 private:
  // A line that is under way when the port is opened continues within this time [s].
  static constexpr double under_way = 0.1;
  static constexpr double pause = 0.2;  // s, between attempts to open it

  /// Returns why it cannot be opened.
  std::string open() {
    Descriptor port(::open(name_.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!port) return std::string("cannot be opened: ") + std::strerror(errno);
    termios settings{};
    if (::tcgetattr(port.get(), &settings) != 0) return "is not a serial port";
    ::cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB);
    ::cfsetspeed(&settings, rate_);
    if (::tcsetattr(port.get(), TCSANOW, &settings) != 0)
      return std::string("cannot be set up: ") + std::strerror(errno);
    ::tcflush(port.get(), TCIFLUSH);
    port_ = std::move(port);
    waits_since_.reset();
    fresh_ = true;
    return {};
  }

  speed_t rate_;
  Descriptor port_;
  double tried_ = 0.0;                 // last attempt to open it
  bool fresh_ = true;                  // no byte has arrived since it was opened
  std::optional<double> waits_since_;  // after it was opened
};

class TcpPort : public EdgeSource {
 public:
  explicit TcpPort(int port)
      : EdgeSource("127.0.0.1:" + std::to_string(port)),
        listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const int yes = 1;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    if (!listener_ || ::bind(listener_.get(), any, sizeof address) != 0 ||
        ::listen(listener_.get(), 1) != 0) {
      throw UsageError(name_ + ": cannot be listened to: " + std::strerror(errno));
    }
    socklen_t size = sizeof address;
    ::getsockname(listener_.get(), any, &size);
    name_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }

  int descriptor() const override { return client_ ? client_.get() : listener_.get(); }

  bool read(Intake& intake, IntakeSink& sink, double now) override {
    if (!client_) {
      client_ = Descriptor(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (client_ && std::exchange(had_client_, true)) {
        ++reconnections_;
        sink.notice("a client is connected again: a new session begins with its next line");
      }
      return true;
    }
    if (const auto bytes = bytes_of(client_.get())) {
      intake.take(*bytes, now);
      return true;
    }
    client_ = Descriptor();
    intake.disconnect();
    sink.notice("the client is gone; the port waits for the next one");
    return true;
  }

 private:
  Descriptor listener_, client_;
  bool had_client_ = false;
};

std::int64_t monotonic_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::optional<std::string_view> EdgeSource::bytes_of(int descriptor) {
  const ssize_t count = ::read(descriptor, buffer_.data(), buffer_.size());
  if (count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN)) return std::nullopt;
  return std::string_view(buffer_.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
}

double host_seconds() {
  static const std::int64_t start = monotonic_ns();
  return 1e-9 * static_cast<double>(monotonic_ns() - start);
}

std::unique_ptr<EdgeSource> standard_input() { return std::make_unique<StandardInput>(); }

std::unique_ptr<EdgeSource> serial_port(const std::string& device, int baud) {
  return std::make_unique<SerialPort>(device, baud);
}

std::unique_ptr<EdgeSource> tcp_port(int port) { return std::make_unique<TcpPort>(port); }

}  // namespace sprag
