// Programs of other projects: each function is a Method::run (studies/work_precision/method.h).
#pragma once

#include "studies/work_precision/method.h"

namespace sprag::work_precision {

// siconos.cpp
void run_siconos_moreau_jean(const Task& task, double setting, Outcome& outcome);
void run_siconos_bilbao(const Task& task, double setting, Outcome& outcome);
void run_siconos_event_driven(const Task& task, double setting, Outcome& outcome);

// mujoco.cpp
void run_mujoco(const Task& task, double setting, Outcome& outcome);

// cvode.cpp; setting: tolerance, absolute and relative
void run_cvode_adams(const Task& task, double tolerance, Outcome& outcome);
void run_cvode_bdf(const Task& task, double tolerance, Outcome& outcome);

}  // namespace sprag::work_precision
