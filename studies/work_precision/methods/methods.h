// The methods of the comparison, each in the file of its name. All have the signature of
// Method::run.
#pragma once

#include "studies/work_precision/method.h"

namespace sprag::work_precision {

// exact.cpp; setting: unused
void run_exact(const Task& task, double setting, Outcome& outcome);
// moreau_jean.cpp; setting: h [s]. theta = 1/2 and theta = 1.
void run_moreau_jean(const Task& task, double h, Outcome& outcome);
void run_moreau_jean_implicit(const Task& task, double h, Outcome& outcome);
// generalized_alpha.cpp; setting: h [s]
void run_generalized_alpha(const Task& task, double h, Outcome& outcome);
// odeint.cpp; setting: tolerance, absolute and relative
void run_odeint(const Task& task, double tolerance, Outcome& outcome);
// rk4.cpp; setting: h [s]
void run_rk4(const Task& task, double h, Outcome& outcome);
// penalty.cpp; setting: k [N/m]
void run_penalty(const Task& task, double k, Outcome& outcome);

}  // namespace sprag::work_precision
