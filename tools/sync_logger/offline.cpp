#include "tools/sync_logger/offline.h"

#include <iostream>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/detail/files/states_file.h"
#include "tools/sync_logger/logger.h"
#include "tools/sync_logger/sync_file.h"

namespace sprag {

namespace {

/// One of the two files, and its next row as a message.
template <class Message>
class Source {
 public:
  explicit Source(const std::filesystem::path& file) : file_(file), reader_(file) { advance(); }

  const Message* head() const { return has_head_ ? &head_ : nullptr; }
  Eigen::Index coordinates() const { return reader_.coordinates(); }

  void advance() {
    has_head_ = reader_.next(row_);
    if (!has_head_) return;
    head_.tick = row_.k;
    head_.t = row_.t;
    head_.f = static_cast<std::int32_t>(row_.q.size());
    head_.q.assign(row_.q.begin(), row_.q.end());
    head_.u.assign(row_.u.begin(), row_.u.end());
  }

  /// Reports damage of the file on stderr and in the report; returns whether there is any.
  bool report_damage(nlohmann::ordered_json& report) const {
    if (!reader_.damage()) return false;
    const auto& [line, what] = *reader_.damage();
    const std::string text = file_.string() + ":" + std::to_string(line) + ": " + what;
    std::cerr << text << "; everything before it is used\n";
    report["damage"].push_back(text);
    return true;
  }

 private:
  std::filesystem::path file_;
  StatesReader reader_;
  StateRow row_;
  Message head_{};
  bool has_head_ = false;
};

}  // namespace

int run_offline(const Model& model, const OfflineOptions& options, nlohmann::ordered_json& report) {
  Source<state_t> truth(options.truth);
  Source<estimate_t> estimate(options.estimate);
  const std::string f = std::to_string(model.coordinates());
  if (truth.coordinates() != model.coordinates())
    throw InputError(options.truth.string() + ": has " + std::to_string(truth.coordinates()) +
                     " coordinates; the scene has " + f);
  if (estimate.coordinates() > model.coordinates())
    throw InputError(options.estimate.string() + ": has " + std::to_string(estimate.coordinates()) +
                     " coordinates; the scene has " + f);

  Pairing pairing(model);
  SyncWriter csv(options.csv, model.coordinates());
  while (!stop_requested() && (truth.head() != nullptr || estimate.head() != nullptr)) {
    const bool truth_next = estimate.head() == nullptr ||
                            (truth.head() != nullptr && truth.head()->t <= estimate.head()->t);
    const SyncRow* row =
        truth_next ? pairing.add_truth(*truth.head()) : pairing.add_estimate(*estimate.head());
    if (row != nullptr) csv.write(*row);
    if (truth_next) {
      truth.advance();
    } else {
      estimate.advance();
    }
  }

  report.update(to_json(pairing));
  const bool truth_damaged = truth.report_damage(report);
  const bool estimate_damaged = estimate.report_damage(report);
  csv.finish();
  if (truth_damaged || estimate_damaged) return exit_failed;
  if (pairing.figures().rows == 0 && !stop_requested())
    throw InputError(options.truth.string() + " and " + options.estimate.string() +
                     ": no time is in both");
  return exit_done;
}

}  // namespace sprag
