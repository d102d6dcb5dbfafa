// Lyapunov exponents of a machine that is driven with the period T: how fast differences between
// its motion and motions infinitely close to it grow, from the variational equations with
// saltation at events (variation.h). Grazing impacts excluded.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/master.h"

namespace sprag {

/// Impacts that come no later than this share of the period after an instant of the stroboscope
/// count as before it: of an orbit that is hit at these very instants, rounding would else decide.
inline constexpr double same_instant = 1e-9;

/// k T and that share of T.
Instant stroboscope_instant(long k, double T);

/// What one period makes of the differences of the instants k T and l T, as (q, u / Omega), Omega =
/// 2 pi / T: the monodromy matrix, 2f x 2f, for l - k periods of the motion. The master must have
/// been advanced to stroboscope_instant(k, T); it is at that of l then. `events` takes those of the
/// last period. Throws as Master::advance and Variation::set.
Eigen::MatrixXd monodromy(Master& master, double T, long k, long l,
                          std::vector<ContactEvent>& events);

/// Largest |eigenvalue| of a square matrix, by Gelfand's formula |A^n|^(1/n), n = 2^k.
double spectral_radius(Eigen::MatrixXd A);

/// Largest exponent [1 / unit of time] over the periods k to l of a motion, from one difference
/// that is brought back to length 1 each period (Benettin et al., Meccanica 15, 1980); the first
/// tenth of them only turns it. For a motion that does not repeat; that of n periods is right to
/// about 1 / (n T) where it is regular, to 1 / (sqrt(n) T) where it is chaotic. Master and errors
/// as of monodromy. -infinity where impacts forget every difference.
double largest_exponent(Master& master, double T, long k, long l,
                        std::vector<ContactEvent>& events);

}  // namespace sprag
