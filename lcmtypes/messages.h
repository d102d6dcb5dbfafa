// Messages of the bus: the types that lcm-gen generates from sprag_*_t.lcm, with checks of what
// arrives. Senders are not authenticated, so any bytes may arrive.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <sprag/bounds_t.hpp>
#include <sprag/contacts_t.hpp>
#include <sprag/estimate_t.hpp>
#include <sprag/health_t.hpp>
#include <sprag/impact_t.hpp>
#include <sprag/input_t.hpp>
#include <sprag/outputs_t.hpp>
#include <sprag/parameters_t.hpp>
#include <sprag/prediction_t.hpp>
#include <sprag/state_t.hpp>
#include <vector>

#include "lcmtypes/refusal.h"

namespace sprag {

/// Values of health_t::master: none yet; its messages arrive; it is silent; its run has ended.
enum class MasterState : std::int8_t { awaited = 0, received = 1, silent = 2, ended = 3 };
/// Values of health_t::input: the excitation is not streamed; its samples arrive; none for a
/// second.
enum class InputState : std::int8_t { none = 0, received = 1, silent = 2 };
/// Values of health_t::estimate.
enum class EstimateSource : std::int8_t { none = 0, replica = 1, filter = 2, adaptive = 3 };

/// An array of a message.
inline Eigen::Map<const Eigen::VectorXd> as_vector(const std::vector<double>& values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

/// Encodes a message of one of the types above. The result is in `buffer`, which grows to the
/// largest message, and valid until the buffer is changed. Arrays must have their declared lengths.
template <class Message>
std::span<const std::uint8_t> encode(const Message& message, std::vector<std::uint8_t>& buffer);

/// Decodes a message that has been received. Returns Refusal::none, or why the bytes are refused;
/// `message` is unspecified then. Declared lengths are checked before anything is stored, so that
/// no allocation exceeds twice the size of the bytes; a reused `message` keeps its capacity. Not
/// for impact_t and prediction_t, which no program of Sprag receives.
template <class Message>
Refusal decode(std::span<const std::uint8_t> bytes, Message& message);

/// Checks the values of a decoded message; Refusal::none if they are possible.
///
/// 1 <= contacts <= 60; records <= records_total; sequence and records_total from 0 to 2^53; times
/// of records finite, ascending and >= 0; speed > 0, possibly infinite.
Refusal validate(const contacts_t& message);
/// 1 <= channels <= 8; 1 <= n <= total <= 2^53; n channels <= 150; sequence from 0 to 2^53; t0 and
/// the used values finite; dt > 0.
Refusal validate(const input_t& message);
/// f >= 1; tick and t >= 0; all numbers finite.
Refusal validate(const state_t& message);
/// The same; settled_tick >= -1; standard deviations of all coordinates or of none; these and the
/// bound >= 0, possibly infinite.
Refusal validate(const estimate_t& message);
/// At most 1000 names, of at most 255 bytes, in this type and the next two; tick and t >= 0; values
/// finite; standard deviations >= 0, possibly infinite.
Refusal validate(const outputs_t& message);
Refusal validate(const parameters_t& message);
/// Half-widths and the bound >= 0, possibly infinite.
Refusal validate(const bounds_t& message);
/// tick >= -1; t finite and >= 0, or -1; times and rates finite and >= 0, but the speed may be
/// infinite; counts >= 0; at most 64 causes, each of 1 to 63 printable ASCII characters.
Refusal validate(const health_t& message);

}  // namespace sprag
