// Serves the page's files and its stream over HTTP, by the rules of rules.h. Every client of the
// stream is asked for what it is to be sent, at most 60 times a second and never while something is
// still on its way to it; so a slow client is sent less, and one that is dead is closed. There are
// 32 places. While they are taken, a new connection gets that of the one that has made no progress
// for the longest time, at least a second: a client that does not read keeps nobody out. It runs in
// the thread that calls run().
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tools/view/gateway/rules.h"

namespace sprag::view {

/// The address cannot be listened on. what() reads "127.0.0.1:8080: Address already in use", and
/// what to do.
struct ListenError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A client of the stream, as the server sees it. Used by the thread of run() alone.
struct StreamClient {
  std::function<void(std::string_view message)> hear;
  /// What to send; nothing: not now.
  std::function<std::optional<std::string>()> next;
};

struct ServerCounts {
  std::int64_t requests = 0;     ///< over HTTP, answered
  std::int64_t refused = 0;      ///< of them, with another status than 200 and 101
  std::int64_t displaced = 0;    ///< connections without progress, closed for new ones
  std::int64_t turned_away = 0;  ///< connections above the limit
  std::int64_t clients = 0;      ///< of the stream, since the start
  std::int64_t clients_now = 0;
  std::int64_t frames = 0;   ///< sent
  std::int64_t dropped = 0;  ///< not sent, since something was still on its way
  std::int64_t bytes = 0;    ///< of frames
};

class Server {
 public:
  /// Listens on `endpoint`. `files` must outlive the server. Throws ListenError.
  Server(const Endpoint& endpoint, std::span<const PageFile> files,
         std::function<StreamClient()> make_client);
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server();

  /// With the port that was taken.
  const Endpoint& endpoint() const;

  /// Serves until stop() is called, by any thread. Throws nothing but std::bad_alloc.
  void run();
  void stop();

  /// After run().
  const ServerCounts& counts() const;

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace sprag::view
