// Members of the library's classes that are values in Python, and of all that they contain.
#pragma once

#include "lcmtypes/messages.h"
#include "python/src/values.h"
#include "sprag/beam.h"
#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/analysis/diagnosis.h"
#include "sprag/detail/estimates/predictor.h"
#include "sprag/detail/identification/request.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/identification.h"
#include "sprag/observer.h"
#include "sprag/reduction.h"
#include "sprag/scene.h"
#include "sprag/simulate.h"
#include "sprag/smoother.h"

namespace sprag {

// ---- scenes
SPRAG_MEMBERS(Harmonic, amplitude, frequency, phase)
SPRAG_MEMBERS(Force, direction, constant, harmonic, input)
SPRAG_MEMBERS(RestitutionCurve, slope, at, value)
SPRAG_MEMBERS(Contact, w, clearance, motion, restitution, replica_restitution, input, input_share,
              curve)
SPRAG_MEMBERS(Output, name, direction, velocity, unit)
SPRAG_MEMBERS(Model, M, C, K, forces, contacts, law, chatter_time, outputs)
SPRAG_MEMBERS(State, q, u)
SPRAG_MEMBERS(Beam, modes, length, bending_stiffness, mass_per_length, damping, damping_ratio)
SPRAG_MEMBERS(SampledInput::Settings, interpolation, outside, displacement, noise, name, gain,
              delay)
SPRAG_MEMBERS(ShakenFrame, influence, motion, force, on_ground, input)
SPRAG_MEMBERS(KeptModes, modes, Phi, to_kept, stiffness, C, K, given_w)
SPRAG_MEMBERS(ContactClock, offset, rate)
SPRAG_MEMBERS(Tolerance, time, restitution, stiffness, damping, force, clearance)
SPRAG_MEMBERS(Adaptation, free, within, walk)
SPRAG_MEMBERS(ParameterUncertainty, keys, sigma, correlation, consider)
SPRAG_MEMBERS(Prior, start, uncertainty, sigma, drift, jitter, confidence, tolerance, adaptation,
              parameters)
SPRAG_MEMBERS(Truth, start, given, release_penetration)
// Without the reader's remarks, which are about the text of a file.
inline auto members(Scene& scene) {
  auto& [name, model, beam, positions, frame, clock, kept, stream_duration, stream_unit, prior,
         truth, remarks] = scene;
  static_cast<void>(remarks);
  return std::tie(name, model, beam, positions, frame, clock, kept, stream_duration, stream_unit,
                  prior, truth);
}

// ---- runs
SPRAG_MEMBERS(ContactEvent, t, contact, kind)
SPRAG_MEMBERS(EventCounts, events, made_up, lost_records, skipped)
SPRAG_MEMBERS(Simulation, events, t, q, u)
SPRAG_MEMBERS(Inconsistency, t, contact, suspicion, square, known_loss)
SPRAG_MEMBERS(ParameterEstimates, keys, values, sigmas, accepted, known, identifications)
SPRAG_MEMBERS(Estimate, tick, t, q, u, closed, settled, of_filter, penetrating, sigma_q, sigma_u,
              sigma_gap, outputs, sigma_outputs, bound, bound_q, bound_gap, bound_outputs,
              parameters, inconsistencies, last)
SPRAG_MEMBERS(Estimates, t, q, u, sigma_q, sigma_u, sigma_gap, outputs, sigma_outputs, bound,
              bound_q, bound_gap, bound_outputs, of_filter, penetrating, keys, parameters,
              sigma_parameters, counts, inconsistencies)
SPRAG_MEMBERS(SmoothedStretch, from, to, events, misfit)
SPRAG_MEMBERS(PredictedEvent, t, contact, kind, sigma)
SPRAG_MEMBERS(Prediction, made_at, certain_until, events)

// ---- estimates from the bus
SPRAG_MEMBERS(estimate_t, session, utime, tick, t, f, q, u, closed, settled_tick, estimators,
              from_filter, bound, deviations, sigma_q, sigma_u, gaps, sigma_g, closing,
              closing_contact, replica_gap, filter_gap, sigma_filter_gap, inconsistencies,
              suspect_t, suspect_contact, suspicion)

// ---- assessments
SPRAG_MEMBERS(Finding, id, required, holds, what, change, provided)

// ---- parameters
SPRAG_MEMBERS(Parameter, key, unit, nominal, within, logarithmic, unit_step, relative, reach,
              lower_limit, upper_limit)
SPRAG_MEMBERS(Candidate, parameter, determined, value, deviation, sensitivity, scatter, misfit,
              gain, explained, fits, improved_by)
SPRAG_MEMBERS(MissingImpact, t, contact)
SPRAG_MEMBERS(Diagnosis, scene, closings, from, to, jitter, resolved, scatter, misfit,
              largest_misfit, common_scatter, misfit_before, unsure, fits, candidates, missing,
              spurious, rate_ambiguity, has_record, only_frequency)
SPRAG_MEMBERS(FittedUnknown, unknown, value, sigma, determined, low, high, at_bound, partner,
              correlation, of_record)
SPRAG_MEMBERS(ClockAmbiguity, key, equals)
SPRAG_MEMBERS(Combination, weights, sigma)
SPRAG_MEMBERS(EventResidual, t, contact, event, residual, sigma, closes)
SPRAG_MEMBERS(DriftEstimate, drift, jitter, low, high, gain, changes, sigmas)
SPRAG_MEMBERS(RestitutionScatter, scatter, jitter, gain, changes, sigmas)
SPRAG_MEMBERS(RestitutionTrend, trend, sigma, chi2_without, chi2_with, gain)
SPRAG_MEMBERS(Departure, cause, drift, scatter, trend)
SPRAG_MEMBERS(RecordErrors, noise, resolution, start, noise_scatter, resolution_scatter,
              other_scatter)
SPRAG_MEMBERS(Explanation, keys, fit)
SPRAG_MEMBERS(Explanations, simplest)
SPRAG_MEMBERS(Identification, problem, misfit, culprit, unknowns, ambiguities, combinations, fitted,
              jitter, jitter_given, scatter, chi2, largest_chi2, freedom, impacts, stretches,
              events, left_out, spurious_left_out, from, to, interval, predicted, predicted_before,
              start, start_sigma, start_t, begins, inside_from, inside_to, spurious, missing,
              covariance, residuals, departure, record_errors, others)
SPRAG_MEMBERS(IdentifyResult, scene, fit, accepted, asked_for_causes, causes, held, events)

}  // namespace sprag
