/// \file
/// \brief A recorded force, acceleration or displacement as a piecewise polynomial of time.
///
/// The input a(t) acts as a force or as the acceleration of a frame. Its twofold integral e(t),
/// with e'' = a, is the motion of that frame. A recorded displacement is e(t) itself. Between two
/// knots e(t) is a polynomial of degree <= 5, so that the exact flow and the event search remain
/// exact.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace sprag {

/// \brief Interpolation between samples.
enum class Interpolation {
  linear,  ///< first-order hold
  spline   ///< cubic spline with continuous second derivative and not-a-knot ends (de Boor 1978)
};

/// \brief Value of the input before the first and after the last sample.
enum class Outside {
  error,  ///< the input must not be used there; with a delay it is held before the first sample,
          ///< and a displacement goes on with its first velocity
  zero,   ///< a = 0
  hold    ///< a keeps the value of the nearest sample
};

/// \brief Derivatives 0 to 5 of e(t): e, e', a, a', a'', a'''.
using InputDerivatives = std::array<double, 6>;

/// \brief Derivatives on the same polynomial at another time.
/// \param at derivatives at some time.
/// \param tau time since then, of any sign [s].
/// \return the derivatives there.
InputDerivatives moved_by(const InputDerivatives& at, double tau);

/// \brief A sampled input. It does not change after construction, unless it is streamed; models
/// share it.
class SampledInput {
 public:
  /// \brief How samples become a function of time.
  struct Settings {
    Interpolation interpolation = Interpolation::linear;  ///< linear is not for a displacement
    Outside outside = Outside::error;                     ///< displacement: error only
    bool displacement = false;                            ///< the samples are e(t), else a(t)
    double noise = 0.0;     ///< standard deviation of the samples' errors, >= 0
    std::string name = {};  ///< name in messages, for example the file
    /// \brief Gain of the sensor: a(t), or e(t) of a displacement, is gain times the sample of time
    /// t - delay; not 0.
    double gain = 1.0;
    double delay = 0.0;  ///< delay of the record: what its times lack of the machine's time [s]
  };

  /// \brief Interpolates samples. Sample times that are evenly spaced up to 1e-6 of the spacing
  /// become exactly even.
  ///
  /// e and e' are zero at the first knot unless the samples are displacements.
  /// \param t times, strictly increasing, at least 4 [s].
  /// \param values as many values.
  /// \param settings interpolation.
  /// \throws std::invalid_argument for samples or settings that are not as described.
  SampledInput(std::span<const double> t, std::span<const double> values, Settings settings);

  /// \brief An input whose samples come one after the other. It is linear between them, held after
  /// the last one, and 0 while there is none.
  ///
  /// Gain, delay and noise are those of a record of the same sensor, and so are rms() and
  /// largest(): they do not follow the samples. The interval is that of the record up to clear().
  /// \param record a record of the sensor, with even samples of an acceleration or a force.
  /// \param most number of samples for which it reserves memory, >= 2.
  /// \return the input.
  /// \throws std::invalid_argument for other arguments.
  static SampledInput streamed(const SampledInput& record, std::size_t most);
  /// \brief Whether samples come one after the other.
  /// \return true after streamed().
  bool is_streamed() const { return most_ > 0; }
  /// \brief Intervals of streamed samples and of the record differ by at most this share: the
  /// clock of the sensor may be fast or slow.
  static constexpr double largest_rate_error = 0.01;
  /// \brief Forgets all samples. Only for a streamed input; does not allocate.
  /// \param spacing interval of the samples that follow, > 0 [s].
  void clear(double spacing);
  /// \brief Adds a sample; the first one is at time t, each other one spacing() after the last.
  /// Only for a streamed input; does not allocate.
  /// \param t time of the first sample without Settings::delay [s].
  /// \param value the sample.
  /// \return false if there is no room.
  bool append(double t, double value);
  /// \brief Largest number of samples of a streamed input.
  /// \return the number given to streamed().
  std::size_t most_samples() const { return most_; }
  /// \brief Number of samples of a streamed input.
  /// \return samples since clear().
  std::size_t appended() const { return appended_; }
  /// \brief Root mean square of a over the samples of a streamed input.
  /// \return the root mean square; 0 without samples.
  double appended_rms() const {
    return appended_ > 0 ? std::sqrt(squares_ / static_cast<double>(appended_)) : 0.0;
  }

  /// \brief Settings given at construction.
  /// \return the settings.
  const Settings& settings() const { return settings_; }
  /// \brief Samples given at construction, without gain and delay.
  /// \return the times [s].
  const std::vector<double>& sample_times() const { return samples_->t; }
  /// \copybrief sample_times
  /// \return the values.
  const std::vector<double>& sample_values() const { return samples_->values; }
  /// \brief Standard deviation of the errors of a, or of e of a displacement, at the samples.
  /// \return |gain| times Settings::noise.
  double noise() const { return std::abs(settings_.gain) * settings_.noise; }
  /// \brief Interval between samples; the mean interval if it varies.
  /// \return dt [s].
  double spacing() const { return spacing_; }
  /// \brief Whether all intervals between knots are equal.
  /// \return true if they are.
  bool even() const { return even_; }
  /// \brief Times at which the polynomial changes, increasing. The last polynomial has no end.
  /// \return the knots [s].
  const std::vector<double>& knots() const { return knots_; }
  /// \brief First and last sample.
  /// \return the time [s].
  double first() const { return first_; }
  /// \copydoc first
  double last() const { return knots_.back(); }
  /// \brief End of the time in which the input may be used.
  /// \return last() for Outside::error, else infinity [s].
  double end() const {
    return settings_.outside == Outside::error ? last() : std::numeric_limits<double>::infinity();
  }

  /// \brief Number of the interval that contains t, in constant time for even knots.
  /// \param t time [s].
  /// \return the last k with knots()[k] <= t, or 0.
  std::size_t interval(double t) const;
  /// \brief Derivatives of e at knot k, from the right.
  /// \param k number of the knot.
  /// \return e, e', a, a', a'', a'''.
  const InputDerivatives& at_knot(std::size_t k) const { return pieces_[k]; }
  /// \brief Derivatives of e on the polynomial of interval k.
  /// \param k number of the interval.
  /// \param tau time since its first knot [s].
  /// \return e, e', a, a', a'', a'''.
  InputDerivatives derivatives(std::size_t k, double tau) const;
  /// \brief The input at time t.
  /// \param t time [s].
  /// \return a(t).
  double value(double t) const;
  /// \brief The motion of a frame with this acceleration.
  /// \param t time [s].
  /// \return e(t).
  double displacement(double t) const;
  /// \brief The velocity of that frame.
  /// \param t time [s].
  /// \return e'(t).
  double velocity(double t) const;

  /// \brief Bound on a derivative of e over the record, and after it for Outside::zero or hold.
  /// \param order 0 to 5.
  /// \return the largest absolute value; infinity for e and e' of an input that goes on after its
  /// record with a velocity.
  double largest(int order) const { return largest_[static_cast<std::size_t>(order)]; }
  /// \brief Root mean square of a over the samples.
  /// \return the root mean square.
  double rms() const { return rms_; }
  /// \brief Estimate of the largest interpolation error of a, from differences of the samples.
  ///
  /// Large for content near half of the sampling frequency, which no interpolation resolves.
  /// \return the error, in the unit of a.
  double interpolation_error() const { return interpolation_error_; }

 private:
  SampledInput() = default;
  void set_knots(std::span<const double> t);
  void interpolate(std::span<const double> values);
  void integrate();
  void extend();
  void measure(std::span<const double> values);

  struct Samples {
    std::vector<double> t, values;
  };

  Settings settings_;
  std::shared_ptr<const Samples> samples_;
  std::vector<double> knots_;
  std::vector<InputDerivatives> pieces_;
  double first_ = 0.0, spacing_ = 0.0;
  bool even_ = false;
  InputDerivatives largest_{};
  double rms_ = 0.0, interpolation_error_ = 0.0;
  // Of a streamed input.
  std::size_t most_ = 0, appended_ = 0;
  double squares_ = 0.0;                    // sum over the samples
  long double e_ = 0.0L, velocity_ = 0.0L;  // at the last knot
};

/// \brief Shared constant input; null: none.
using SampledInputPointer = std::shared_ptr<const SampledInput>;

/// \brief The same samples with another gain and delay.
/// \param input the input.
/// \param gain Settings::gain, not 0.
/// \param delay Settings::delay [s].
/// \return the input.
SampledInput with_gain_and_delay(const SampledInput& input, double gain, double delay);
/// \brief Whether all intervals between the samples of a record are equal.
/// \param input the record.
/// \return true if they are.
bool has_even_samples(const SampledInput& input);
/// \brief The same input with other errors of its samples.
/// \param input the input.
/// \param errors added to SampledInput::sample_values(), as many.
/// \return the input.
SampledInput with_errors(const SampledInput& input, std::span<const double> errors);

}  // namespace sprag
