#include "tools/view/drawn_machine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag::view {
namespace {

constexpr int beam_places = 64;
constexpr Eigen::Index longest_chain = 12;

// Outputs that are displacements.
std::vector<const Output*> displacements(const Model& model) {
  std::vector<const Output*> result;
  for (const Output& output : model.outputs) {
    if (!output.velocity && !output.direction.isZero(0.0)) result.push_back(&output);
  }
  return result;
}

// Whether many coordinates may be of different kinds, as deflections and rotations of finite
// elements. Springs between displacements alone make no positive entry of K off the diagonal.
bool may_have_rotations(const Scene& scene) {
  Eigen::MatrixXd K = scene.kept ? scene.kept->K : scene.model.K;
  if (K.rows() <= longest_chain) return false;
  const double rounding = 1e-9 * K.cwiseAbs().maxCoeff();
  K.diagonal().setZero();
  return K.maxCoeff() > rounding;
}

// The coordinate of a direction's largest entry, from 0.
Eigen::Index largest_entry(const Eigen::VectorXd& w) {
  Eigen::Index at = 0;
  w.cwiseAbs().maxCoeff(&at);
  return at;
}

// Coordinates to draw as a chain, from 0: without those that a shaken frame does not move, such as
// rotations, unless a contact is there.
std::vector<Eigen::Index> chain_of(const Scene& scene) {
  const Eigen::Index n = scene.kept ? scene.kept->given() : scene.model.coordinates();
  const bool frame = scene.frame && !scene.kept && !scene.frame->influence.isZero(0.0);
  const auto at_contact = [&](Eigen::Index i) {
    return std::any_of(scene.model.contacts.begin(), scene.model.contacts.end(),
                       [i](const Contact& contact) { return largest_entry(contact.w) == i; });
  };
  std::vector<Eigen::Index> chain;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!frame || scene.frame->influence[i] != 0.0 || at_contact(i)) chain.push_back(i);
  }
  return chain;
}

// s of w = s d; 0 if they are not parallel.
double multiple(const Eigen::VectorXd& w, const Eigen::VectorXd& d) {
  const double s = w.dot(d) / d.squaredNorm();
  return (w - s * d).norm() <= 1e-9 * w.norm() ? s : 0.0;
}

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

std::optional<double> longest_period(const Model& model) {
  double slowest = std::numeric_limits<double>::infinity();
  const auto take = [&slowest](const Harmonic& harmonic) {
    if (harmonic.amplitude != 0.0 && harmonic.frequency > 0.0) {
      slowest = std::min(slowest, harmonic.frequency);
    }
  };
  for (const Force& force : model.forces) take(force.harmonic);
  for (const Contact& contact : model.contacts) take(contact.motion);
  if (std::isinf(slowest)) {
    // Squares below the rounding of the largest belong to rigid-body motion.
    const Eigen::VectorXd squares = eigenpairs(model.K, model.M).values;
    const double least = 1e-12 * squares.cwiseAbs().maxCoeff();
    for (const double square : squares) {
      if (square > least) slowest = std::min(slowest, std::sqrt(square));
    }
  }
  if (std::isinf(slowest)) return std::nullopt;
  return 2.0 * std::numbers::pi / slowest;
}

DrawnMachine::DrawnMachine(const Scene& scene) : contacts_(scene.model.contacts) {
  const Eigen::Index f = scene.model.coordinates();
  if (scene.beam) {
    kind_ = Kind::beam;
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
  const std::size_t outputs = displacements(scene.model).size();
  if (outputs >= 2 || (outputs == 1 && f > longest_chain) || may_have_rotations(scene)) {
    draw_nodes(scene);
  } else {
    draw_chain(scene);
  }
}

void DrawnMachine::draw_nodes(const Scene& scene) {
  kind_ = Kind::nodes;
  std::vector<Eigen::VectorXd> directions;
  for (const Output* output : displacements(scene.model)) {
    directions.push_back(output->direction);
    names_.push_back(output->name);
  }
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const Eigen::VectorXd& w = contacts_[i].w;
    const auto node = std::find_if(directions.begin(), directions.end(),
                                   [&](const auto& d) { return multiple(w, d) != 0.0; });
    const auto at = static_cast<std::size_t>(node - directions.begin());
    if (node == directions.end()) {
      directions.push_back(w);
      names_.push_back(std::string("contact ").append(std::to_string(i + 1)));
    }
    const double weight = multiple(w, directions[at]);
    stops_.push_back({static_cast<double>(at + 1), weight > 0.0 ? -1 : 1, {}, true});
    weight_.push_back(weight);
  }
  shapes_.resize(std::ssize(directions), scene.model.coordinates());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    shapes_.row(static_cast<Eigen::Index>(k)) = directions[k].transpose();
    places_.push_back(static_cast<double>(k + 1));
  }
}

void DrawnMachine::draw_chain(const Scene& scene) {
  // A scene that keeps some modes is drawn by the coordinates of its file.
  const Eigen::Index f = scene.model.coordinates();
  const Eigen::MatrixXd given =
      scene.kept ? scene.kept->Phi : Eigen::MatrixXd(Eigen::MatrixXd::Identity(f, f));
  const std::vector<Eigen::Index> chain = chain_of(scene);
  shapes_ = given(chain, Eigen::all);
  for (const Eigen::Index i : chain) {
    places_.push_back(static_cast<double>(i + 1));
    names_.push_back(std::string("q").append(std::to_string(i + 1)));
  }
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    Contact contact = contacts_[i];
    if (scene.kept) contact.w = scene.kept->given_w[i];
    // The contact is drawn between the two coordinates with the largest entries of w.
    const Eigen::Index first = largest_entry(contact.w);
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
