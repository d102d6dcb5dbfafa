#include "sprag/detail/mechanics/dynamics.h"

#include <algorithm>
#include <complex>
#include <string>
#include <utility>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"

namespace sprag {
namespace {

using std::complex;

bool oscillates(const Harmonic& harmonic) {
  return harmonic.amplitude != 0.0 && harmonic.frequency != 0.0;
}

Eigen::VectorXd distinct_frequencies(const Model& model) {
  std::vector<double> all;
  for (const Force& force : model.forces) {
    if (oscillates(force.harmonic)) all.push_back(force.harmonic.frequency);
  }
  for (const Contact& contact : model.contacts) {
    if (oscillates(contact.motion)) all.push_back(contact.motion.frequency);
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

void check_sizes(const Model& model) {
  const Eigen::Index f = model.coordinates();
  const auto square = [f](const Eigen::MatrixXd& A) { return A.rows() == f && A.cols() == f; };
  if (f == 0 || !square(model.M) || !square(model.C) || !square(model.K)) {
    throw ModelError("M, C and K must be square, of one size and not empty");
  }
  if (model.contacts.size() > static_cast<std::size_t>(max_contacts)) {
    throw ModelError("at most " + std::to_string(max_contacts) + " contacts are allowed");
  }
  for (const Force& force : model.forces) {
    if (force.direction.size() != f) throw ModelError("a force's direction must have f entries");
  }
  for (const Contact& contact : model.contacts) {
    if (contact.w.size() != f) throw ModelError("a contact's direction w must have f entries");
  }
}

}  // namespace

complex<double> complex_amplitude(const Harmonic& harmonic) {
  return std::polar(1.0, harmonic.phase) * harmonic.amplitude;
}

double constant_part(const Harmonic& harmonic) {
  return harmonic.frequency == 0.0 ? complex_amplitude(harmonic).real() : 0.0;
}

Dynamics::Dynamics(Model model) : model_(std::move(model)) {
  check_sizes(model_);
  const Eigen::Index f = coordinates();
  const Eigen::Index m = contacts();
  diagonal_ = model_.M.isDiagonal(0.0) && model_.C.isDiagonal(0.0) && model_.K.isDiagonal(0.0);
  frequencies_ = distinct_frequencies(model_);
  const Eigen::Index nf = frequencies_.size();
  const auto index_of = [this](double frequency) {
    return std::find(frequencies_.begin(), frequencies_.end(), frequency) - frequencies_.begin();
  };

  force_constant_ = Eigen::VectorXd::Zero(f);
  force_amplitudes_ = Eigen::MatrixXcd::Zero(f, nf);
  for (const Force& force : model_.forces) {
    force_constant_ += force.direction * (force.constant + constant_part(force.harmonic));
    if (oscillates(force.harmonic)) {
      force_amplitudes_.col(index_of(force.harmonic.frequency)) +=
          force.direction * complex_amplitude(force.harmonic);
    }
  }

  offsets_.resize(m);
  motion_amplitudes_ = Eigen::MatrixXcd::Zero(m, nf);
  W_.resize(f, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Contact& contact = model_.contacts[static_cast<std::size_t>(i)];
    W_.col(i) = contact.w;
    offsets_[i] = contact.clearance + constant_part(contact.motion);
    if (oscillates(contact.motion)) {
      motion_amplitudes_(i, index_of(contact.motion.frequency)) = complex_amplitude(contact.motion);
    }
  }

  if (diagonal_) {
    if ((model_.M.diagonal().array() <= 0.0).any()) {
      throw ModelError("M must be positive definite");
    }
    MinvW_ = model_.M.diagonal().cwiseInverse().asDiagonal() * W_;
  } else {
    const double unit = power_of_two_above(model_.M.cwiseAbs().maxCoeff());
    const CholeskyFactor factor(model_.M / unit);
    if (!factor.exists()) throw ModelError("M must be positive definite");
    MinvW_ = factor.solve(W_) / unit;
  }
  G_ = product(W_.transpose(), MinvW_);
  inputs_ = SampledInputs(model_);
}

// Derivative `order` of s_i(t), by the derivatives of the sampled inputs.
Eigen::VectorXd Dynamics::support_chain(int contact, Eigen::Index order) const {
  Eigen::VectorXd chain = Eigen::VectorXd::Zero(chain_terms * inputs_.channels());
  for (Eigen::Index c = 0; c < inputs_.channels(); ++c) {
    chain[chain_terms * c + order] = inputs_.motions()(contact, c);
  }
  return chain;
}

Functional Dynamics::gap(int contact) const {
  return {W_.col(contact), Eigen::VectorXd::Zero(coordinates()), offsets_[contact],
          motion_amplitudes_.row(contact).transpose(), support_chain(contact, 0)};
}

Functional Dynamics::gap_velocity(int contact) const {
  const Eigen::VectorXcd rates = (complex<double>(0.0, 1.0) * frequencies_.array() *
                                  motion_amplitudes_.row(contact).transpose().array())
                                     .matrix();
  return {Eigen::VectorXd::Zero(coordinates()), W_.col(contact), 0.0, rates,
          support_chain(contact, 1)};
}

Functional Dynamics::free_acceleration(int contact) const {
  const Eigen::VectorXd n = MinvW_.col(contact);
  const Eigen::VectorXcd support =
      (-frequencies_.array().square() * motion_amplitudes_.row(contact).transpose().array())
          .matrix();
  Eigen::VectorXd chain = support_chain(contact, 2);
  for (Eigen::Index c = 0; c < inputs_.channels(); ++c) {
    chain[chain_terms * c + 2] += n.dot(inputs_.forces().col(c));
  }
  return {-(model_.K * n), -(model_.C * n), n.dot(force_constant_),
          force_amplitudes_.transpose() * n + support, chain};
}

}  // namespace sprag
