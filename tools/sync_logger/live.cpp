#include "tools/sync_logger/live.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "command_line/program.h"
#include "lcmtypes/bus.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/freshness.h"
#include "lcmtypes/messages.h"
#include "tools/sync_logger/logger.h"
#include "tools/sync_logger/losses.h"
#include "tools/sync_logger/sync_file.h"

namespace sprag {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto silence = 100ms;           // ten heartbeats
constexpr std::size_t enough_states = 3;  // required to follow another master
constexpr std::size_t most_held = 10000;
constexpr auto patience = 3s;  // waiting time for the missing half of the last row

constexpr std::array<std::pair<Losses::Channel, const char*>, Losses::channels> numbered_channels{
    {{Losses::Channel::contacts, contacts_channel},
     {Losses::Channel::settled, settled_channel},
     {Losses::Channel::truth, truth_channel}}};

/// Number of unpaired samples of f coordinates to keep: at most 64 MiB.
std::size_t window_for(Eigen::Index coordinates) {
  const auto bytes = static_cast<std::size_t>(16 * coordinates + 160);
  return std::clamp<std::size_t>((64U << 20U) / bytes, 1000, 200000);
}

/// Detects the end of the run: the last row before `duration`, for any step.
class Finish {
 public:
  explicit Finish(double duration) : duration_(duration) {}

  void restart() { *this = Finish(duration_); }

  void row(double t) {
    if (last_t_) step_ = std::min(step_, t - *last_t_);
    last_t_ = t;
    paired_ = paired_ || is_last(t);
  }
  void sample(double t, Clock::time_point now) {
    received_ = now;
    seen_ = seen_ || is_last(t);
  }

  bool paired() const { return paired_; }

  /// The last instant has arrived from one side only, and nothing more arrives.
  bool lost(Clock::time_point now) const { return seen_ && now - received_ > patience; }

 private:
  bool is_last(double t) const {
    const double slack = 1e-9 * duration_;
    return t >= duration_ - slack || (std::isfinite(step_) && t + step_ > duration_ + slack);
  }

  double duration_;
  double step_ = std::numeric_limits<double>::infinity();
  std::optional<double> last_t_;
  bool paired_ = false, seen_ = false;
  Clock::time_point received_;
};

class Live {
 public:
  Live(const Model& model, const LiveOptions& options, const CommonOptions& common)
      : bus_(common.url, key_of(common)),
        pairing_(model, window_for(model.coordinates())),
        csv_(options.csv, model.coordinates()),
        record_name_(options.record.string()),
        coordinates_(model.coordinates()),
        to_stdout_(options.csv.empty()),
        freshness_(common.key.empty() ? Freshness::any : Freshness::required),
        finish_(options.duration) {
    if (options.now) {
      now_pairing_.emplace(model, window_for(model.coordinates()));
      now_csv_.emplace(now_file(options.csv), model.coordinates());
    }
    if (!options.record.empty()) record_.emplace(options.record);
    check_files();
    const auto handler = [this](std::string_view channel, std::span<const std::uint8_t> data,
                                std::int64_t utime) { receive(channel, data, utime); };
    if (record_) {
      bus_.subscribe_prefix("SPRAG_", handler);
    } else {
      bus_.subscribe(truth_channel, handler);
      bus_.subscribe(settled_channel, handler);
      if (now_pairing_) bus_.subscribe(estimate_channel, handler);
    }
    std::cerr << "listening on " << common.url << '\n';
  }

  void run() {
    auto next_progress = Clock::now() + 1s;
    while (!stop_requested() && !finish_.paired() && !received_in_vain()) {
      bus_.handle(100ms);
      report_failures();
      if (to_stdout_) csv_.flush();
      const auto now = Clock::now();
      if (now >= next_loss_line_) report_losses(now);
      follow_the_other(now);
      if (finish_.lost(now)) {
        std::cerr << "the last row did not come: its truth or its estimate was lost\n";
        break;
      }
      if (now >= next_progress) {
        progress();
        next_progress = now + 1s;
      }
    }
  }

  /// Closes the files and fills the report. Returns the exit code.
  int close(nlohmann::ordered_json& report) {
    report_losses(Clock::now());
    if (last_word_) write_now(now_pairing_->add_estimate(*last_word_));
    csv_.close();
    if (now_csv_) now_csv_->close();
    if (record_) record_->close();
    report.update(to_json(pairing_));
    if (now_pairing_) report["now"] = to_json(*now_pairing_);
    report["refused"] = refusals(refused_, bus_.counts());
    report["overflowed"] = bus_.counts().overflowed;
    for (const auto& [channel, name] : numbered_channels) {
      report["lost"][name] = losses_.missing(channel);
    }
    report["of_other_masters"] = of_other_masters_;
    report["stale"] = stale_;
    check_files();
    return record_ && !lost().empty() ? exit_failed : exit_done;
  }

 private:
  void receive(std::string_view channel, std::span<const std::uint8_t> data, std::int64_t utime) {
    if (record_) {
      record_->write(utime, channel, bus_.as_sent(data));
      if (channel == contacts_channel && decode(data, contacts_) == Refusal::none) {
        note(Losses::Channel::contacts, contacts_.session, contacts_.sequence);
      }
    }
    if (finish_.paired()) return;
    if (channel == truth_channel) {
      if (!accepted(decode(data, state_))) return;
      note(Losses::Channel::truth, state_.session, state_.tick);
      truth(utime);
    } else if (channel == settled_channel) {
      if (!accepted(decode(data, estimate_))) return;
      note(Losses::Channel::settled, estimate_.session, estimate_.tick);
      settled();
    } else if (channel == estimate_channel && now_pairing_) {
      if (accepted(decode(data, estimate_))) estimate_for_now();
    }
  }

  void note(Losses::Channel channel, std::int64_t session, std::int64_t number) {
    losses_.take(channel, bus_.sender(), session, number);
  }

  bool accepted(Refusal refusal) {
    ++refused_[static_cast<std::size_t>(refusal)];
    return refusal == Refusal::none;
  }

  void truth(std::int64_t arrival) {
    if (state_.f != coordinates_ && !warned_) {
      std::cerr << "the master has " << state_.f << " coordinates, the scene has " << coordinates_
                << ": its states are refused\n";
      warned_ = true;
    }
    const bool is_another = pairing_.session() != state_.session;
    if (is_another && !freshness_.allows(state_.utime, arrival)) {
      if (stale_++ == 0) {
        std::cerr
            << "the messages of a master are refused: they are recordings, or its clock is more "
               "than 10 s off\n";
      }
      return;
    }
    const auto now = Clock::now();
    if (pairing_.session() && is_another) {
      another_master(now);
    } else {
      drop_held();
      truth_received_ = now;
      freshness_.note(state_.utime);
      pair(state_);
    }
  }

  // Another session: a restarted or a second master. Its states wait until the first is silent.
  void another_master(Clock::time_point now) {
    if (!held_.empty() && held_.front().session != state_.session) drop_held();
    if (held_.size() < most_held) held_.push_back(state_);
    follow_the_other(now);
  }

  void drop_held() {
    of_other_masters_ += static_cast<std::int64_t>(held_.size());
    held_.clear();
  }

  void follow_the_other(Clock::time_point now) {
    const auto silent = now - truth_received_;
    if (held_.empty() || silent < silence) return;
    // Few states may come from any sender. They are accepted if the first master stays silent for
    // 1 s.
    if (held_.size() < enough_states && silent < 10 * silence) return;
    truth_received_ = now;
    for (const state_t& state : std::exchange(held_, {})) {
      if (finish_.paired()) return;
      freshness_.note(state.utime);
      pair(state);
    }
  }

  void pair(const state_t& state) {
    const std::int64_t sessions = pairing_.figures().sessions;
    const SyncRow* row = pairing_.add_truth(state);
    if (pairing_.figures().sessions > sessions) {
      if (sessions > 0) std::cerr << "new session: the master was restarted\n";
      finish_.restart();
    }
    settled_row(row, state.session, state.t);
    if (now_pairing_) write_now(now_pairing_->add_truth(state));
  }

  void settled() {
    if (estimate_.f > coordinates_ && !warned_) {
      std::cerr << "the replica has " << estimate_.f << " coordinates, the scene has "
                << coordinates_ << ": its estimates are refused\n";
      warned_ = true;
    }
    settled_row(pairing_.add_estimate(estimate_), estimate_.session, estimate_.t);
  }

  void settled_row(const SyncRow* row, std::int64_t session, double t) {
    if (row != nullptr) {
      csv_.write(*row);
      finish_.row(row->t);
    }
    if (pairing_.session() == session) finish_.sample(t, Clock::now());
  }

  // The estimate of a tick is repeated when late events correct it, until the next tick's arrives.
  // Only the last estimate of each tick is paired.
  void estimate_for_now() {
    if (last_word_ && last_word_->session == estimate_.session &&
        estimate_.tick < last_word_->tick) {
      write_now(now_pairing_->add_estimate(estimate_));
      return;
    }
    if (last_word_ &&
        (last_word_->session != estimate_.session || last_word_->tick != estimate_.tick)) {
      write_now(now_pairing_->add_estimate(*last_word_));
    }
    last_word_ = estimate_;
  }

  void write_now(const SyncRow* row) {
    if (row != nullptr) now_csv_->write(*row);
  }

  void progress() {
    csv_.flush();
    if (now_csv_) now_csv_->flush();
    if (record_) record_->flush();
    const SyncFigures& figures = pairing_.figures();
    if (figures.rows == 0) {
      std::cerr << "waiting for states and estimates\n";
    } else {
      std::cerr << "t " << figures.last_t << "  V " << figures.last_v << "  rows " << figures.rows
                << '\n';
    }
  }

  // No output is left: the disk is full, or the reader of stdout has ended.
  bool received_in_vain() const {
    return !csv_.good() && (!now_csv_ || !now_csv_->good()) && (!record_ || !record_->good());
  }

  // The run continues with the remaining files.
  void report_failures() {
    const auto warn = [](const auto& file, bool& warned) {
      if (warned || file.good()) return;
      std::cerr << file.error() << ": nothing more is written to it; the run goes on\n";
      warned = true;
    };
    warn(csv_, csv_failure_reported_);
    if (now_csv_) warn(*now_csv_, now_failure_reported_);
    if (record_) warn(*record_, record_failure_reported_);
  }

  std::string lost() const { return describe(losses_, bus_.counts().overflowed); }

  // Reports losses as soon as they are known, at most once a second.
  void report_losses(Clock::time_point now) {
    const std::string all = lost();
    if (all == reported_losses_) return;
    reported_losses_ = all;
    next_loss_line_ = now + 1s;
    if (all.empty()) {
      std::cerr << "late messages have arrived: none is lost\n";
      return;
    }
    std::cerr << "lost on the way here: " << all;
    if (record_) std::cerr << "; " << record_name_ << " is not complete";
    if (bus_.counts().overflowed > 0) {
      std::cerr << ". A larger recv_buf_size in --url (and net.core.rmem_max) or a slower master "
                   "helps";
    }
    std::cerr << '\n';
  }

  void check_files() const {
    csv_.require_good();
    if (now_csv_) now_csv_->require_good();
    if (record_ && !record_->good()) throw std::runtime_error(record_->error());
  }

  Bus bus_;
  Pairing pairing_;
  std::optional<Pairing> now_pairing_;
  SyncWriter csv_;
  std::optional<SyncWriter> now_csv_;
  std::optional<ChannelLogWriter> record_;
  std::string record_name_;
  Eigen::Index coordinates_;
  bool to_stdout_;
  FreshnessRule freshness_;
  bool warned_ = false;
  bool csv_failure_reported_ = false, now_failure_reported_ = false,
       record_failure_reported_ = false;
  Clock::time_point truth_received_;
  std::vector<state_t> held_;  // states of another session, which wait for its acceptance
  std::int64_t of_other_masters_ = 0;
  std::int64_t stale_ = 0;  // messages that would have begun a session but were sent too long ago
  Finish finish_;
  state_t state_{};
  estimate_t estimate_{};
  std::optional<estimate_t> last_word_;  // latest estimate of the latest tick
  std::array<std::int64_t, refusal_kinds> refused_{};
  contacts_t contacts_{};
  Losses losses_;
  std::string reported_losses_;
  Clock::time_point next_loss_line_;  // earliest time of the next line
};

}  // namespace

std::filesystem::path now_file(const std::filesystem::path& csv) {
  return csv.parent_path() / (csv.stem().string() + "_now.csv");
}

int run_live(const Model& model, const LiveOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report) {
  Live live(model, options, common);
  live.run();
  return live.close(report);
}

}  // namespace sprag
