#include "sprag/detail/mechanics/sampled_inputs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr std::size_t to_size(Eigen::Index i) { return static_cast<std::size_t>(i); }

constexpr std::array<double, 6> factorial = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0};

// Channels that fit on the stack.
constexpr std::size_t most_channels = 32;
using AllDerivatives = std::array<double, most_channels * chain_terms>;

// Bound of |d^j/dt^j| over an interval of length h, from the derivatives d at its start.
double largest_derivative(const double* d, std::size_t j, double h) {
  double bound = 0.0;
  double power = 1.0;
  for (std::size_t n = j; n < 6; ++n) {
    bound += std::abs(d[n]) * power / factorial[n - j];
    power *= h;
  }
  return bound;
}

}  // namespace

SampledInputs::SampledInputs(const Model& model) {
  const auto column_of = [&](const SampledInputPointer& input) {
    const auto column =
        std::distance(channels_.begin(), std::find(channels_.begin(), channels_.end(), input));
    if (column == std::ssize(channels_)) channels_.push_back(input);
    return column;
  };
  for (const Force& force : model.forces) {
    if (force.input) column_of(force.input);
  }
  for (const Contact& contact : model.contacts) {
    if (contact.input) column_of(contact.input);
  }
  if (channels_.size() > most_channels) {
    throw ModelError("at most " + std::to_string(most_channels) +
                     " different sampled inputs are allowed");
  }
  forces_.setZero(model.coordinates(), channels());
  motions_.setZero(static_cast<Eigen::Index>(model.contacts.size()), channels());
  if (empty()) return;
  for (const Force& force : model.forces) {
    if (force.input) forces_.col(column_of(force.input)) += force.direction;
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = model.contacts[i];
    if (!contact.input) continue;
    motions_(static_cast<Eigen::Index>(i), column_of(contact.input)) += contact.input_share;
  }

  bool alike = true;
  for (const SampledInputPointer& input : channels_) {
    alike = alike && input->knots() == channels_.front()->knots();
    knots_.insert(knots_.end(), input->knots().begin(), input->knots().end());
  }
  std::sort(knots_.begin(), knots_.end());
  knots_.erase(std::unique(knots_.begin(), knots_.end()), knots_.end());
  if (knots_.size() * to_size(model.coordinates()) > most_sampled_values) {
    throw ModelError("the sampled inputs have " + std::to_string(knots_.size()) + " samples for " +
                     std::to_string(model.coordinates()) +
                     " coordinates; the product must be at most " +
                     std::to_string(most_sampled_values));
  }
  streamed_ = std::any_of(channels_.begin(), channels_.end(),
                          [](const SampledInputPointer& input) { return input->is_streamed(); });
  if (streamed_ && channels_.size() > 1) {
    throw ModelError("a streamed input must be the only sampled input of a machine");
  }
  if (streamed_) {
    if (most_knots() * to_size(model.coordinates()) > most_sampled_values) {
      throw ModelError("the streamed input has up to " + std::to_string(most_knots()) +
                       " samples for " + std::to_string(model.coordinates()) +
                       " coordinates; the product must be at most " +
                       std::to_string(most_sampled_values));
    }
    knots_.reserve(most_knots());
  }
  if (alike) {
    step_ = channels_.front()->even() ? channels_.front()->spacing() : 0.0;
    return;
  }
  for (const double t : knots_) {
    for (const SampledInputPointer& input : channels_) own_.push_back(input->interval(t));
  }
}

std::size_t SampledInputs::most_knots() const { return channels_.front()->most_samples(); }

void SampledInputs::follow() {
  const std::vector<double>& knots = channels_.front()->knots();
  if (knots.size() < knots_.size() || knots.front() != knots_.front()) knots_.clear();
  step_ = channels_.front()->spacing();
  for (std::size_t k = knots_.size(); k < knots.size(); ++k) knots_.push_back(knots[k]);
}

double SampledInputs::length(std::size_t k) const {
  if (k + 1 == knots_.size()) return infinity;
  return step_ > 0.0 ? step_ : knots_[k + 1] - knots_[k];
}

std::size_t SampledInputs::interval(double t) const {
  if (own_.empty()) return channels_.front()->interval(t);
  const auto after = std::upper_bound(knots_.begin(), knots_.end(), t);
  return after == knots_.begin() ? 0 : static_cast<std::size_t>(after - knots_.begin()) - 1;
}

void SampledInputs::derivatives(std::size_t k, double tau, double* of) const {
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const SampledInput& input = *channels_[c];
    std::size_t own = k;
    double since = tau;
    if (!own_.empty()) {
      own = own_[k * channels_.size() + c];
      since += knots_[k] - input.knots()[own];
    }
    const InputDerivatives d = input.derivatives(own, since);
    std::copy(d.begin(), d.end(), of + c * to_size(chain_terms));
  }
}

InputDerivatives SampledInputs::at_knot(std::size_t k, Eigen::Index c) const {
  const SampledInput& input = channel(c);
  if (own_.empty()) return input.at_knot(k);
  const std::size_t own = own_[k * channels_.size() + to_size(c)];
  return input.derivatives(own, knots_[k] - input.knots()[own]);
}

void SampledInputs::add_force(double t, double weight, Eigen::Ref<Eigen::VectorXd> force) const {
  for (Eigen::Index c = 0; c < channels(); ++c) {
    force += weight * channel(c).value(t) * forces_.col(c);
  }
}

SampledResponse::SampledResponse(const SampledInputs& inputs, const Eigen::VectorXd& delta,
                                 const Eigen::VectorXd& kappa, const Eigen::MatrixXd& forces,
                                 Eigen::Index first, Eigen::Index first_mode)
    : inputs_(&inputs),
      first_(first),
      first_mode_(first_mode),
      delta_(delta),
      kappa_(kappa),
      forces_(forces.transpose()),
      row_(2 * to_size(delta.size())),
      bound_row_(2 * to_size(delta.size()) + to_size(chain_terms * inputs.channels())) {
  steps_.resize(to_size(modes()));
  rows_.reserve((inputs.streamed() ? inputs.most_knots() : inputs.knots()) * row_);
  begin_table();
  tabulate();
  // A bound over many intervals would depend on samples that are not known yet.
  if (!inputs.streamed()) bound();
}

PolynomialForce SampledResponse::force(Eigen::Index i, const double* derivatives) const {
  PolynomialForce F{};
  const double* share = forces_.data() + i * forces_.rows();
  const double* d = derivatives;
  for (Eigen::Index c = 0; c < inputs_->channels(); ++c) {
    for (std::size_t j = 0; j < 6; ++j) {
      if (share[j] == 0.0) continue;
      for (std::size_t n = 0; n + j < 6; ++n) F[n] += share[j] * d[n + j];
    }
    share += chain_terms;
    d += chain_terms;
  }
  return F;
}

PolynomialForce SampledResponse::force(Eigen::Index i, const OscillatorState& x) const {
  AllDerivatives d;
  for (Eigen::Index j = 0; j < chain_entries * inputs_->channels(); ++j) {
    d[to_size(2 * j)] = x.z[first_ + j];
    d[to_size(2 * j + 1)] = x.v[first_ + j];
  }
  return force(i, d.data());
}

// In extended precision, so that the roundings of many steps do not add up.
void SampledResponse::tabulate() {
  const SampledInputs& inputs = *inputs_;
  const std::size_t n = inputs.knots();
  rows_.resize(n * row_, 0.0);
  AllDerivatives d;
  for (std::size_t k = tabulated_ - 1; k + 1 < n; ++k) {
    const double h = inputs.length(k);
    if (h != length_of_steps_) {
      for (Eigen::Index i = 0; i < modes(); ++i) {
        steps_[to_size(i)] = polynomial_step(delta_[i], kappa_[i], h);
      }
      length_of_steps_ = h;
    }
    inputs.derivatives(k, 0.0, d.data());
    double* row = rows_.data() + (k + 1) * row_;
    for (Eigen::Index i = 0; i < modes(); ++i) {
      steps_[to_size(i)].apply(force(i, d.data()), y_[to_size(i)], v_[to_size(i)]);
      row[i] = static_cast<double>(y_[to_size(i)]);
      row[modes() + i] = static_cast<double>(v_[to_size(i)]);
    }
  }
  tabulated_ = n;
}

void SampledResponse::begin_table() {
  rows_.assign(row_, 0.0);
  y_.assign(to_size(modes()), 0.0L);
  v_.assign(to_size(modes()), 0.0L);
  tabulated_ = 1;
}

void SampledResponse::follow() {
  if (inputs_->knots() < tabulated_ || inputs_->knots() == 1) begin_table();
  tabulate();
}

// Derivative w = y'' obeys the oscillator's equation under F''. sqrt(w'^2 + kappa w^2) grows at
// most at the rate |F''|.
void SampledResponse::bound() {
  const SampledInputs& inputs = *inputs_;
  bounds_.assign(blocks() * bound_row_, 0.0);
  AllDerivatives d;
  for (std::size_t k = 0; k + 1 < inputs.knots(); ++k) {
    const double h = inputs.length(k);
    inputs.derivatives(k, 0.0, d.data());
    double* of = bounds_.data() + k / block * bound_row_;
    for (Eigen::Index i = 0; i < modes(); ++i) {
      const PolynomialForce F = force(i, d.data());
      const double second = F[0] - 2.0 * delta_[i] * v(k)[i] - kappa_[i] * y(k)[i];
      const double third = F[1] - 2.0 * delta_[i] * second - kappa_[i] * v(k)[i];
      const double root = std::sqrt(kappa_[i]);
      const double largest =
          std::hypot(third, root * second) + h * largest_derivative(F.data(), 2, h);
      double of_second = std::abs(second) + h * largest;
      if (root > 0.0) of_second = std::min(of_second, largest / root);
      of[i] = std::max(of[i], of_second);
      of[modes() + i] = std::max(of[modes() + i], largest);
    }
    for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
      double* of_input = of + 2 * modes() + c * chain_terms;
      for (std::size_t j = 0; j < 6; ++j) {
        of_input[j] = std::max(of_input[j], largest_derivative(d.data() + c * chain_terms, j, h));
      }
    }
  }
}

void SampledResponse::set(Instant t, OscillatorState& x) const {
  const std::size_t k = inputs_->interval(t.hi);
  set(k, (t.hi - inputs_->knot(k)) + t.lo, x);
}

void SampledResponse::set(std::size_t k, double tau, OscillatorState& x) const {
  AllDerivatives d;
  inputs_->derivatives(k, tau, d.data());
  for (Eigen::Index j = 0; j < chain_entries * inputs_->channels(); ++j) {
    x.z[first_ + j] = d[to_size(2 * j)];
    x.v[first_ + j] = d[to_size(2 * j + 1)];
  }
  const double* y_k = y(k);
  const double* v_k = v(k);
  if (tau == 0.0) {
    for (Eigen::Index i = 0; i < modes(); ++i) {
      x.z[first_mode_ + i] = y_k[i];
      x.v[first_mode_ + i] = v_k[i];
    }
    return;
  }
  inputs_->derivatives(k, 0.0, d.data());
  for (Eigen::Index i = 0; i < modes(); ++i) {
    double z = y_k[i];
    double v = v_k[i];
    move_under_force(delta_[i], kappa_[i], force(i, d.data()), tau, z, v);
    x.z[first_mode_ + i] = z;
    x.v[first_mode_ + i] = v;
  }
}

}  // namespace sprag
