// The clock of a source of edges: unwraps its counter, and compares it with this host's clock. It
// does not read a clock; times of arrival are arguments, in seconds.
#pragma once

#include <optional>
#include <string>

#include "tools/listen/clock_time.h"

namespace sprag {

struct DeviceClockOptions {
  std::optional<Decimal> unit;  ///< seconds; none: as the column's name says, else 1
  Decimal offset{0, 0};         ///< the device's time at the machine's t = 0, in its unit
  double rate = 1.0;            ///< seconds of the device per second of the machine, > 0
  int counter_bits = 0;         ///< of a counter that wraps; 0: times do not wrap
  double speed = 1.0;           ///< s of the device per s of this host; infinite: unpaced
  double latency = 0.05;        ///< longest time from an edge to the arrival of its line [s]
};

class DeviceClock {
 public:
  explicit DeviceClock(const DeviceClockOptions& options) : options_(options) {}

  /// The relation of a time to the last one.
  enum class Order {
    follows,
    falls,  ///< it is earlier
    leaps   ///< it lies further in the future than the latency explains
  };

  struct Reading {
    double t = 0.0;  ///< time of the machine [s]
    Order order = Order::follows;
    bool wraps = false;   ///< the counter has wrapped since the last time
    Decimal value;        ///< unwrapped
    std::string problem;  ///< why the time cannot be used; empty: it can
  };

  /// Reads a time that arrived at `arrival` [s of this host]. Changes nothing.
  Reading read(const ClockTime& time, double arrival) const;

  /// The reading is accepted and the last one from now on.
  void accept(const Reading& reading, double arrival);

  /// A new device, or one that was restarted: nothing is known of its time. The offset belonged to
  /// the old one.
  void restart();

  /// Sets the unit that a column's name states, if the options leave it open.
  void set_named_unit(const Decimal& unit) { named_unit_ = unit; }

  /// The device's time of now by this host's clock: the edges that arrived fastest of the last
  /// seconds count. Nullopt: nothing has arrived, or the device is not paced.
  std::optional<double> now(double arrival) const;

  /// The last accepted time, unwrapped, in the device's unit.
  const Decimal& last_value() const { return last_value_; }
  /// The last accepted time [s].
  std::optional<double> last() const { return last_t_; }

 private:
  // s of this host. In up to three of these a clock that is slow by 0.5 %, that of a ceramic
  // resonator, loses 15 ms, which is less than the latency.
  static constexpr double window = 1.0;

  Decimal unit() const { return options_.unit.value_or(named_unit_.value_or(Decimal{1, 0})); }
  Order order_of(double t, double arrival) const;
  double to_seconds(const Decimal& value, bool clock) const;

  DeviceClockOptions options_;
  std::optional<Decimal> named_unit_;
  std::optional<double> last_t_;
  Decimal last_value_;
  Decimal::Integer laps_ = 0;  // of the counter

  // Largest t - speed * arrival, of the current window and the one before.
  double window_start_ = 0.0;
  double best_ = 0.0, previous_best_ = 0.0;
};

}  // namespace sprag
