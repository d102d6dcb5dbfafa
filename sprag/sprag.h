/// \file
/// \brief Includes all public headers.
///
/// Each header directly in sprag/ belongs to the public interface. Headers in sprag/detail/ may
/// change with any version. sprag/impacts.h and sprag/prediction.h need the library
/// sprag::analysis, all others sprag::sprag. Contacts and all other indices are counted from 0.
#pragma once

#include "sprag/beam.h"
#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/energy.h"
#include "sprag/error.h"
#include "sprag/events_file.h"
#include "sprag/identification.h"
#include "sprag/impacts.h"
#include "sprag/model.h"
#include "sprag/observer.h"
#include "sprag/parameter.h"
#include "sprag/prediction.h"
#include "sprag/reduction.h"
#include "sprag/sampled_input.h"
#include "sprag/scene.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "sprag/smoother.h"
#include "sprag/version.h"

/// \namespace sprag
/// \brief State observer for machines with impacts.
