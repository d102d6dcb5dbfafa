#include "tools/view/drawn_machine.h"

#include <cmath>

#include "sprag/beam.h"

namespace sprag::view {
namespace {

constexpr int beam_places = 64;

// Ground motion e(t) of a beam: that of its first moving support, with the sign turned to heights;
// zero if no support moves.
Harmonic ground_of(const Scene& scene, const std::vector<DrawnStop>& stops) {
  for (std::size_t i = 0; i < stops.size(); ++i) {
    Harmonic motion = scene.model.contacts[i].motion;
    if (motion.amplitude == 0.0) continue;
    motion.amplitude *= -stops[i].side;
    return motion;
  }
  return {};
}

}  // namespace

DrawnMachine::DrawnMachine(const Scene& scene)
    : beam_(scene.beam.has_value()), contacts_(scene.model.contacts) {
  const Eigen::Index f = scene.model.coordinates();
  if (beam_) {
    shapes_.resize(beam_places + 1, f);
    for (int i = 0; i <= beam_places; ++i) {
      const double x = scene.beam->length * i / beam_places;
      places_.push_back(x);
      shapes_.row(i) = mode_shapes(*scene.beam, x).transpose();
    }
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      const double x = scene.positions[i];
      const bool below = contacts_[i].w.dot(mode_shapes(*scene.beam, x)) > 0.0;
      stops_.push_back({x, below ? -1 : 1, {}, true});
      weight_.push_back(below ? 1.0 : -1.0);
    }
    base_ = ground_of(scene, stops_);
    return;
  }
  // A scene that keeps some modes is drawn by the coordinates of its file.
  shapes_ = scene.kept ? scene.kept->Phi : Eigen::MatrixXd(Eigen::MatrixXd::Identity(f, f));
  for (Eigen::Index i = 0; i < shapes_.rows(); ++i) places_.push_back(static_cast<double>(i + 1));
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    Contact contact = contacts_[i];
    if (scene.kept) contact.w = scene.kept->given_w[i];
    // The contact is drawn between the two coordinates with the largest entries of w.
    Eigen::Index first = 0;
    contact.w.cwiseAbs().maxCoeff(&first);
    Eigen::VectorXd others = contact.w;
    others[first] = 0.0;
    Eigen::Index second = 0;
    const double share = others.size() > 1 ? others.cwiseAbs().maxCoeff(&second) : 0.0;
    DrawnStop stop;
    stop.across = static_cast<double>(first + 1);
    stop.side = contact.w[first] > 0.0 ? -1 : 1;
    stop.has_height = share == 0.0;
    if (share > 0.0) stop.other = static_cast<double>(second + 1);
    stops_.push_back(stop);
    weight_.push_back(contact.w[first]);
  }
}

double DrawnMachine::base(double t) const { return value(base_, t); }

std::vector<double> DrawnMachine::shape(const Eigen::VectorXd& q, double t) const {
  const Eigen::Index f = std::min(q.size(), shapes_.cols());
  Eigen::VectorXd heights = shapes_.leftCols(f) * q.head(f);
  heights.array() += base(t);
  return {heights.begin(), heights.end()};
}

std::vector<double> DrawnMachine::sigma(const Eigen::VectorXd& sigma_q) const {
  const Eigen::Index f = std::min(sigma_q.size(), shapes_.cols());
  const Eigen::VectorXd sigma =
      (shapes_.leftCols(f).cwiseAbs2() * sigma_q.head(f).cwiseAbs2()).cwiseSqrt();
  return {sigma.begin(), sigma.end()};
}

double DrawnMachine::stop(std::size_t contact, double t) const {
  const Contact& of = contacts_[contact];
  return base(t) - (value(of.motion, t) + of.clearance) / weight_[contact];
}

}  // namespace sprag::view
