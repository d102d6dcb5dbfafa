// The exact posterior of a machine's state, given the reported times of its impacts: the belief of
// an exact filter. With a Gaussian N(m, R^T R) for the state x at the begin of a window, and
// impacts in it reported at t_k with t_k - t_k(x) ~ N(0, sigma^2), t_k(x) those of the master from
// x on, x has the density
//
//   p(x) ~ exp(-|R^-T (x - m)|^2 / 2 - sum_k (t_k - t_k(x))^2 / (2 sigma^2)),
//
// where the master has the same sequence of impacts, and zero elsewhere. A random walk (Metropolis
// 1953) draws from it; the master propagates each draw to the window's end. After the begin the
// computation uses no Gaussian, no linearization and no code of the filter.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/flows.h"

namespace sprag::posterior {

struct Window {
  double begin, end;  ///< [s]; no contact is closed at the begin
  // Of (q, u) at the begin, 2 f entries.
  Eigen::VectorXd x;                 ///< the true state
  Eigen::VectorXd mean;              ///< m
  Eigen::MatrixXd root;              ///< R, upper triangular
  std::vector<ContactEvent> events;  ///< the true ones
  std::vector<double> reported;      ///< times of their reports [s]
};

/// Of (q, u) at the window's end, 2 f entries each.
struct Moments {
  Eigen::VectorXd mean, deviation;
  double accepted = 0.0;  ///< share of accepted steps
};

/// By a random walk of `steps` steps, whose first quarter is discarded, with draws of `seed`. Empty
/// if the master's event sequence differs at or near the true state, and if the walk does not
/// converge. jitter > 0 [s].
std::optional<Moments> moments(const Flows& flows, const Window& window, double jitter, int steps,
                               std::uint64_t seed);

}  // namespace sprag::posterior
