#include "sprag/estimation/event_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sprag {
namespace {

// Beyond it the normal distribution is its asymptotic series to double precision, or nothing.
constexpr double far = 8.0;
constexpr double half_log_two_pi = 0.91893853320467274178;
// A pivot below this share of its diagonal entry is rounding.
constexpr double least_pivot = 1e-15;

// A hypothesis of less weight is none: roots of such weights would square to nothing.
constexpr double least_weight = 1e-60;

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

FluxMoments flux_moments(double mu, double d) {
  const double a = -mu / d;
  if (a > far) {
    // Hardly any of it moves away from the support.
    return {std::log(-mu), mu - d / a, d * d * (1.0 - 1.0 / (a * a))};
  }
  if (a < -far) {
    // Hardly any of it meets the support; what does meets it slowly. Asymptotic series.
    const double x = 1.0 / (a * a);
    const double e0 = x * (1.0 - x * (3.0 - 15.0 * x));
    const double mean = -2.0 / a * x * (1.0 - x * (6.0 - 45.0 * x)) / e0;
    const double second = 6.0 * x * x * (1.0 - x * (10.0 - 105.0 * x)) / e0;
    return {std::log(d) - 0.5 * a * a - half_log_two_pi + std::log(e0), -d * mean,
            d * d * (second - mean * mean)};
  }
  // Moments of y = -gamma over phi(a): e_k = int y^(k+1) N(y; a, 1) dy / phi(a), lengths in d.
  const double density = normal_density(a);
  const double R = normal_cdf(a) / density;
  const double e0 = 1.0 + a * R;
  const double e1 = (1.0 + a * a) * R + a;
  const double e2 = (a * a * a + 3.0 * a) * R + a * a + 2.0;
  const double mean = e1 / e0;
  return {std::log(d * density * e0), -d * mean, d * d * std::max(e2 / e0 - mean * mean, 0.0)};
}

EventMixture::EventMixture(Eigen::Index columns, Eigen::Index coordinates) {
  const Eigen::Index all = columns + capacity;
  phi_.setZero(columns, capacity);
  psi_.setZero(columns, capacity);
  b_q_.setZero(coordinates, capacity);
  b_u_.setZero(coordinates, capacity);
  w_.setZero(capacity);
  mean_phi_.setZero(columns);
  reflection_.setZero(columns);
  xi_.setZero(columns);
  delta_.setZero(columns);
  off_q_.setZero(coordinates);
  off_u_.setZero(coordinates);
  joint_.setZero(all, all);
  basis_q_.setZero(coordinates, all);
  basis_u_.setZero(coordinates, all);
}

void EventMixture::begin(Eigen::Index columns) {
  columns_ = columns;
  size_ = 0;
}

void EventMixture::add(const Hypothesis& hypothesis) { hypotheses_[size_++] = hypothesis; }

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
void EventMixture::reflect(Eigen::MatrixXd& S_q, Eigen::MatrixXd& S_u) {
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
  turn(S_q.leftCols(c));
  turn(S_u.leftCols(c));
}

Eigen::Index EventMixture::collapse(Eigen::VectorXd& q, Eigen::VectorXd& u, Eigen::MatrixXd& S_q,
                                    Eigen::MatrixXd& S_u) {
  const double total = log_total();
  if (!std::isfinite(total)) return 0;
  const Eigen::Index c = columns_;
  int centre = -1;  // the likeliest that jumps
  for (int j = 0; j < size_; ++j) {
    const Hypothesis& of = hypotheses_[j];
    const double weight = std::exp(of.log_weight - total);
    w_[j] = weight > least_weight ? weight : 0.0;
    if (w_[j] > 0.0 && jumps(of) && (centre < 0 || w_[j] > w_[centre])) centre = j;
  }
  reflect(S_q, S_u);

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

  // Between the hypotheses: a column each. Within them: the covariance of xi; of y, which moves the
  // state by b of the likeliest; and of each other's y, which moves it by what its b differs.
  const Eigen::Index within = n;
  Eigen::Index columns = within;
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
    auto mean_q = S_q.col(columns);
    auto mean_u = S_u.col(columns++);
    mean_q.noalias() = S_q.leftCols(c).lazyProduct(delta);
    mean_u.noalias() = S_u.leftCols(c).lazyProduct(delta);
    if (centre >= 0) {
      const double off = of.alpha - usual - further;
      mean_q += off * basis_q_.col(c) - off_q_;
      mean_u += off * basis_u_.col(c) - off_u_;
      joint_.row(c).head(c) += w * of.slope * psi.transpose();
      joint_(c, c) += w * of.beta;
    }
    if (differs(j)) {
      mean_q += of.alpha * basis_q_.col(n);
      mean_u += of.alpha * basis_u_.col(n);
      joint_.row(n).head(c) = w * of.slope * psi.transpose();
      joint_(n, c) = joint_(n, n) = w * of.beta;
      ++n;
    }
    mean_q *= std::sqrt(w);
    mean_u *= std::sqrt(w);
  }
  n = within;

  q.noalias() += S_q.leftCols(c).lazyProduct(xi);
  u.noalias() += S_u.leftCols(c).lazyProduct(xi);
  if (centre >= 0) {
    q += (usual + further) * basis_q_.col(c) + off_q_;
    u += (usual + further) * basis_u_.col(c) + off_u_;
  }

  // Cholesky, in place; what is not positive but by rounding is nothing.
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

  // S+ = basis L.
  basis_q_.leftCols(c) = S_q.leftCols(c);
  basis_u_.leftCols(c) = S_u.leftCols(c);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto column = joint_.col(k).segment(k, n - k);
    S_q.col(k).noalias() = basis_q_.middleCols(k, n - k).lazyProduct(column);
    S_u.col(k).noalias() = basis_u_.middleCols(k, n - k).lazyProduct(column);
  }
  return columns;
}

}  // namespace sprag
