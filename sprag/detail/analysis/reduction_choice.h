// Which correction (reduction.h) suits a machine of which some modes are kept, told by contact
// events alone: a replica of the reduced machine follows them, and its own gap g(t_k) at the times
// t_k at which contacts close is zero where it is right. The correction with the smallest root mean
// square is taken. Each g(t_k) is weighted by the time since the closing before: the bounces of a
// chatter say next to nothing, and are most of all closings.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/reduction.h"

namespace sprag {

/// Contact events, all since t = begins [s], in order, and what follows them.
struct Followed {
  std::span<const ContactEvent> events;
  double begins = 0.0;
  ContactSet closed = 0;                                ///< at `begins`
  double counts = 0.0;                                  ///< closings from this time on do [s]
  State ModalMachine::*start = &ModalMachine::replica;  ///< where the replica begins
};

/// The second half of the time counts: the replica comes to the machine first. Throws
/// std::runtime_error if contacts close fewer than 8 times in it.
Followed second_half(std::span<const ContactEvent> events, double begins = 0.0,
                     ContactSet closed = 0);

/// Instants from `counts` on at which contacts close.
int closings(const Followed& followed);

/// Root mean square of g(t_k) [m] over the instants at which contacts close; infinity where the
/// machine has no flow, or there are none.
double rms_gap(const ModalMachine& machine, const Followed& followed);

struct Reduction {
  std::string correction = {};           ///< in words: "b_0, b_1", "restitution 0.1", ...; "none"
  int modes = 0;                         ///< that are kept
  std::vector<int> static_vectors = {};  ///< j of b_j
  double least_zeta = 0.0;               ///< of the static vectors' damping
  std::optional<double> share = {};      ///< x of an effective restitution
  double rms = 0.0;                      ///< of g(t_k) [m]
  ModalMachine machine = {};
};

/// One without a correction, and all sets of static vectors that are tried: {b_0}, {b_0, b_1},
/// {b_1 .. b_3}, {b_0 .. b_3}, and these with a damping ratio of 5 % or more where that changes
/// them. What the machine does not have, or what does not see every contact, is left out. `rms` is
/// not known yet.
std::vector<Reduction> candidates(const ModalMachine& machine,
                                  const std::vector<Eigen::Index>& kept);

/// The effective restitution with the smallest rms, x in [0.5, 1]; none where more than 10 modes
/// are kept, since nothing was ever won there, or all that are left out are damped by 5 % or more:
/// static vectors are right then, and a machine on an orbit with one impact a period lets any x
/// fit.
std::optional<Reduction> fitted_restitution(const ModalMachine& machine,
                                            const std::vector<Eigen::Index>& kept,
                                            const Followed& followed);

/// For people: what the coordinates of the reduced scene are, and how they show what is observed.
/// Lines without an end.
std::string description(const Scene& scene, const Reduction& reduction);

/// All of them, by ascending rms: the first is the one to take. Empty where the modes that are kept
/// do not see every contact.
std::vector<Reduction> reductions(const ModalMachine& machine,
                                  const std::vector<Eigen::Index>& kept, const Followed& followed);

}  // namespace sprag
