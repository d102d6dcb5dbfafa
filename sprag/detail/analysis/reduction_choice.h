// Chooses the correction (reduction.h) for a machine of which some modes are kept, from contact
// events alone. A replica of the reduced machine follows the events. At the times t_k at which
// contacts close, its own gap g(t_k) should be zero, and the correction with the smallest root mean
// square of g(t_k) is chosen. Each g(t_k) is weighted by the time since the previous closing:
// the bounces of a chatter are most of all closings but carry little information.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/reduction.h"

namespace sprag {

/// Contact events since t = begins [s], in order, and how a replica follows them.
struct Followed {
  std::span<const ContactEvent> events;
  double begins = 0.0;
  ContactSet closed = 0;  ///< at `begins`
  double counts = 0.0;    ///< closings from this time on are counted [s]
  State ModalMachine::*start = &ModalMachine::replica;  ///< initial state of the replica
};

/// Counts the second half of the time, since the replica converges to the machine first. Throws
/// Error if contacts close fewer than 8 times in it.
Followed second_half(std::span<const ContactEvent> events, double begins = 0.0,
                     ContactSet closed = 0);

/// Number of instants from `counts` on at which contacts close.
int closings(const Followed& followed);

/// Root mean square of g(t_k) [m] over the instants at which contacts close; infinity if the
/// machine has no flow or no contact closes.
double rms_gap(const ModalMachine& machine, const Followed& followed);

struct Reduction {
  std::string correction = {};           ///< as text: "b_0, b_1", "restitution 0.1", ...; "none"
  int modes = 0;                         ///< number of kept modes
  std::vector<int> static_vectors = {};  ///< j of b_j
  double least_zeta = 0.0;               ///< smallest damping ratio of the static vectors
  std::optional<double> share = {};      ///< impulse share x of an effective restitution
  double rms = 0.0;                      ///< of g(t_k) [m]
  ModalMachine machine = {};
};

/// The machine without a correction, and with each set of static vectors that is tried: {b_0},
/// {b_0, b_1}, {b_1 .. b_3}, {b_0 .. b_3}, and these with a damping ratio of at least 5 % if that
/// changes them. Sets that do not exist, or with which some contact has no direction, are omitted.
/// `rms` is not computed.
std::vector<Reduction> candidates(const ModalMachine& machine,
                                  const std::vector<Eigen::Index>& kept);

/// The effective restitution with the smallest rms, x in [0.5, 1]. None if more than 10 modes are
/// kept, since it never reduced the error there. None if all omitted modes are damped by 5 % or
/// more: static vectors are right then, and for an orbit with one impact per period any x fits.
std::optional<Reduction> fitted_restitution(const ModalMachine& machine,
                                            const std::vector<Eigen::Index>& kept,
                                            const Followed& followed);

/// Description for users: meaning of the coordinates of the reduced scene, and the observed
/// quantity in terms of them. The last line has no end of line.
std::string description(const Scene& scene, const Reduction& reduction);

/// All candidates and the fitted restitution by ascending rms: the first is the best. Empty if some
/// contact has no direction in the kept modes.
std::vector<Reduction> reductions(const ModalMachine& machine,
                                  const std::vector<Eigen::Index>& kept, const Followed& followed);

}  // namespace sprag
