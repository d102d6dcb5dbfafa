// What an observer with n modes can show of the tip of a machine with more, at best, where it is
// linear and told nothing but the times of contacts.
//
// Pulses that follow each other within half a period of the first mode that is left out are a
// cluster. Of the kept modes' error the covariance P follows a Riccati equation along a run:
//
//   flight   P -> F P F^T
//   pulse    w_n^T q_n + s + c + r = 0 is measured, r the gap of the modes that are left out
//   cluster  its impulse is k^T (q_n, u_n) + what the support's phase says + eta:
//            P -> J P J^T + b b^T var(eta),  J = I + b k^T,  b = M^-1 w_n
//
// with k and the variances of eta and r from the machine's own run, and the impulse as given at the
// cluster's first pulse. What the modes that are left out move the tip is added. r is neither new
// at each pulse nor the same at all of a cluster: the truth lies between these two.
#pragma once

#include <vector>

#include "sprag/contact_event.h"
#include "sprag/reduction.h"

namespace sprag::studies {

enum class LeftOutGap { new_at_each_pulse, same_in_a_cluster };

/// Root mean square of the tip's error [m] for t > `settled`, of a machine with one contact, in its
/// modes by ascending frequency, n of them kept. `events`: all of its run; `left_out_tip`: root
/// mean square of what the others move the tip.
double mode_limit(const ModalMachine& machine, const std::vector<ContactEvent>& events,
                  Eigen::Index n, double settled, double left_out_tip, LeftOutGap r);

}  // namespace sprag::studies
