// Pairs the states of a master with the estimates of an observer and computes the synchronization
// error energy V and its parts V_i, eqs. (23) and (24) of Baumann & Leine 2014. Independent of the
// transport.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "lcmtypes/messages.h"
#include "sprag/energy.h"

namespace sprag {

/// V and its parts at one instant.
struct SyncRow {
  std::int64_t k = 0;      ///< the estimate's tick
  double t = 0.0;          ///< the estimate's time [s]
  Eigen::VectorXd energy;  ///< V, V_1, ..., V_f
};

struct SyncFigures {
  std::int64_t rows = 0;
  std::int64_t sessions = 0;           ///< number of masters
  double first_t = 0.0, last_t = 0.0;  ///< of the first and the last row [s]
  double first_v = 0.0, last_v = 0.0;
  double max_growth = 0.0;               ///< largest increase of V between rows of a session
  double max_growth_t = 0.0;             ///< its time [s]
  std::int64_t unpaired_truth = 0;       ///< states discarded without an estimate
  std::int64_t unpaired_estimate = 0;    ///< estimates discarded without a state
  std::int64_t doubled = 0;              ///< repeated instants of one side
  std::int64_t late = 0;                 ///< at or before the last row: repeated or out of order
  std::int64_t old_session = 0;          ///< of an earlier master
  std::int64_t wrong_truth_size = 0;     ///< states whose f is not the scene's
  std::int64_t wrong_estimate_size = 0;  ///< estimates whose f is above the scene's
};

class Pairing {
 public:
  /// Keeps at most `window` unpaired samples of each side. Throws ModelError.
  explicit Pairing(const Model& model, std::size_t window = 200000);

  /// Adds a sample. If the other side's sample of the same instant is present, returns the row,
  /// valid until the next call. The instant is the same if session and time agree, the time to a
  /// relative 1e-9; ticks may differ. Rows have ascending t. Only a state can begin a new session,
  /// with which the rows start again.
  const SyncRow* add_truth(const state_t& truth);
  const SyncRow* add_estimate(const estimate_t& estimate);

  const SyncFigures& figures() const { return figures_; }

  /// The session being paired; nullopt before the first state.
  std::optional<std::int64_t> session() const { return session_; }

  /// Number of samples that wait for the other side.
  std::size_t waiting_truth() const { return truth_.size(); }
  std::size_t waiting_estimate() const { return estimate_.size() + early_.size(); }

 private:
  struct Sample {
    std::int64_t tick = 0;
    Eigen::VectorXd q, u;
  };
  using Side = std::map<double, Sample>;  // by time

  template <class Message>
  static Sample sample_of(const Message& message);
  template <class Message>
  const SyncRow* pair(const Message& message, Side& own, Side& other);
  void keep(double t, Sample sample, Side& side);
  void drop(Side& side, Side::iterator end);
  const SyncRow* make_row(const Sample& truth, double t, const Sample& estimate);
  void begin_session(std::int64_t session);
  bool is_old(std::int64_t session) const;
  std::int64_t& unpaired(const Side& side);

  ErrorEnergy energy_;
  Eigen::Index coordinates_;
  std::size_t window_;
  SyncRow row_;
  SyncFigures figures_;
  std::optional<std::int64_t> session_;
  std::deque<std::int64_t> old_sessions_;
  Side truth_, estimate_;
  Side early_;  // estimates of a session whose first state has not arrived
  std::int64_t early_session_ = 0;
  std::optional<double> last_t_;  // of the last row of this session
  double last_v_ = 0.0;
};

/// Rows, sessions, t, V and unpaired samples, for a report. Samples that still wait count as
/// unpaired.
nlohmann::ordered_json to_json(const Pairing& pairing);

}  // namespace sprag
