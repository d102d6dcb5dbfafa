// Serves the page's files and its stream over HTTP, by the rules of rules.h. The server asks every
// stream client for its next message at most 60 times a second, and never during a pending write.
// A slow client is therefore sent fewer messages; a dead client is closed by timeout. At most 32
// connections are open. While all are taken, a new connection displaces the connection that has
// made no progress for the longest time, at least a second: a client that does not read cannot
// block the server. All handlers run in the thread that calls run().
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

/// The server cannot listen on the address. what() reads "127.0.0.1:8080: Address already in use",
/// followed by the remedy.
struct ListenError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Interface to a client of the stream. Called only in the thread of run().
struct StreamClient {
  std::function<void(std::string_view message)> receive;
  /// The next message; nothing: none is due now.
  std::function<std::optional<std::string>()> next;
};

struct ServerCounts {
  std::int64_t requests = 0;     ///< over HTTP, answered
  std::int64_t refused = 0;      ///< requests answered with a status other than 200 and 101
  std::int64_t displaced = 0;    ///< connections without progress, closed for new ones
  std::int64_t turned_away = 0;  ///< connections above the limit
  std::int64_t clients = 0;      ///< of the stream, since the start
  std::int64_t clients_now = 0;
  std::int64_t frames = 0;   ///< sent
  std::int64_t dropped = 0;  ///< not sent: a write was pending, or no message was due
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

  /// The address with the actual port.
  const Endpoint& endpoint() const;

  /// Serves until any thread calls stop(). Throws nothing but std::bad_alloc.
  void run();
  void stop();

  /// Only valid after run() has returned.
  const ServerCounts& counts() const;

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace sprag::view
