// The messages of an observer, from its estimates, impacts and predictions.
#pragma once

#include <cstdint>
#include <span>

#include "lcmtypes/messages.h"
#include "observer/estimate_sample.h"
#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/estimates/predictor.h"
#include "sprag/model.h"

namespace sprag {

/// Each function sets all fields of a message. A reused message allocates only where it grows.
/// `outputs` are those of the estimated model.
void fill(estimate_t& message, const EstimateSample& sample);
void fill(outputs_t& message, const EstimateSample& sample, bool settled,
          std::span<const Output> outputs);
void fill(bounds_t& message, const EstimateSample& sample, std::span<const Output> outputs);
/// The estimate must have parameters (ParameterEstimates::any).
void fill(parameters_t& message, const EstimateSample& sample);
/// `session`: the master's; `utime`: wall clock at send [us].
void fill(impact_t& message, const ImpactRecord& record, std::int64_t session, std::int64_t utime);
void fill(prediction_t& message, const Prediction& prediction, std::int64_t session,
          std::int64_t utime);

}  // namespace sprag
