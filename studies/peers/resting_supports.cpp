#include "studies/peers/resting_supports.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sprag::work_precision {

RestingSupports::RestingSupports(const Model& model) : model_(model) {
  std::vector<double> frequencies;
  for (const Contact& contact : model.contacts) {
    const Harmonic& s = contact.motion;
    if (s.amplitude != 0.0 && std::ranges::find(frequencies, s.frequency) == frequencies.end()) {
      frequencies.push_back(s.frequency);
    }
  }
  if (frequencies.empty()) return;
  const Eigen::Index m = static_cast<Eigen::Index>(model.contacts.size());
  Eigen::MatrixXd W(model.coordinates(), m);
  for (Eigen::Index i = 0; i < m; ++i) W.col(i) = model.contacts[static_cast<std::size_t>(i)].w;
  // r is the static deflection that follows the supports, which hardly excites fast modes. If the
  // machine has rigid-body modes, r is the least motion in the norm of M.
  Eigen::LLT<Eigen::MatrixXd> factor(model.K);
  if (factor.info() != Eigen::Success) factor.compute(model.M);
  const Eigen::MatrixXd deflections = factor.solve(W);
  const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> compliance(W.transpose() *
                                                                           deflections);
  for (const double frequency : frequencies) {
    Eigen::VectorXd s_cosine = Eigen::VectorXd::Zero(m);
    Eigen::VectorXd s_sine = Eigen::VectorXd::Zero(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const Harmonic& s = model.contacts[static_cast<std::size_t>(i)].motion;
      if (s.frequency != frequency) continue;
      s_cosine[i] = s.amplitude * std::cos(s.phase);
      s_sine[i] = -s.amplitude * std::sin(s.phase);
    }
    const Motion r{frequency, deflections * compliance.solve(s_cosine),
                   deflections * compliance.solve(s_sine)};
    const double error = std::max((W.transpose() * r.cosine - s_cosine).norm(),
                                  (W.transpose() * r.sine - s_sine).norm());
    if (error > 1e-10 * (s_cosine.norm() + s_sine.norm())) {
      throw ModelError("supports that move against each other cannot be brought to rest");
    }
    const Eigen::MatrixXd stiffness = model.K - frequency * frequency * model.M;
    const Eigen::MatrixXd damping = frequency * model.C;
    model_.forces.push_back(
        {stiffness * r.cosine + damping * r.sine, 0.0, Harmonic{1.0, frequency, 0.0}});
    model_.forces.push_back({stiffness * r.sine - damping * r.cosine, 0.0,
                             Harmonic{1.0, frequency, -std::numbers::pi / 2}});
    motions_.push_back(r);
  }
  for (Contact& contact : model_.contacts) contact.motion = Harmonic{};
}

State RestingSupports::into(const State& start) const {
  State x = start;
  for (const Motion& r : motions_) {
    x.q += r.cosine;
    x.u += r.frequency * r.sine;
  }
  return x;
}

void RestingSupports::out_of(double t, Eigen::Ref<Eigen::VectorXd> q,
                             Eigen::Ref<Eigen::VectorXd> u) const {
  for (const Motion& r : motions_) {
    const double cosine = std::cos(r.frequency * t);
    const double sine = std::sin(r.frequency * t);
    q -= cosine * r.cosine + sine * r.sine;
    u -= r.frequency * (cosine * r.sine - sine * r.cosine);
  }
}

}  // namespace sprag::work_precision
