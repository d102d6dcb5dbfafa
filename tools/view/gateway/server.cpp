// The only source that includes Boost.Beast, which takes half a minute to compile.
#include "tools/view/gateway/server.h"

// GCC's thread sanitizer does not support fences; the server runs in one thread and needs none.
#ifdef __SANITIZE_THREAD__
#define BOOST_ASIO_DISABLE_FENCED_BLOCK
#endif
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <list>
#include <utility>

namespace sprag::view {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using namespace std::chrono_literals;

constexpr std::size_t most_connections = 32;
constexpr auto stalled_after = 1s;                    // time without progress
constexpr auto between_looks = 50ms;                  // for a stalled connection
constexpr int most_looks = 40;                        // of a connection that waits for a place
constexpr std::uint32_t longest_header = 8192;        // bytes
constexpr std::uint64_t longest_body = 65536;         // bytes, read only to refuse the method
constexpr std::size_t longest_client_message = 4096;  // bytes
constexpr auto http_patience = 10s;
constexpr auto stream_patience = 20s;  // without an answer to a ping
constexpr auto frame_period = 16667us;

using Clock = std::chrono::steady_clock;
using HttpRequest = http::request<http::string_body>;

std::optional<std::string_view> single(const HttpRequest& request, http::field name) {
  const auto range = request.equal_range(name);
  if (range.first == range.second || std::next(range.first) != range.second) return std::nullopt;
  const auto value = range.first->value();
  return std::string_view(value.data(), value.size());
}

std::string_view view_of(beast::string_view text) { return {text.data(), text.size()}; }

template <class Fields>
void put_safety_headers(Fields& fields) {
  for (const Header& header : safety_headers()) {
    fields.set(beast::string_view(header.name.data(), header.name.size()),
               beast::string_view(header.value.data(), header.value.size()));
  }
}

}  // namespace

// An open connection or stream.
struct Occupant {
  Clock::time_point progress;   // of the last completed write or request
  std::function<void()> close;  // empty after it was called
};

struct Server::Impl {
  Impl(std::span<const PageFile> page_files, std::function<StreamClient()> client_maker)
      : files(page_files), make_client(std::move(client_maker)), acceptor(context) {}

  void listen(const Endpoint& wanted);
  void accept();
  void admit(tcp::socket socket, int looks);
  void displace_slowest();

  std::span<const PageFile> files;
  std::function<StreamClient()> make_client;
  Endpoint endpoint;
  ServerCounts counts;
  std::list<Occupant> occupants;
  // Declared after the members that its handlers use: it destroys the pending handlers.
  asio::io_context context{1};
  tcp::acceptor acceptor;
};

namespace {

// Holds one of the `most_connections` places during its lifetime.
class Place {
 public:
  explicit Place(std::list<Occupant>& occupants)
      : occupants_(&occupants), own_(occupants.insert(occupants.end(), {Clock::now(), {}})) {}
  Place(Place&& other) noexcept
      : occupants_(std::exchange(other.occupants_, nullptr)), own_(other.own_) {}
  Place& operator=(Place&&) = delete;
  ~Place() {
    if (occupants_ != nullptr) occupants_->erase(own_);
  }

  void note_progress() { own_->progress = Clock::now(); }
  /// `close` closes the connection. It is called only during the lifetime of this object.
  void set_close(std::function<void()> close) { own_->close = std::move(close); }

 private:
  std::list<Occupant>* occupants_;
  std::list<Occupant>::iterator own_;
};

// Increments a counter during its lifetime.
class Counted {
 public:
  explicit Counted(std::int64_t& count) : count_(count) { ++count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  ~Counted() { --count_; }

 private:
  std::int64_t& count_;
};

class Stream : public std::enable_shared_from_this<Stream> {
 public:
  Stream(Server::Impl& server, tcp::socket socket, Place place)
      : server_(server),
        place_(std::move(place)),
        now_(server.counts.clients_now),
        socket_(std::move(socket)),
        timer_(server.context),
        client_(server.make_client()) {
    ++server.counts.clients;
    place_.note_progress();
    place_.set_close([this] { close(); });
  }

  void run(const HttpRequest& request) {
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = http_patience;
    timeout.idle_timeout = stream_patience;
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.set_option(websocket::stream_base::decorator(
        [](websocket::response_type& response) { put_safety_headers(response); }));
    socket_.read_message_max(longest_client_message);
    socket_.text(true);
    socket_.auto_fragment(false);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error) return;
      self->read();
      self->wait();
    });
  }

 private:
  // Without a closing handshake: the client does not read.
  void close() {
    closed_ = true;
    timer_.cancel();
    beast::get_lowest_layer(socket_).close();
  }

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) {
        self->timer_.cancel();
        self->closed_ = true;
        return;
      }
      const auto data = self->buffer_.cdata();
      self->client_.receive({static_cast<const char*>(data.data()), data.size()});
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }

  // Each deadline is a frame period after the last, so that the duration of a frame does not add to
  // the period; after a longer delay the deadlines restart at now.
  void wait() {
    const auto now = std::chrono::steady_clock::now();
    due_ = std::max(due_ + frame_period, now);
    timer_.expires_at(due_);
    timer_.async_wait([self = shared_from_this()](beast::error_code error) {
      if (error || self->closed_) return;
      self->send();
      self->wait();
    });
  }

  void send() {
    if (writing_) {
      ++server_.counts.dropped;
      return;
    }
    std::optional<std::string> next = client_.next();
    if (!next) {
      ++server_.counts.dropped;
      return;
    }
    frame_ = std::move(*next);
    writing_ = true;
    socket_.async_write(asio::buffer(frame_),
                        [self = shared_from_this()](beast::error_code error, std::size_t bytes) {
                          self->writing_ = false;
                          if (error) {
                            self->closed_ = true;
                            self->timer_.cancel();
                            return;
                          }
                          self->place_.note_progress();
                          ++self->server_.counts.frames;
                          self->server_.counts.bytes += static_cast<std::int64_t>(bytes);
                        });
  }

  Server::Impl& server_;
  Place place_;
  Counted now_;
  websocket::stream<beast::tcp_stream> socket_;
  asio::steady_timer timer_;
  std::chrono::steady_clock::time_point due_;
  beast::flat_buffer buffer_;
  std::string frame_;
  bool writing_ = false, closed_ = false;
  StreamClient client_;
};

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Server::Impl& server, tcp::socket socket, Endpoint here)
      : server_(server),
        place_(server.occupants),
        socket_(std::move(socket)),
        here_(std::move(here)) {
    place_.set_close([this] { socket_.close(); });
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(longest_header);
    parser_->body_limit(longest_body);
    socket_.expires_after(http_patience);
    http::async_read(
        socket_, buffer_, *parser_,
        [self = shared_from_this()](beast::error_code error, std::size_t) { self->answer(error); });
  }

 private:
  void answer(beast::error_code error) {
    if (error) {
      const bool misread = parser_->got_some() && error.category() == http_category();
      if (misread) {
        refuse(400, "this is no request that is understood here", true, false);
      }
      return;
    }
    place_.note_progress();
    const HttpRequest& request = parser_->get();
    const Request asked{view_of(request.method_string()), view_of(request.target()),
                        single(request, http::field::host), single(request, http::field::origin),
                        websocket::is_upgrade(request)};
    const Verdict verdict = judge(asked, here_, server_.files);
    ++server_.counts.requests;
    const bool head = request.method() == http::verb::head;
    if (verdict.status == 101) {
      auto stream = std::make_shared<Stream>(server_, socket_.release_socket(), std::move(place_));
      stream->run(request);
      return;
    }
    if (verdict.status == 200) {
      const std::span<const unsigned char> bytes = verdict.file->bytes;
      respond(200, verdict.file->type, {reinterpret_cast<const char*>(bytes.data()), bytes.size()},
              !request.keep_alive(), head);
    } else {
      ++server_.counts.refused;
      refuse(verdict.status, verdict.why, !request.keep_alive(), head);
    }
  }

  static const boost::system::error_category& http_category() {
    return http::make_error_code(http::error::end_of_stream).category();
  }

  void refuse(int status, const char* why, bool close, bool head) {
    why_ = std::string(why) + '\n';
    respond(status, "text/plain; charset=utf-8", why_, close, head);
  }

  void respond(int status, std::string_view type, std::string_view body, bool close, bool head) {
    using Body = http::span_body<const char>;
    response_ = std::make_unique<http::response<Body>>();
    http::response<Body>& response = *response_;
    response.result(static_cast<unsigned>(status));
    response.version(11);
    response.keep_alive(!close);
    put_safety_headers(response);
    response.set(http::field::content_type, beast::string_view(type.data(), type.size()));
    if (status == 405) response.set(http::field::allow, "GET, HEAD");
    if (status == 426) {
      response.set(http::field::upgrade, "websocket");
      response.set(http::field::connection, "Upgrade");
    }
    response.body() = {body.data(), body.size()};
    response.content_length(body.size());
    serializer_ = std::make_unique<http::response_serializer<Body>>(response);
    const auto written = [self = shared_from_this(), close](beast::error_code error, std::size_t) {
      if (error || close) {
        self->socket_.socket().shutdown(tcp::socket::shutdown_send, error);
        return;
      }
      self->read();
    };
    if (head) {
      http::async_write_header(socket_, *serializer_, written);
    } else {
      http::async_write(socket_, *serializer_, written);
    }
  }

  Server::Impl& server_;
  Place place_;
  beast::tcp_stream socket_;
  Endpoint here_;
  beast::flat_buffer buffer_{2 * longest_header};
  std::optional<http::request_parser<http::string_body>> parser_;
  std::string why_;
  std::unique_ptr<http::response<http::span_body<const char>>> response_;
  std::unique_ptr<http::response_serializer<http::span_body<const char>>> serializer_;
};

Endpoint text_endpoint(const tcp::endpoint& endpoint) {
  return {endpoint.address().to_string(), endpoint.port()};
}

}  // namespace

void Server::Impl::listen(const Endpoint& wanted) {
  beast::error_code error;
  const auto failed = [&](const char* what) {
    if (!error) return;
    std::string text = text_of(wanted) + ": " + what + error.message();
    if (error == asio::error::address_in_use) {
      text += "; another program listens there, --http takes another port (0: any that is free)";
    }
    throw ListenError(text);
  };
  const asio::ip::address address = asio::ip::make_address(wanted.address, error);
  if (error) {
    throw std::invalid_argument(wanted.address + " is no address of this host, as 127.0.0.1 is");
  }
  const tcp::endpoint at(address, wanted.port);
  acceptor.open(at.protocol(), error);
  failed("");
  acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (address.is_v6()) acceptor.set_option(asio::ip::v6_only(true), error);
  acceptor.bind(at, error);
  failed("");
  acceptor.listen(asio::socket_base::max_listen_connections, error);
  failed("");
  endpoint = text_endpoint(acceptor.local_endpoint());
}

void Server::Impl::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) {
      // For example out of file descriptors: an immediate retry would fail again.
      auto timer = std::make_shared<asio::steady_timer>(context, 100ms);
      timer->async_wait([this, timer](beast::error_code) { accept(); });
      return;
    }
    admit(std::move(socket), most_looks);
  });
}

// Gives the connection a place, and then accepts the next connection. `looks`: retries for a free
// place before the connection is turned away.
void Server::Impl::admit(tcp::socket socket, int looks) {
  if (occupants.size() >= most_connections && looks > 0) {
    displace_slowest();
    auto timer = std::make_shared<asio::steady_timer>(context, between_looks);
    auto waiting = std::make_shared<tcp::socket>(std::move(socket));
    timer->async_wait([this, timer, waiting, looks](beast::error_code) {
      admit(std::move(*waiting), looks - 1);
    });
    return;
  }
  beast::error_code gone;
  const tcp::endpoint here = socket.local_endpoint(gone);
  if (occupants.size() >= most_connections) {
    ++counts.turned_away;
  } else if (!gone) {
    socket.set_option(tcp::no_delay(true), gone);
    std::make_shared<Connection>(*this, std::move(socket), text_endpoint(here))->read();
  }
  accept();
}

// Closes the connection without progress for the longest time, if it has stalled. Its place becomes
// free when its handlers have run.
void Server::Impl::displace_slowest() {
  const auto slowest = std::min_element(
      occupants.begin(), occupants.end(), [](const Occupant& a, const Occupant& b) {
        return std::pair(!a.close, a.progress) < std::pair(!b.close, b.progress);
      });
  if (!slowest->close || Clock::now() - slowest->progress < stalled_after) return;
  const auto close = std::exchange(slowest->close, nullptr);
  close();
  ++counts.displaced;
}

Server::Server(const Endpoint& endpoint, std::span<const PageFile> files,
               std::function<StreamClient()> make_client)
    : impl_(std::make_unique<Impl>(files, std::move(make_client))) {
  impl_->listen(endpoint);
  impl_->accept();
}

Server::~Server() = default;

const Endpoint& Server::endpoint() const { return impl_->endpoint; }

void Server::run() { impl_->context.run(); }

void Server::stop() { impl_->context.stop(); }

const ServerCounts& Server::counts() const { return impl_->counts; }

}  // namespace sprag::view
