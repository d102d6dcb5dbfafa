#include "studies/posterior/posterior.h"

#include <Eigen/Dense>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "studies/common/random.h"

namespace sprag::posterior {
namespace {

constexpr int most_iterations = 20;
constexpr int most_halvings = 8;
constexpr double largest_difference = 0.05;  // for derivatives, in prior standard deviations
constexpr double least_difference = 1e-6;
constexpr double converged = 1e-4;   // in standard deviations
constexpr double best_stride = 2.4;  // of a random walk in n dimensions, times sqrt(n)
// The result is rejected if fewer steps are accepted, or if the means of the halves differ by more
// standard deviations.
constexpr double least_accepted = 0.1;
constexpr double most_apart = 0.5;

// The posterior as a function of y = R^-T (x - m), n = 2 f entries: minus twice its logarithm is a
// sum of squares, the last of which are those of y.
class Density {
 public:
  Density(const Flows& flows, const Window& window, double jitter)
      : flows_(flows), window_(window), jitter_(jitter) {
    start_.q.resize(n() / 2);
    start_.u.resize(n() / 2);
  }

  Eigen::Index n() const { return window_.mean.size(); }
  Eigen::Index size() const { return static_cast<Eigen::Index>(window_.events.size()) + n(); }
  Eigen::VectorXd truth() const {
    return window_.root.transpose().triangularView<Eigen::Lower>().solve(window_.x - window_.mean);
  }

  // False where the density is zero. `end`: the state at the window's end.
  bool residuals(const Eigen::VectorXd& y, Eigen::VectorXd& r, Eigen::VectorXd* end = nullptr) {
    const Eigen::Index f = n() / 2;
    const Eigen::VectorXd x = window_.mean + window_.root.transpose() * y;
    start_.q = x.head(f);
    start_.u = x.tail(f);
    events_.clear();
    try {
      Master master(flows_, start_, window_.begin, 0);
      master.advance(at(window_.end), events_, window_.events.size() + 1);
      if (events_.size() != window_.events.size()) return false;
      for (std::size_t k = 0; k < events_.size(); ++k) {
        const ContactEvent& event = events_[k];
        const ContactEvent& true_one = window_.events[k];
        if (event.contact != true_one.contact || event.kind != true_one.kind) return false;
        r[static_cast<Eigen::Index>(k)] = (window_.reported[k] - event.t) / jitter_;
      }
      if (end != nullptr) master.state(at(window_.end), end->head(f), end->tail(f));
    } catch (const Error&) {
      return false;
    }
    r.tail(n()) = y;
    return true;
  }

  // By central differences, small enough for the sequence of events to stay the same.
  bool derivatives(const Eigen::VectorXd& y, Eigen::MatrixXd& J) {
    for (double step = largest_difference; step > least_difference; step *= 0.1) {
      if (derivatives(y, step, J)) return true;
    }
    return false;
  }

 private:
  bool derivatives(const Eigen::VectorXd& y, double step, Eigen::MatrixXd& J) {
    Eigen::VectorXd later(size()), earlier(size()), beside = y;
    for (Eigen::Index j = 0; j < n(); ++j) {
      beside[j] = y[j] + step;
      if (!residuals(beside, later)) return false;
      beside[j] = y[j] - step;
      if (!residuals(beside, earlier)) return false;
      beside[j] = y[j];
      J.col(j) = (later - earlier) / (2.0 * step);
    }
    return true;
  }

  const Flows& flows_;
  const Window& window_;
  double jitter_;
  State start_;
  std::vector<ContactEvent> events_;
};

// Maximum of the density, searched from the true state, and a root of the covariance about it
// (Gauss-Newton). False if there is none.
bool find_top(Density& density, Eigen::VectorXd& y, Eigen::MatrixXd& root) {
  const Eigen::Index n = density.n();
  Eigen::VectorXd r(density.size()), other(density.size());
  Eigen::MatrixXd J(density.size(), n);
  y = density.truth();
  if (!density.residuals(y, r)) return false;
  for (int i = 0; i < most_iterations; ++i) {
    if (!density.derivatives(y, J)) return false;
    const CholeskyFactor information(product(J.transpose(), J));
    root = information.solve_L(Eigen::MatrixXd::Identity(n, n)).transpose();
    const Eigen::VectorXd step = -information.solve(J.transpose() * r);
    if ((J * step).norm() < converged) return true;
    double share = 1.0;
    int halvings = 0;
    for (; halvings < most_halvings; ++halvings, share *= 0.5) {
      const Eigen::VectorXd next = y + share * step;
      if (!density.residuals(next, other) || !(other.squaredNorm() < r.squaredNorm())) continue;
      y = next;
      r = other;
      break;
    }
    if (halvings == most_halvings) return true;
  }
  return true;
}

}  // namespace

std::optional<Moments> moments(const Flows& flows, const Window& window, double jitter, int steps,
                               std::uint64_t seed) {
  Density density(flows, window, jitter);
  const Eigen::Index n = density.n();
  Eigen::VectorXd y;
  Eigen::MatrixXd root;
  if (!find_top(density, y, root)) return {};
  root *= best_stride / std::sqrt(static_cast<double>(n));

  common::Random random(seed);
  Eigen::VectorXd r(density.size()), end(n), next(n), next_end(n), normal(n);
  if (!density.residuals(y, r, &end)) return {};
  double exponent = -0.5 * r.squaredNorm();
  const int first_counted = steps / 4;
  const int counted = steps - first_counted;
  int accepted = 0;
  // Sums of differences from the first draw, by halves, because sigma may be far below the state.
  const Eigen::VectorXd first = end;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(n, 2);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < steps; ++i) {
    for (double& one : normal) one = random.normal();
    next = y + root * normal;
    const double chance = std::log1p(-random.uniform());
    if (density.residuals(next, r, &next_end) && chance < -0.5 * r.squaredNorm() - exponent) {
      exponent = -0.5 * r.squaredNorm();
      std::swap(y, next);
      std::swap(end, next_end);
      accepted += i < first_counted ? 0 : 1;
    }
    if (i < first_counted) continue;
    sums.col(2 * (i - first_counted) < counted ? 0 : 1) += end - first;
    squares += (end - first).cwiseAbs2();
  }
  const Eigen::VectorXd mean = sums.rowwise().sum() / counted;
  const Eigen::VectorXd deviation =
      (squares / counted - mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd halves = (sums.col(0) - sums.col(1)) / (0.5 * counted);
  const bool settled = accepted > least_accepted * counted &&
                       (halves.cwiseAbs().array() < most_apart * deviation.array()).all();
  if (!settled) return {};
  return Moments{first + mean, deviation, static_cast<double>(accepted) / counted};
}

}  // namespace sprag::posterior
