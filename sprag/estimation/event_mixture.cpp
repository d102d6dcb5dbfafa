#include "sprag/estimation/event_mixture.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// Beyond it the normal distribution is its asymptotic series to double precision, or nothing.
constexpr double far = 8.0;
// A pivot below this share of its diagonal entry is rounding.
constexpr double least_pivot = 1e-15;

// A hypothesis of less weight is none: roots of such weights would square to nothing.
constexpr double least_weight = 1e-60;

// A component has more weight, and what one that is merged is off by counts from here on.
constexpr double least_share = 1e-3;
constexpr double least_part = 1e-9;
// Components are points on a curve: each is made as wide as it takes to fill the space between
// them, by a share of what all of them are apart, and they move together by as much, so that mean
// and covariance stay (a kernel as of Liu and West 2001).
constexpr double kernel = 0.5;
constexpr double narrower = 0.86602540378443860;  // sqrt(1 - kernel^2)

bool jumps(const EventMixture::Hypothesis& of) {
  return of.alpha != 0.0 || of.beta != 0.0 || of.slope != 0.0;
}

double normal_density(double x) { return std::exp(-0.5 * x * x - half_log_two_pi); }
double normal_cdf(double x) { return 0.5 * std::erfc(-x * std::numbers::sqrt2 / 2.0); }

}  // namespace

double log_normal_cdf(double x) {
  if (x > -far) return std::log(normal_cdf(x));
  const double inverse = 1.0 / (x * x);
  return -0.5 * x * x - half_log_two_pi - std::log(-x) +
         std::log1p(-inverse * (1.0 - 3.0 * inverse));
}

double normal_hazard(double x) {
  if (x > -far) return normal_density(x) / normal_cdf(x);
  const double inverse = 1.0 / (x * x);
  return -x / (1.0 - inverse * (1.0 - 3.0 * inverse));
}

EventMixture::EventMixture(Eigen::Index columns, Eigen::Index coordinates) {
  const Eigen::Index all = columns + capacity;
  const Eigen::Index most = columns + added_columns(columns);
  for (Eigen::MatrixXd* x : {&phi_, &psi_}) x->setZero(columns, capacity);
  for (Eigen::MatrixXd* x : {&b_q_, &b_u_, &mixed_q_, &mixed_u_}) x->setZero(coordinates, capacity);
  for (Eigen::MatrixXd* x : {&component_q_, &component_u_}) {
    x->setZero(coordinates, Belief::most_components);
  }
  for (Within& within : within_) {
    for (Eigen::MatrixXd* x : {&within.S_q, &within.S_u}) x->setZero(coordinates, columns);
  }
  w_.setZero(capacity);
  for (Eigen::VectorXd* x : {&mean_phi_, &reflection_, &xi_, &delta_}) x->setZero(columns);
  for (Eigen::VectorXd* x :
       {&off_q_, &off_u_, &between_q_, &between_u_, &all_mixed_q_, &all_mixed_u_}) {
    x->setZero(coordinates);
  }
  joint_.setZero(all, all);
  for (Eigen::MatrixXd* x : {&basis_q_, &basis_u_}) x->setZero(coordinates, all);
  for (Eigen::MatrixXd* x : {&S_q_, &S_u_}) x->setZero(coordinates, most);
}

void EventMixture::begin(const Belief& belief) {
  components_ = belief.components;
  columns_ = belief.columns - components_;
  size_ = within_size_ = 0;
  for (int k = 0; k < components_; ++k) {
    const double root = std::sqrt(belief.weights[static_cast<std::size_t>(k)]);
    component_q_.col(k) = belief.S_q.col(k) / root;
    component_u_.col(k) = belief.S_u.col(k) / root;
  }
}

void EventMixture::add(std::span<const Hypothesis> of_components) {
  Hypothesis& all = hypotheses_[size_] = of_components.front();
  const auto parts = std::span(parts_[size_++]).first(of_components.size());
  if (parts.size() == 1) {
    parts[0] = {1.0, all.shift_phi, all.shift_psi, all.alpha};
    return;
  }
  double highest = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& of : of_components) {
    if (of.log_weight > highest) highest = of.log_weight;
  }
  double total = 0.0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const double share = std::exp(of_components[k].log_weight - highest);
    parts[k] = {share > 0.0 ? share : 0.0, of_components[k].shift_phi, of_components[k].shift_psi,
                of_components[k].alpha};
    total += parts[k].share;
  }
  all.log_weight = total > 0.0 ? highest + std::log(total) : highest;
  all.shift_phi = all.shift_psi = all.taken_along_psi = all.alpha = all.beta = all.slope = 0.0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (parts[k].share == 0.0) continue;
    const Hypothesis& of = of_components[k];
    const double share = parts[k].share /= total;
    all.shift_phi += share * of.shift_phi;
    all.shift_psi += share * of.shift_psi;
    all.taken_along_psi += share * of.taken_along_psi;
    all.alpha += share * of.alpha;
    all.beta += share * of.beta;
    all.slope += share * of.slope;
  }
}

double EventMixture::log_total_of_first(int count) const {
  double largest = -std::numeric_limits<double>::infinity();
  for (int j = 0; j < count; ++j) {
    if (hypotheses_[j].log_weight > largest) largest = hypotheses_[j].log_weight;
  }
  if (!std::isfinite(largest)) return -std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (int j = 0; j < count; ++j) {
    const double weight = std::exp(hypotheses_[j].log_weight - largest);
    if (weight > 0.0) sum += weight;
  }
  return largest + std::log(sum);
}

// Turns xi so that the mean of phi lies along its first axis: where the hypotheses agree in what
// they measure, its variance is then an entry of its own and does not cancel.
void EventMixture::reflect(Belief& belief) {
  const Eigen::Index c = columns_;
  auto mean = mean_phi_.head(c);
  mean.setZero();
  for (int j = 0; j < size_; ++j) mean += w_[j] * phi_.col(j).head(c);
  const double norm = mean.norm();
  if (norm == 0.0) return;
  auto r = reflection_.head(c);
  r = mean;
  r[0] += mean[0] < 0.0 ? -norm : norm;
  const double factor = 2.0 / r.squaredNorm();
  for (int j = 0; j < size_; ++j) {
    auto phi = phi_.col(j).head(c);
    phi -= factor * r.dot(phi) * r;
    auto psi = psi_.col(j).head(c);
    psi -= factor * r.dot(psi) * r;
  }
  const auto turn = [&](auto S) {
    for (Eigen::Index i = 0; i < S.rows(); ++i) {
      const double along = factor * S.row(i).dot(r.transpose());
      S.row(i) -= along * r.transpose();
    }
  };
  turn(belief.S_q.middleCols(components_, c));
  turn(belief.S_u.middleCols(components_, c));
}

// What the means of the components are in each hypothesis, and in all.
void EventMixture::mix_components() {
  for (Eigen::VectorXd* x : {&all_mixed_q_, &all_mixed_u_}) x->setZero();
  for (int j = 0; j < size_; ++j) {
    mixed_q_.col(j).setZero();
    mixed_u_.col(j).setZero();
    for (int k = 0; k < components_; ++k) {
      const double share = parts_[j][k].share;
      if (share == 0.0) continue;
      mixed_q_.col(j) += share * component_q_.col(k);
      mixed_u_.col(j) += share * component_u_.col(k);
    }
    all_mixed_q_ += w_[j] * mixed_q_.col(j);
    all_mixed_u_ += w_[j] * mixed_u_.col(j);
  }
}

// Cholesky of the first n rows and columns of joint_, in place; what is not positive but by
// rounding is nothing.
void EventMixture::factor(Eigen::Index n) {
  for (Eigen::Index k = 0; k < n; ++k) {
    double pivot = joint_(k, k);
    const double diagonal = pivot;
    for (Eigen::Index i = 0; i < k; ++i) pivot -= joint_(k, i) * joint_(k, i);
    if (!(pivot > least_pivot * diagonal)) {
      joint_.col(k).segment(k, n - k).setZero();
      continue;
    }
    const double root = std::sqrt(pivot);
    joint_(k, k) = root;
    const auto above = joint_.row(k).head(k);
    for (Eigen::Index i = k + 1; i < n; ++i) {
      joint_(i, k) = (joint_(i, k) - joint_.row(i).head(k).dot(above)) / root;
    }
  }
}

// Hypotheses of more weight than this become components.
double EventMixture::least_kept(int keep) const {
  if (keep == 0) return std::numeric_limits<double>::infinity();
  if (size_ <= keep) return least_share;
  double sorted[capacity];
  std::copy_n(w_.data(), size_, sorted);
  std::nth_element(sorted, sorted + keep, sorted + size_, std::greater<>());
  return std::max(least_share, sorted[keep]);
}

bool EventMixture::collapse(int keep, Belief& belief) {
  const double total = log_total();
  if (!std::isfinite(total)) return false;
  const Eigen::Index c = columns_;
  const Eigen::Index first = components_;
  int centre = -1;  // the likeliest that jumps
  for (int j = 0; j < size_; ++j) {
    const Hypothesis& of = hypotheses_[j];
    const double weight = std::exp(of.log_weight - total);
    w_[j] = weight > least_weight ? weight : 0.0;
    if (w_[j] > 0.0 && jumps(of) && (centre < 0 || w_[j] > w_[centre])) centre = j;
  }
  reflect(belief);
  mix_components();
  const auto S_q = belief.S_q.middleCols(first, c);
  const auto S_u = belief.S_u.middleCols(first, c);

  // Means: of xi; of y, which moves the state by y b, over that of the likeliest hypothesis; and of
  // what the others' y b are off by their b. Nothing but differences is to be left of the variance.
  const double usual = centre >= 0 ? hypotheses_[centre].alpha : 0.0;
  const auto differs = [&](int j) { return j != centre && jumps(hypotheses_[j]); };
  auto xi = xi_.head(c);
  xi.setZero();
  double further = 0.0;
  off_q_.setZero();
  off_u_.setZero();
  Eigen::Index n = centre >= 0 ? c + 1 : c;
  for (int j = 0; j < size_; ++j) {
    const Hypothesis& of = hypotheses_[j];
    const double w = w_[j];
    if (w == 0.0) continue;
    xi += w * (of.shift_phi * phi_.col(j).head(c) + of.shift_psi * psi_.col(j).head(c));
    further += w * (of.alpha - usual);
    if (!differs(j)) continue;
    basis_q_.col(n) = b_q_.col(j) - b_q_.col(centre);
    basis_u_.col(n) = b_u_.col(j) - b_u_.col(centre);
    off_q_ += w * of.alpha * basis_q_.col(n);
    off_u_ += w * of.alpha * basis_u_.col(n++);
  }
  const Eigen::Index within = n;

  // The new S: components; within the hypotheses; between those that are no components, and of
  // what components are made narrower by; between the old components of a hypothesis.
  const double least = least_kept(keep);
  int kept = 0;
  for (int j = 0; j < size_; ++j) kept += w_[j] > least ? 1 : 0;
  Eigen::Index columns = kept + (within_size_ > 0 ? within_size_ * c : within);
  kept = 0;
  const auto add_column = [&](double factor, const auto& on_q, const auto& on_u) {
    S_q_.col(columns) = factor * on_q;
    S_u_.col(columns++) = factor * on_u;
  };

  // Within: the covariance of xi; of y, which moves the state by b of the likeliest; and of each
  // other's y, which moves it by what its b differs.
  if (centre >= 0) {
    basis_q_.col(c) = b_q_.col(centre);
    basis_u_.col(c) = b_u_.col(centre);
  }
  auto T = joint_.topLeftCorner(c, c);
  T.setIdentity();
  T(0, 0) = 0.0;
  joint_.block(c, 0, n - c, n).setZero();
  n = c + 1;
  for (int j = 0; j < size_; ++j) {
    const Hypothesis& of = hypotheses_[j];
    const double w = w_[j];
    if (w == 0.0) continue;
    const auto phi = phi_.col(j).head(c);
    const auto psi = psi_.col(j).head(c);
    for (Eigen::Index k = 0; k < c; ++k) {
      const double by_phi = w * of.taken_along_phi * phi[k];
      const double by_psi = w * of.taken_along_psi * psi[k];
      for (Eigen::Index i = std::max<Eigen::Index>(k, 1); i < c; ++i) {
        T(i, k) -= by_phi * phi[i] + by_psi * psi[i];
      }
    }
    const double rest = phi.tail(c - 1).squaredNorm();
    T(0, 0) += w * (1.0 - of.taken_along_phi + of.taken_along_phi * (of.rest_phi + rest) -
                    of.taken_along_psi * psi[0] * psi[0]);

    auto delta = delta_.head(c);
    delta = of.shift_phi * phi + of.shift_psi * psi - xi;
    between_q_ = mixed_q_.col(j) - all_mixed_q_;
    between_u_ = mixed_u_.col(j) - all_mixed_u_;
    between_q_.noalias() += S_q.lazyProduct(delta);
    between_u_.noalias() += S_u.lazyProduct(delta);
    if (centre >= 0) {
      const double off = of.alpha - usual - further;
      between_q_ += off * basis_q_.col(c) - off_q_;
      between_u_ += off * basis_u_.col(c) - off_u_;
      joint_.row(c).head(c) += w * of.slope * psi.transpose();
      joint_(c, c) += w * of.beta;
    }
    if (differs(j)) {
      between_q_ += of.alpha * basis_q_.col(n);
      between_u_ += of.alpha * basis_u_.col(n);
      joint_.row(n).head(c) = w * of.slope * psi.transpose();
      joint_(n, c) = joint_(n, n) = w * of.beta;
      ++n;
    }
    const double root = std::sqrt(w);
    if (w > least) {
      belief.weights[static_cast<std::size_t>(kept)] = w;
      S_q_.col(kept) = narrower * root * between_q_;
      S_u_.col(kept++) = narrower * root * between_u_;
      add_column(kernel * root, between_q_, between_u_);
    } else {
      add_column(root, between_q_, between_u_);
    }
    for (int k = 0; k < components_; ++k) {
      const Part& part = parts_[j][k];
      if (!(w * part.share > least_part)) continue;
      delta = (part.shift_phi - of.shift_phi) * phi + (part.shift_psi - of.shift_psi) * psi;
      between_q_ = component_q_.col(k) - mixed_q_.col(j);
      between_u_ = component_u_.col(k) - mixed_u_.col(j);
      between_q_.noalias() += S_q.lazyProduct(delta);
      between_u_.noalias() += S_u.lazyProduct(delta);
      if (jumps(of)) {
        between_q_ += (part.alpha - of.alpha) * b_q_.col(j);
        between_u_ += (part.alpha - of.alpha) * b_u_.col(j);
      }
      add_column(std::sqrt(w * part.share), between_q_, between_u_);
    }
  }
  n = within;

  belief.q += all_mixed_q_;
  belief.u += all_mixed_u_;
  belief.q.noalias() += S_q.lazyProduct(xi);
  belief.u.noalias() += S_u.lazyProduct(xi);
  if (centre >= 0) {
    belief.q += (usual + further) * basis_q_.col(c) + off_q_;
    belief.u += (usual + further) * basis_u_.col(c) + off_u_;
  }

  // Within the hypotheses: what the caller says, or basis L.
  for (int j = 0; j < within_size_; ++j) {
    const double root = std::sqrt(within_[j].share);
    S_q_.middleCols(kept + j * c, c) = root * within_[j].S_q.leftCols(c);
    S_u_.middleCols(kept + j * c, c) = root * within_[j].S_u.leftCols(c);
  }
  if (within_size_ == 0) {
    factor(n);
    basis_q_.leftCols(c) = S_q;
    basis_u_.leftCols(c) = S_u;
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto column = joint_.col(k).segment(k, n - k);
      S_q_.col(kept + k).noalias() = basis_q_.middleCols(k, n - k).lazyProduct(column);
      S_u_.col(kept + k).noalias() = basis_u_.middleCols(k, n - k).lazyProduct(column);
    }
  }
  belief.components = kept;
  belief.columns = columns;
  belief.S_q.leftCols(columns) = S_q_.leftCols(columns);
  belief.S_u.leftCols(columns) = S_u_.leftCols(columns);
  return true;
}

}  // namespace sprag
