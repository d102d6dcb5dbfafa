#include "observer/live.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "lcmtypes/bus.h"
#include "observer/estimation.h"
#include "observer/figures.h"
#include "observer/flow_builder.h"
#include "observer/identification_thread.h"
#include "observer/mailboxes.h"
#include "observer/notices.h"
#include "observer/publication.h"
#include "observer/real_time.h"
#include "observer/real_time_loop.h"
#include "observer/reception.h"
#include "observer/settled_follower.h"
#include "observer/settled_output.h"
#include "observer/thread_group.h"

namespace sprag {
namespace {

constexpr int receiving_priority = 79, integrating_priority = 80, publishing_priority = 70;

std::int64_t history_ticks(const Scene& scene, const ObserverOptions& options) {
  constexpr std::int64_t least = 16, most_bytes = 256 << 20;
  const std::int64_t bytes = 1024 + 64 * scene.model.coordinates();
  const std::int64_t most = std::max(least, most_bytes / bytes);
  const double wanted = std::ceil(options.history / options.tick);
  return wanted < static_cast<double>(most) ? std::max<std::int64_t>(least, std::llround(wanted))
                                            : most;
}

// Requests real-time scheduling for this thread. If it is not permitted, prints one line; the run
// continues without it. The other threads set their own priorities later.
bool claim_real_time() {
  std::string refused = lock_memory();
  if (refused.empty()) refused = schedule_fifo(publishing_priority);
  if (refused.empty()) return true;
  std::cerr << "no real-time scheduling (" << refused << "): running without it\n";
  return false;
}

class LiveObserver {
 public:
  LiveObserver(const Scene& scene, const ObserverOptions& options, const CommonOptions& common)
      : estimation_(scene, options, history_ticks(scene, options)),
        outbox_(estimation_.empty_sample()),
        bus_(common.url, key_of(common)),
        settled_(options.states, estimation_.empty_sample(), estimation_.initial_bound,
                 scene.model.outputs),
        reception_(bus_, estimation_.contacts, scene.clock, estimation_.stream != nullptr, inbox_,
                   notices_),
        loop_(estimation_, options.last(),
              common.key.empty() ? Freshness::any : Freshness::required, inbox_, outbox_, notices_),
        publication_(bus_, inbox_, outbox_, notices_, settled_, reception_, options.duration,
                     scene.model.outputs),
        verbose_(options.verbose) {
    // New samples of a streamed input change flows, which another thread must not build meanwhile.
    if (!estimation_.stream) flow_builder_.emplace(estimation_.estimator.flows());
    if (const SceneValues* family = estimation_.estimator.family()) {
      identification_.emplace(*family, MachineAdaptation::most_events);
      loop_.identify_in(*identification_);
    }
    if (!options.impacts.empty() && estimation_.stream) {
      throw UsageError(
          "--impacts of a live run does not support a streamed excitation (the key `stream`); "
          "record the run with sync_logger --record and replay the log");
    }
    if (!options.impacts.empty() || options.predict > 0.0) {
      follower_.emplace(scene, options, bus_);
      loop_.set_follower(*follower_);
    }
    real_time_ = options.real_time && claim_real_time();
    std::cerr << "listening on " << common.url << '\n';
  }

  /// Runs until the end or until a thread has failed, which finish() reports.
  void run() {
    threads_.run([this] {
      threads_.start([this] {
        prepare_thread(receiving_priority);
        reception_.run(stop_);
      });
      if (flow_builder_) threads_.start([this] { flow_builder_->run(); });
      if (identification_) threads_.start([this] { identification_->run(); });
      if (follower_) threads_.start([this] { follower_->run(); });
      threads_.start([this] {
        prepare_thread(integrating_priority);
        loop_.run(stop_);
      });
      publication_.run([this] { return loop_.done() || stop_ || stop_requested(); });
    });
    threads_.end();
    threads_.run([this] {
      if (follower_) follower_->finish();
      publication_.finish();
    });
  }

  /// Fills the report and closes the files. Throws the exception of a thread as std::runtime_error,
  /// or a file's error.
  void finish(nlohmann::ordered_json& report) {
    const EventHistory& events = estimation_.time_line.events();
    LiveFigures figures;
    figures.integration = loop_.figures();
    figures.reception = reception_.figures();
    figures.messages = loop_.messages();
    figures.rollbacks = estimation_.time_line.rollbacks();
    figures.events = events.counts();
    figures.ticks = settled_.ticks();
    figures.unsent = publication_.unsent();
    write_json(figures, report);
    print(figures, verbose_, std::cerr);
    estimation_.to_json(report);
    if (estimation_.stream) estimation_.stream->print(std::cerr);
    report["flows_awaited"] = flow_builder_ ? flow_builder_->awaited() : 0;
    settled_.sum_up(events, verbose_, report);
    std::string failure = failure_of_a_thread();
    try {
      settled_.close();
      if (follower_) follower_->close();
    } catch (const std::runtime_error& e) {
      if (failure.empty()) failure = e.what();
    }
    if (!failure.empty()) throw std::runtime_error(failure);
  }

 private:
  // All exceptions are run-time failures, not usage errors: the input was accepted at the start.
  std::string failure_of_a_thread() const {
    try {
      threads_.rethrow();
    } catch (const std::exception& e) {
      return e.what();
    }
    return {};
  }

  void stop() {
    stop_ = true;
    if (flow_builder_) flow_builder_->stop();
    if (identification_) identification_->stop();
    if (follower_) follower_->stop();
    inbox_.arrived.signal();
    outbox_.ready.signal();
  }

  void prepare_thread(int priority) const {
    sleep_exactly();
    if (real_time_) (void)schedule_fifo(priority);
  }

  Estimation estimation_;
  std::optional<FlowBuilder> flow_builder_;             // without a streamed input
  std::optional<IdentificationThread> identification_;  // with an adaptive estimator
  std::optional<SettledFollower> follower_;             // with --impacts or --predict
  Inbox inbox_;
  Outbox outbox_;
  Notices notices_;
  Bus bus_;
  SettledOutput settled_;
  Reception reception_;
  RealTimeLoop loop_;
  Publication publication_;
  bool verbose_;
  bool real_time_ = false;
  std::atomic<bool> stop_{false};
  ThreadGroup threads_{[this] { stop(); }};  // destroyed first: the threads use all of the above
};

}  // namespace

int run_live(const Scene& scene, const ObserverOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report) {
  LiveObserver observer(scene, options, common);
  observer.run();
  observer.finish(report);
  return exit_done;
}

}  // namespace sprag
