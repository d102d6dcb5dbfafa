#include "tools/sync_logger/logger.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

namespace sprag {

namespace {

constexpr double same_instant = 1e-9;  // relative
constexpr std::size_t remembered_sessions = 64;

/// The sample nearest to t if it is of the same instant, else end().
template <class Side>
typename Side::iterator find_instant(Side& side, double t) {
  auto nearest = side.lower_bound(t);
  if (nearest != side.begin()) {
    const auto before = std::prev(nearest);
    if (nearest == side.end() || t - before->first < nearest->first - t) nearest = before;
  }
  if (nearest == side.end() || std::abs(nearest->first - t) > same_instant * std::abs(t))
    return side.end();
  return nearest;
}

}  // namespace

template <class Message>
Pairing::Sample Pairing::sample_of(const Message& message) {
  return {message.tick, as_vector(message.q), as_vector(message.u)};
}

Pairing::Pairing(const Model& model, std::size_t window)
    : energy_(model), coordinates_(model.coordinates()), window_(window) {}

const SyncRow* Pairing::add_truth(const state_t& truth) {
  if (truth.f != coordinates_) {
    ++figures_.wrong_truth_size;
    return nullptr;
  }
  if (is_old(truth.session)) {
    ++figures_.old_session;
    return nullptr;
  }
  if (session_ != truth.session) begin_session(truth.session);
  return pair(truth, truth_, estimate_);
}

const SyncRow* Pairing::add_estimate(const estimate_t& estimate) {
  if (estimate.f > coordinates_) {
    ++figures_.wrong_estimate_size;
    return nullptr;
  }
  if (is_old(estimate.session)) {
    ++figures_.old_session;
    return nullptr;
  }
  if (session_ == estimate.session) return pair(estimate, estimate_, truth_);
  if (early_session_ != estimate.session) drop(early_, early_.end());
  early_session_ = estimate.session;
  keep(estimate.t, sample_of(estimate), early_);
  return nullptr;
}

template <class Message>
const SyncRow* Pairing::pair(const Message& message, Side& own, Side& other) {
  if (last_t_ && message.t <= *last_t_ * (1.0 + same_instant)) {
    ++figures_.late;
    return nullptr;
  }
  const auto match = find_instant(other, message.t);
  if (match == other.end()) {
    keep(message.t, sample_of(message), own);
    return nullptr;
  }
  const Sample here = sample_of(message);
  const bool is_truth = &own == &truth_;
  const double t = is_truth ? match->first : message.t;
  const SyncRow* row =
      is_truth ? make_row(here, t, match->second) : make_row(match->second, t, here);
  // Rows have ascending t, so earlier samples cannot be paired any more.
  const auto after = other.erase(match);
  drop(other, after);
  drop(own, own.upper_bound(t));
  return row;
}

void Pairing::keep(double t, Sample sample, Side& side) {
  if (!side.try_emplace(t, std::move(sample)).second) ++figures_.doubled;
  if (side.size() > window_) drop(side, std::next(side.begin()));
}

void Pairing::drop(Side& side, Side::iterator end) {
  unpaired(side) += std::distance(side.begin(), end);
  side.erase(side.begin(), end);
}

std::int64_t& Pairing::unpaired(const Side& side) {
  return &side == &truth_ ? figures_.unpaired_truth : figures_.unpaired_estimate;
}

const SyncRow* Pairing::make_row(const Sample& truth, double t, const Sample& estimate) {
  row_.k = estimate.tick;
  row_.t = t;
  row_.energy = energy_(truth.q, truth.u, estimate.q, estimate.u);
  const double v = row_.energy[0];
  if (figures_.rows == 0) {
    figures_.first_t = t;
    figures_.first_v = v;
  }
  if (last_t_ && v - last_v_ > figures_.max_growth) {
    figures_.max_growth = v - last_v_;
    figures_.max_growth_t = t;
  }
  ++figures_.rows;
  figures_.last_t = t;
  figures_.last_v = v;
  last_t_ = t;
  last_v_ = v;
  return &row_;
}

void Pairing::begin_session(std::int64_t session) {
  if (session_) {
    old_sessions_.push_back(*session_);
    if (old_sessions_.size() > remembered_sessions) old_sessions_.pop_front();
  }
  ++figures_.sessions;
  session_ = session;
  last_t_.reset();
  drop(truth_, truth_.end());
  drop(estimate_, estimate_.end());
  if (early_session_ == session) estimate_.swap(early_);
}

bool Pairing::is_old(std::int64_t session) const {
  return std::find(old_sessions_.begin(), old_sessions_.end(), session) != old_sessions_.end();
}

nlohmann::ordered_json to_json(const Pairing& pairing) {
  const SyncFigures& figures = pairing.figures();
  nlohmann::ordered_json json{{"rows", figures.rows}, {"sessions", figures.sessions}};
  if (figures.rows > 0) {
    json["t"] = {{"first", figures.first_t}, {"last", figures.last_t}};
    json["V"] = {{"first", figures.first_v},
                 {"last", figures.last_v},
                 {"max_growth", figures.max_growth},
                 {"max_growth_t", figures.max_growth_t}};
  }
  json["unpaired"] = {
      {"truth", figures.unpaired_truth + static_cast<std::int64_t>(pairing.waiting_truth())},
      {"estimate",
       figures.unpaired_estimate + static_cast<std::int64_t>(pairing.waiting_estimate())}};
  json["ignored"] = {{"doubled", figures.doubled},
                     {"late", figures.late},
                     {"old_session", figures.old_session},
                     {"wrong_truth_size", figures.wrong_truth_size},
                     {"wrong_estimate_size", figures.wrong_estimate_size}};
  return json;
}

}  // namespace sprag
