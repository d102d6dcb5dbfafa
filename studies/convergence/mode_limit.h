// Lower limit of the tip's error of an observer with n modes of a machine with more modes, if the
// observer is linear and receives only contact times.
//
// Pulses that follow each other within half a period of the first omitted mode are a cluster. The
// covariance P of the kept modes' error follows a Riccati equation along a run:
//
//   flight   P -> F P F^T
//   pulse    w_n^T q_n + s + c + r = 0 is measured, r the gap contribution of the omitted modes
//   cluster  its impulse is k^T (q_n, u_n) + a function of the support's phase + eta:
//            P -> J P J^T + b b^T var(eta),  J = I + b k^T,  b = M^-1 w_n
//
// with k and the variances of eta and r from the machine's own run, and the impulse acting at the
// cluster's first pulse. The tip motion of the omitted modes is added. r is neither independent at
// each pulse nor constant over a cluster: the truth lies between these two cases.
#pragma once

#include <vector>

#include "sprag/contact_event.h"
#include "sprag/reduction.h"

namespace sprag::studies {

enum class LeftOutGap { new_at_each_pulse, same_in_a_cluster };

/// Root mean square of the tip's error [m] for t > `settled`, of a machine with one contact, in its
/// modes by ascending frequency, n of them kept. `events`: all events of its run; `left_out_tip`:
/// root mean square of the tip motion of the omitted modes.
double mode_limit(const ModalMachine& machine, const std::vector<ContactEvent>& events,
                  Eigen::Index n, double settled, double left_out_tip, LeftOutGap r);

}  // namespace sprag::studies
