#include "tools/view/run.h"

#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "lcmtypes/bus.h"
#include "observer/wake.h"
#include "sprag/detail/files/input_file.h"
#include "tools/view/client.h"
#include "tools/view/gateway/server.h"
#include "tools/view/page_files.h"

namespace sprag::view {
namespace {

using namespace std::chrono_literals;

Endpoint endpoint_option(const std::string& text) {
  const auto endpoint = endpoint_of(text);
  if (!endpoint) {
    throw UsageError("--http: " + text + " is not allowed; must be ADDRESS:PORT or PORT");
  }
  return *endpoint;
}

// Serves in its own thread during its lifetime.
class Serving {
 public:
  Serving(const Endpoint& endpoint, Stage& stage, std::optional<double> speed)
      : server_(listen(endpoint, stage, speed)), thread_([this] { server_->run(); }) {}
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;
  ~Serving() { stop(); }

  void stop() {
    if (!thread_.joinable()) return;
    server_->stop();
    thread_.join();
  }
  const Server& server() const { return *server_; }

 private:
  static std::unique_ptr<Server> listen(const Endpoint& endpoint, Stage& stage,
                                        std::optional<double> speed) {
    const auto make_client = [&stage, speed] {
      auto client = std::make_shared<Client>();
      const auto next = [client, &stage, speed]() -> std::optional<std::string> {
        if (!client->wants()) return std::nullopt;
        const std::lock_guard lock(stage.mutex);
        return client->next(stage.watch, speed, stage.now, monotonic_now(), stage.over);
      };
      return StreamClient{[client](std::string_view message) { client->receive(message); }, next};
    };
    try {
      return std::make_unique<Server>(endpoint, page_files(), make_client);
    } catch (const std::invalid_argument& e) {
      throw UsageError(std::string("--http: ") + e.what());
    }
  }

  std::unique_ptr<Server> server_;
  std::thread thread_;
};

void listen_to_bus(Bus& bus, Stage& stage, Reception& reception) {
  for (const char* channel : watched_channels()) {
    bus.subscribe(channel, [&](std::string_view name, std::span<const std::uint8_t> data,
                               std::int64_t utime) {
      reception.take(name, data, {monotonic_now(), utime});
    });
  }
  while (!stop_requested()) {
    bus.handle(50ms);
    stage.now = monotonic_now();
  }
}

}  // namespace

int run_view(const ViewOptions& options, const CommonOptions& common,
             nlohmann::ordered_json& report) {
  const Endpoint endpoint = endpoint_option(options.http);
  const Scene scene = load_scene(options.scene, common);
  const bool replays = !options.replay.file.empty();
  if (replays)
    InputFile{options.replay.file};  // reports an unreadable file before the page is served
  std::optional<Bus> bus;
  if (!replays) bus.emplace(common.url, key_of(common));

  Stage stage(scene, common.key.empty() || replays ? Freshness::any : Freshness::required);
  Reception reception(stage, scene.clock);
  if (!replays) stage.now = monotonic_now();
  Serving serving(endpoint, stage, replays ? std::optional(options.replay.speed) : std::nullopt);
  const Endpoint& here = serving.server().endpoint();
  std::cerr << "http://" << text_of(here) << "/\n";
  if (!is_loopback(here)) {
    std::cerr << "other hosts can look on, too; nobody is asked for a password\n";
  }

  bool whole = true;
  if (replays) {
    whole = replay(scene, options.replay, common, stage, reception, report);
    stage.over = true;
    if (!stop_requested()) std::cerr << "the recording is over\n";
    while (!stop_requested()) std::this_thread::sleep_for(50ms);
  } else {
    listen_to_bus(*bus, stage, reception);
  }
  serving.stop();

  const ServerCounts& counts = serving.server().counts();
  report["http"] = text_of(here);
  report["clients"] = counts.clients;
  report["requests"] = counts.requests;
  report["requests_refused"] = counts.refused;
  report["displaced"] = counts.displaced;
  report["turned_away"] = counts.turned_away;
  report["frames"] = {
      {"sent", counts.frames}, {"dropped", counts.dropped}, {"bytes", counts.bytes}};
  const MessageCounts& messages = stage.watch.messages();
  report["messages"] = {
      {"received", reception.messages()},
      {"refused", refusals(reception.refused(), bus ? bus->counts() : BusCounts{})},
      {"overflowed", bus ? bus->counts().overflowed : 0},
      {"of_others", stage.watch.of_others()},
      {"misfits", stage.watch.misfits()},
      {"contacts", messages.received},
      {"contacts_lost", messages.lost}};
  return whole ? exit_done : exit_failed;
}

}  // namespace sprag::view
