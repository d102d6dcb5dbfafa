#include "sprag/sampled_input.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace sprag {
namespace {

using Wide = long double;

constexpr std::size_t fewest_samples = 4;
// Sample times with smaller deviations from even spacing, as a share of it, become even.
constexpr double evenness = 1e-6;

constexpr std::array<double, 6> factorials = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

// Derivative `order` at tau of sum d_n tau^n / n!.
template <class Number>
Number shifted(const InputDerivatives& d, std::size_t order, Number tau) {
  Number sum = d[5];
  for (std::size_t n = 5; n > order; --n) {
    sum = d[n - 1] + sum * tau / static_cast<Number>(n - order);
  }
  return sum;
}

// Second derivatives at the knots of the cubic spline with not-a-knot ends: its third derivative is
// continuous at the second and at the last but one knot. Thomas' algorithm.
std::vector<double> spline_curvatures(const std::vector<double>& t, std::span<const double> y) {
  const std::size_t n = t.size();
  std::vector<double> curvature(n, 0.0), diagonal(n, 0.0), upper(n, 0.0);
  const auto h = [&](std::size_t i) { return t[i + 1] - t[i]; };
  const auto slope = [&](std::size_t i) { return (y[i + 1] - y[i]) / h(i); };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    double lower = h(i - 1);
    diagonal[i] = 2.0 * (h(i - 1) + h(i));
    upper[i] = h(i);
    curvature[i] = 6.0 * (slope(i) - slope(i - 1));
    if (i == 1) {
      // m_0 = (1 + h_0 / h_1) m_1 - h_0 / h_1 m_2
      const double ratio = h(0) / h(1);
      diagonal[1] += h(0) * (1.0 + ratio);
      upper[1] -= h(0) * ratio;
      lower = 0.0;
    }
    if (i + 2 == n) {
      const double ratio = h(n - 2) / h(n - 3);
      diagonal[i] += h(n - 2) * (1.0 + ratio);
      lower -= h(n - 2) * ratio;
    }
    if (i > 1) {
      const double factor = lower / diagonal[i - 1];
      diagonal[i] -= factor * upper[i - 1];
      curvature[i] -= factor * curvature[i - 1];
    }
  }
  for (std::size_t i = n - 2; i >= 1; --i) {
    const double next = i + 2 < n ? upper[i] * curvature[i + 1] : 0.0;
    curvature[i] = (curvature[i] - next) / diagonal[i];
  }
  const double first = h(0) / h(1);
  const double last = h(n - 2) / h(n - 3);
  curvature[0] = (1.0 + first) * curvature[1] - first * curvature[2];
  curvature[n - 1] = (1.0 + last) * curvature[n - 2] - last * curvature[n - 3];
  return curvature;
}

}  // namespace

InputDerivatives moved_by(const InputDerivatives& at, double tau) {
  InputDerivatives d{};
  for (std::size_t j = 0; j < d.size(); ++j) d[j] = shifted(at, j, tau);
  return d;
}

SampledInput::SampledInput(std::span<const double> t, std::span<const double> values,
                           Settings settings)
    : settings_(std::move(settings)) {
  const auto require = [](bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
  };
  require(t.size() == values.size(), "as many samples as times are needed");
  require(t.size() >= fewest_samples, "at least four samples are needed");
  for (std::size_t k = 0; k < t.size(); ++k) {
    require(std::isfinite(t[k]) && std::isfinite(values[k]), "samples must be finite");
    require(k == 0 || t[k] > t[k - 1], "sample times must increase");
  }
  require(settings_.noise >= 0.0 && std::isfinite(settings_.noise), "noise must be >= 0");
  require(!settings_.displacement || (settings_.interpolation == Interpolation::spline &&
                                      settings_.outside == Outside::error),
          "a displacement needs interpolation by a spline, and has no values outside");
  require(std::isfinite(settings_.gain) && settings_.gain != 0.0, "the gain must not be 0");
  require(std::isfinite(settings_.delay), "the delay must be finite");
  samples_ = std::make_shared<const Samples>(
      Samples{{t.begin(), t.end()}, {values.begin(), values.end()}});
  std::vector<double> times = samples_->t, scaled = samples_->values;
  for (double& time : times) time += settings_.delay;
  for (double& value : scaled) value *= settings_.gain;
  set_knots(times);
  interpolate(scaled);
  integrate();
  measure(scaled);
  extend();
}

SampledInput SampledInput::streamed(const SampledInput& record, std::size_t most) {
  const auto samples = static_cast<double>(record.sample_times().size());
  const double spacing =
      (record.sample_times().back() - record.sample_times().front()) / (samples - 1.0);
  if (record.settings_.displacement || most < 2) {
    throw std::invalid_argument("a streamed input has at least two samples of an acceleration");
  }
  SampledInput input;
  input.settings_ = record.settings_;
  input.settings_.interpolation = Interpolation::linear;
  input.settings_.outside = Outside::hold;
  input.samples_ = record.samples_;
  input.even_ = true;
  input.largest_ = record.largest_;
  input.rms_ = record.rms_;
  input.interpolation_error_ = record.interpolation_error_;
  input.most_ = most;
  input.knots_.reserve(most);
  input.pieces_.reserve(most);
  input.clear(spacing);
  return input;
}

void SampledInput::clear(double spacing) {
  spacing_ = spacing;
  first_ = 0.0;
  knots_.assign(1, 0.0);
  pieces_.assign(1, {});
  appended_ = 0;
  squares_ = 0.0;
  e_ = velocity_ = 0.0L;
}

bool SampledInput::append(double t, double value) {
  value *= settings_.gain;
  if (appended_ == 0) {
    first_ = knots_[0] = t + settings_.delay;
    pieces_[0] = {0.0, 0.0, value, 0.0, 0.0, 0.0};
  } else {
    if (appended_ == most_) return false;
    InputDerivatives& last = pieces_.back();
    const double h = spacing_;
    last[3] = (value - last[2]) / h;
    e_ += velocity_ * h + static_cast<Wide>(h) * h * (last[2] / 2.0L + h * (last[3] / 6.0L));
    velocity_ += h * (last[2] + h * (last[3] / 2.0L));
    knots_.push_back(std::fma(static_cast<double>(appended_), spacing_, first_));
    pieces_.push_back(
        {static_cast<double>(e_), static_cast<double>(velocity_), value, 0.0, 0.0, 0.0});
  }
  ++appended_;
  squares_ += value * value;
  return true;
}

void SampledInput::set_knots(std::span<const double> t) {
  const std::size_t n = t.size();
  knots_.assign(t.begin(), t.end());
  first_ = t.front();
  spacing_ = (t.back() - t.front()) / static_cast<double>(n - 1);
  const auto regular = [&](std::size_t k) {
    return k + 1 == n ? t.back() : std::fma(static_cast<double>(k), spacing_, t.front());
  };
  even_ = true;
  for (std::size_t k = 0; k < n; ++k) {
    even_ = even_ && std::abs(t[k] - regular(k)) <= evenness * spacing_;
  }
  for (std::size_t k = 0; even_ && k < n; ++k) knots_[k] = regular(k);
}

void SampledInput::interpolate(std::span<const double> values) {
  const std::size_t n = knots_.size();
  pieces_.assign(n, {});
  const bool cubic = settings_.interpolation == Interpolation::spline;
  const std::vector<double> m =
      cubic ? spline_curvatures(knots_, values) : std::vector<double>(n, 0.0);
  const std::size_t first = settings_.displacement ? 0 : 2;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const double h = even_ ? spacing_ : knots_[k + 1] - knots_[k];
    InputDerivatives& piece = pieces_[k];
    piece[first] = values[k];
    piece[first + 1] = (values[k + 1] - values[k]) / h - h * (2.0 * m[k] + m[k + 1]) / 6.0;
    piece[first + 2] = m[k];
    piece[first + 3] = (m[k + 1] - m[k]) / h;
  }
  // After the last sample.
  InputDerivatives& last = pieces_.back();
  if (settings_.displacement) {
    const double h = even_ ? spacing_ : knots_[n - 1] - knots_[n - 2];
    last = {values.back(), shifted(pieces_[n - 2], 1, h), 0.0, 0.0, 0.0, 0.0};
  } else if (settings_.outside != Outside::zero) {
    last[2] = values.back();
  }
}

// Integrates a(t) twice.
void SampledInput::integrate() {
  if (settings_.displacement) return;
  Wide e = 0.0L;
  Wide velocity = 0.0L;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    InputDerivatives& piece = pieces_[k];
    piece[0] = static_cast<double>(e);
    piece[1] = static_cast<double>(velocity);
    if (k + 1 == pieces_.size()) break;
    const Wide h = even_ ? spacing_ : knots_[k + 1] - knots_[k];
    const Wide of_velocity =
        h * (piece[2] + h * (piece[3] / 2.0L + h * (piece[4] / 6.0L + h * piece[5] / 24.0L)));
    const Wide of_position =
        h * h *
        (piece[2] / 2.0L + h * (piece[3] / 6.0L + h * (piece[4] / 24.0L + h * piece[5] / 120.0L)));
    e += velocity * h + of_position;
    velocity += of_velocity;
  }
}

void SampledInput::measure(std::span<const double> values) {
  const std::size_t n = pieces_.size();
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const double h = knots_[k + 1] - knots_[k];
    for (std::size_t j = 0; j < largest_.size(); ++j) {
      double bound = 0.0;
      double power = 1.0;
      for (std::size_t i = j; i < 6; ++i) {
        bound += std::abs(pieces_[k][i]) * power / factorials[i - j];
        power *= h;
      }
      largest_[j] = std::max(largest_[j], bound);
    }
  }
  const InputDerivatives& last = pieces_.back();
  largest_[2] = std::max(largest_[2], std::abs(last[2]));
  if (settings_.outside != Outside::error && (last[1] != 0.0 || last[2] != 0.0)) {
    largest_[0] = std::numeric_limits<double>::infinity();
    if (last[2] != 0.0) largest_[1] = largest_[0];
  }
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    sum += pieces_[k][2] * pieces_[k][2];
  }
  rms_ = std::sqrt(sum / static_cast<double>(n));
  // Interpolation errors of a smooth function: h^2 y'' / 8 (linear) and h^4 y'''' / 384 (spline),
  // with differences for derivatives.
  const bool cubic = settings_.interpolation == Interpolation::spline;
  double largest_difference = 0.0;
  const std::size_t order = cubic ? 4 : 2;
  for (std::size_t k = order; k < n; ++k) {
    const double difference = cubic ? values[k] - 4.0 * values[k - 1] + 6.0 * values[k - 2] -
                                          4.0 * values[k - 3] + values[k - 4]
                                    : values[k] - 2.0 * values[k - 1] + values[k - 2];
    largest_difference = std::max(largest_difference, std::abs(difference));
  }
  interpolation_error_ = largest_difference / (cubic ? 384.0 : 8.0);
  // e'' of a spline of e is piecewise linear, so that its error is h^2 e'''' / 12.
  if (settings_.displacement)
    interpolation_error_ = largest_difference / (12.0 * spacing_ * spacing_);
}

// Values before the first sample, from t = 0 on. A delay must not make a record unusable that is
// usable without it.
void SampledInput::extend() {
  if (!(first_ > 0.0) || (settings_.outside == Outside::error && settings_.delay == 0.0)) return;
  if (settings_.displacement) {
    const double velocity = pieces_.front()[1];
    const double e = pieces_.front()[0] - velocity * first_;
    largest_[0] = std::max(largest_[0], std::abs(e));
    knots_.insert(knots_.begin(), 0.0);
    pieces_.insert(pieces_.begin(), InputDerivatives{e, velocity, 0.0, 0.0, 0.0, 0.0});
    even_ = false;
    return;
  }
  const double a = settings_.outside == Outside::zero ? 0.0 : pieces_.front()[2];
  const double velocity = a * first_;
  const double e = 0.5 * a * first_ * first_;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    pieces_[k][0] += e + velocity * (knots_[k] - first_);
    pieces_[k][1] += velocity;
  }
  largest_[0] += std::abs(e) + std::abs(velocity) * (last() - first_);
  largest_[1] += std::abs(velocity);
  knots_.insert(knots_.begin(), 0.0);
  pieces_.insert(pieces_.begin(), InputDerivatives{0.0, 0.0, a, 0.0, 0.0, 0.0});
  even_ = false;
}

std::size_t SampledInput::interval(double t) const {
  if (!(t > knots_.front())) return 0;
  if (t >= knots_.back()) return knots_.size() - 1;
  if (!even_) {
    const auto after = std::upper_bound(knots_.begin(), knots_.end(), t);
    return static_cast<std::size_t>(after - knots_.begin()) - 1;
  }
  auto k = std::min(static_cast<std::size_t>((t - first_) / spacing_), knots_.size() - 1);
  while (knots_[k] > t) --k;
  while (k + 1 < knots_.size() && knots_[k + 1] <= t) ++k;
  return k;
}

InputDerivatives SampledInput::derivatives(std::size_t k, double tau) const {
  return tau == 0.0 ? pieces_[k] : moved_by(pieces_[k], tau);
}

double SampledInput::value(double t) const {
  const std::size_t k = interval(t);
  return shifted(pieces_[k], 2, t - knots_[k]);
}

double SampledInput::displacement(double t) const {
  const std::size_t k = interval(t);
  return shifted(pieces_[k], 0, t - knots_[k]);
}

double SampledInput::velocity(double t) const {
  const std::size_t k = interval(t);
  return shifted(pieces_[k], 1, t - knots_[k]);
}

SampledInput with_gain_and_delay(const SampledInput& input, double gain, double delay) {
  SampledInput::Settings settings = input.settings();
  settings.gain = gain;
  settings.delay = delay;
  return {input.sample_times(), input.sample_values(), std::move(settings)};
}

bool has_even_samples(const SampledInput& input) {
  SampledInput::Settings settings = input.settings();
  settings.delay = -input.sample_times().front();
  return SampledInput(input.sample_times(), input.sample_values(), std::move(settings)).even();
}

SampledInput with_errors(const SampledInput& input, std::span<const double> errors) {
  std::vector<double> values = input.sample_values();
  for (std::size_t k = 0; k < values.size(); ++k) values[k] += errors[k];
  return {input.sample_times(), values, input.settings()};
}

}  // namespace sprag
