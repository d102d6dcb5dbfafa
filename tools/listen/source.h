// Where lines come from: standard input, a serial port, a client on a TCP port.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tools/listen/intake.h"

namespace sprag {

class EdgeSource {
 public:
  virtual ~EdgeSource() = default;

  /// Its name in messages.
  const std::string& name() const { return name_; }

  /// The file descriptor to wait for; -1: nothing to wait for now.
  virtual int descriptor() const = 0;

  /// Reads what has arrived at `now` [s] into `intake`; called when the descriptor is ready.
  /// Returns false at the end of the source.
  virtual bool read(Intake& intake, IntakeSink& sink, double now) = 0;

  /// Called several times a second: a source that is gone is opened again.
  virtual void revive(IntakeSink& /*sink*/, double /*now*/) {}

  /// Number of times that the source was gone and came again.
  std::int64_t reconnections() const { return reconnections_; }

 protected:
  explicit EdgeSource(std::string name) : name_(std::move(name)) {}

  /// The bytes that have arrived at a descriptor, valid until the next call; nullopt at the end of
  /// the file or after an error.
  std::optional<std::string_view> bytes_of(int descriptor);

  std::string name_;
  std::int64_t reconnections_ = 0;

 private:
  std::array<char, 65536> buffer_;
};

/// The standard input, up to its end.
std::unique_ptr<EdgeSource> standard_input();

/// A serial port, raw, 8 data bits, no parity. It is opened again when it comes back after it was
/// gone. Throws UsageError if it cannot be opened, or for a rate that it does not support.
std::unique_ptr<EdgeSource> serial_port(const std::string& device, int baud);

/// Accepts one client at a time on 127.0.0.1:`port`; 0: a free port, which is printed. Throws
/// UsageError if the port is in use.
std::unique_ptr<EdgeSource> tcp_port(int port);

/// Seconds of this host's monotonic clock since the first call in this process, which is t = 0 of
/// edges that are stamped on arrival.
double host_seconds();

}  // namespace sprag
