// Lyapunov exponents of a machine driven with the period T: growth rates of infinitesimal
// differences to its motion, from the variational equations with saltation matrices at events
// (variation.h). Not valid at grazing impacts.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/master.h"

namespace sprag {

/// Impacts that follow an instant of the stroboscope by at most this fraction of the period count
/// as before it. Otherwise rounding would decide for an orbit with impacts at these instants.
inline constexpr double same_instant = 1e-9;

/// The instant k T, later by same_instant T.
Instant stroboscope_instant(long k, double T);

/// Monodromy matrix, 2f x 2f: the linear map of differences (q, u / Omega), Omega = 2 pi / T, from
/// the instant k T to l T of the motion. The master must have been advanced to
/// stroboscope_instant(k, T); it is at that of l afterwards. `events` receives those of the last
/// period. Throws as Master::advance and Variation::set.
Eigen::MatrixXd monodromy(Master& master, double T, long k, long l,
                          std::vector<ContactEvent>& events);

/// Largest |eigenvalue| of a square matrix.
double spectral_radius(const Eigen::MatrixXd& A);

/// Largest exponent [1 / unit of time] over the periods k to l of a motion, from one difference
/// that is normalized each period (Benettin et al., Meccanica 15, 1980). The first tenth of the
/// periods only aligns the difference. Meant for a motion that does not repeat. Over n periods the
/// error is about 1 / (n T) for a regular motion and 1 / (sqrt(n) T) for a chaotic one. Master and
/// errors as for monodromy(). -infinity if impacts remove every difference.
double largest_exponent(Master& master, double T, long k, long l,
                        std::vector<ContactEvent>& events);

}  // namespace sprag
