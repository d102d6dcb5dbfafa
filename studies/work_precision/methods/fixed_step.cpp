#include "studies/work_precision/methods/fixed_step.h"

#include <array>
#include <bit>
#include <complex>
#include <cstdio>
#include <utility>

namespace sprag::work_precision {
namespace {

std::size_t index(Eigen::Index i) { return static_cast<std::size_t>(i); }

}  // namespace

Excitation::Excitation(const Model& model, double h) : h_(h) {
  const Eigen::Index f = model.coordinates();
  constant_ = Eigen::VectorXd::Zero(f);
  std::vector<std::ptrdiff_t> phase_of_force;
  for (const Force& force : model.forces) {
    constant_ += force.direction * force.constant;
    phase_of_force.push_back(phase_of(force.harmonic.frequency));
    if (phase_of_force.back() < 0) constant_ += force.direction * value(force.harmonic, 0.0);
  }
  for (const Contact& contact : model.contacts) {
    const Harmonic& motion = contact.motion;
    const std::ptrdiff_t phase = motion.amplitude == 0.0 ? -1 : phase_of(motion.frequency);
    supports_.push_back({contact.clearance, motion.amplitude * std::cos(motion.phase),
                         -motion.amplitude * std::sin(motion.phase), phase});
    if (phase < 0) supports_.back().clearance += value(motion, 0.0);
  }
  force_ = Eigen::MatrixXcd::Zero(f, static_cast<Eigen::Index>(phases_.size()));
  for (std::size_t i = 0; i < phase_of_force.size(); ++i) {
    if (phase_of_force[i] < 0) continue;
    const Harmonic& harmonic = model.forces[i].harmonic;
    force_.col(phase_of_force[i]) +=
        model.forces[i].direction * std::polar(harmonic.amplitude, harmonic.phase);
  }
  set_phases();
}

std::ptrdiff_t Excitation::phase_of(double frequency) {
  if (frequency == 0.0) return -1;
  for (std::size_t j = 0; j < phases_.size(); ++j) {
    if (phases_[j].frequency == frequency) return static_cast<std::ptrdiff_t>(j);
  }
  phases_.push_back({frequency, 1.0, 0.0, std::cos(frequency * h_), std::sin(frequency * h_)});
  return static_cast<std::ptrdiff_t>(phases_.size()) - 1;
}

void Excitation::set_phases() {
  const double t = static_cast<double>(tick_) * h_;
  for (Phase& phase : phases_) {
    phase.cosine = std::cos(phase.frequency * t);
    phase.sine = std::sin(phase.frequency * t);
  }
}

ContactSet complementarity(const Eigen::MatrixXd& A, ContactSet set, const Eigen::VectorXd& b,
                           Eigen::VectorXd& x) {
  if (std::has_single_bit(set)) {
    const int i = std::countr_zero(set);
    x[i] = b[i] < 0.0 ? -b[i] / A(i, i) : 0.0;
    return x[i] > 0.0 ? set : 0;
  }
  std::array<int, max_contacts> contacts{};
  Eigen::Index n = 0;
  for_each(set, [&](int i) { contacts[index(n++)] = i; });
  ContactMatrix A_s = of_contacts(A, set);
  ContactVector b_s(n), x_s, y_s;
  for (Eigen::Index i = 0; i < n; ++i) b_s[i] = b[contacts[index(i)]];
  if (solve_lcp(A_s, b_s, x_s, y_s) != Solved::yes) {
    constexpr double regularization = 1e-9;
    A_s.diagonal() *= 1.0 + regularization;
    if (solve_lcp(A_s, b_s, x_s, y_s) != Solved::yes) x_s.setZero(n);
  }
  ContactSet positive = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    x[contacts[index(i)]] = x_s[i];
    if (x_s[i] > 0.0) positive |= bit(contacts[index(i)]);
  }
  return positive;
}

StepImpact::StepImpact(const Model& model, Eigen::MatrixXd G)
    : poisson_(model.law == ImpactLaw::poisson), G_(std::move(G)) {
  const auto m = static_cast<Eigen::Index>(model.contacts.size());
  epsilon_.resize(m);
  for (Eigen::Index i = 0; i < m; ++i) epsilon_[i] = model.contacts[index(i)].restitution;
  for (Eigen::VectorXd* x : {&gamma_k, &gamma_free, &P, &b_, &Lambda_}) x->setZero(m);
}

ContactSet StepImpact::solve(ContactSet active) {
  if (!poisson_ || std::has_single_bit(active)) {
    for_each(active, [&](int i) { b_[i] = gamma_free[i] + epsilon_[i] * gamma_k[i]; });
    return complementarity(G_, active, b_, P);
  }
  complementarity(G_, active, gamma_k, Lambda_);
  for_each(active, [&](int i) {
    b_[i] = gamma_free[i];
    for_each(active, [&](int j) { b_[i] += G_(i, j) * (1.0 + epsilon_[j]) * Lambda_[j]; });
  });
  complementarity(G_, active, b_, P);
  ContactSet pushed = 0;
  for_each(active, [&](int i) {
    P[i] += (1.0 + epsilon_[i]) * Lambda_[i];
    if (P[i] > 0.0) pushed |= bit(i);
  });
  return pushed;
}

bool starts_inside(const Task& task) {
  constexpr double rounding = 1e-10;
  for (const Contact& contact : task.model.contacts) {
    if (gap(contact, task.start.q, 0.0) < -rounding) return true;
  }
  return false;
}

Record::Record(const Task& task, double h, Outcome& outcome)
    : outcome_(outcome),
      h_(h),
      sample_step_(task.sample_step),
      f_(task.model.coordinates()),
      steps_(std::llround(task.horizon / h)) {
  constexpr std::size_t many = 4096;
  outcome_.impacts.reserve(many);
  next_sample();
}

void Record::fail(std::int64_t k) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "unstable at t = %.6g", static_cast<double>(k) * h_);
  outcome_.failure = text.data();
}

void Record::sample(const double* q, const double* u) {
  // If the step is longer than the sampling interval, several samples belong to one tick.
  const std::int64_t tick = sample_tick_;
  while (sample_tick_ == tick) {
    outcome_.q.col(sample_) = Eigen::Map<const Eigen::VectorXd>(q, f_);
    outcome_.u.col(sample_) = Eigen::Map<const Eigen::VectorXd>(u, f_);
    ++sample_;
    next_sample();
  }
}

void Record::next_sample() {
  const bool wanted = sample_step_ > 0.0 && sample_ < outcome_.q.cols();
  sample_tick_ = wanted ? std::llround(static_cast<double>(sample_) * sample_step_ / h_) : -1;
}

void Record::add_impacts(std::int64_t k, ContactSet impacts) {
  if (k > steps_) return;
  outcome_.impacts.insert(outcome_.impacts.end(), index(std::popcount(impacts)),
                          static_cast<double>(k) * h_);
}

}  // namespace sprag::work_precision
