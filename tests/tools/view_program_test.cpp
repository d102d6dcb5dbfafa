// `view` as a process, over real sockets: which requests it answers and how, that a replay shows
// the observer's results, and that a client that never reads does not affect others.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "sprag/states_file.h"
#include "tests/support/program_test.h"

namespace sprag::view {
namespace {

using namespace std::chrono_literals;
using test::Arguments;
using test::Process;

/// The number after the first occurrence of `words` that is followed by one; empty if there is
/// none.
std::optional<unsigned> number_after(const std::string& text, std::string_view words) {
  const std::size_t place = text.find(words);
  if (place == std::string::npos) return std::nullopt;
  unsigned number = 0;
  const char* begin = text.data() + place + words.size();
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), number);
  return error == std::errc{} && end != text.data() + text.size() ? std::optional(number)
                                                                  : std::nullopt;
}

/// A connection to a port of this host; every read ends after a while.
class Socket {
 public:
  explicit Socket(int port) : descriptor_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{20, 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    connected_ = ::connect(descriptor_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { ::close(descriptor_); }

  bool connected() const { return connected_; }

  void send(const std::string& text) {
    ASSERT_EQ(::send(descriptor_, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }

  /// Reads up to `end`, or to the end of the connection.
  std::string until(const std::string& end) {
    while (buffer_.find(end) == std::string::npos && fill()) {
    }
    const std::size_t found = buffer_.find(end);
    return take(found == std::string::npos ? buffer_.size() : found + end.size());
  }

  std::string take(std::size_t count) {
    while (buffer_.size() < count && fill()) {
    }
    const std::string taken = buffer_.substr(0, count);
    buffer_.erase(0, count);
    return taken;
  }

  /// The next text of a WebSocket; pings are skipped. Empty at the end of the connection.
  std::string text() {
    while (true) {
      const std::string head = take(2);
      if (head.size() < 2) return {};
      std::size_t size = static_cast<unsigned char>(head[1]) & 127U;
      const std::size_t extended = size == 126 ? 2 : size == 127 ? 8 : 0;
      if (extended > 0) {
        size = 0;
        for (const char byte : take(extended)) size = size << 8U | static_cast<unsigned char>(byte);
      }
      const std::string payload = take(size);
      if ((static_cast<unsigned char>(head[0]) & 15U) == 1) return payload;
    }
  }

  /// Sends a short text as a WebSocket's client, masked, here with zeros.
  void say(const std::string& text) {
    ASSERT_LT(text.size(), 126u);
    send(std::string{'\x81', static_cast<char>(0x80U | text.size()), 0, 0, 0, 0} + text);
  }

 private:
  bool fill() {
    std::array<char, 65536> chunk;
    const ssize_t count = ::recv(descriptor_, chunk.data(), chunk.size(), 0);
    if (count <= 0) return false;
    buffer_.append(chunk.data(), static_cast<std::size_t>(count));
    return true;
  }

  int descriptor_;
  bool connected_ = false;
  std::string buffer_;
};

class ViewProgramTest : public test::ProgramTest {
 protected:
  static constexpr const char* scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";

  /// Starts `view` at a free port and waits until it serves.
  void serve(Arguments more) {
    Arguments command{VIEW, scene, "--http", "127.0.0.1:0", "--report", path("report.json")};
    command.insert(command.end(), more.begin(), more.end());
    view_.emplace(command, path(""), "view");
    std::optional<unsigned> port;
    std::string said;
    ASSERT_TRUE(test::eventually(
        [&] {
          said = view_->err();
          port = number_after(said, "http://127.0.0.1:");
          return port.has_value();
        },
        60s))
        << said;
    port_ = static_cast<int>(*port);
    host_ = "127.0.0.1:" + std::to_string(port_);
  }
  void serve_bus() { serve({"--url", "memq://"}); }

  /// The head of a response, and its body.
  std::pair<std::string, std::string> ask(const std::string& request) {
    Socket socket(port_);
    EXPECT_TRUE(socket.connected());
    socket.send(request);
    const std::string head = socket.until("\r\n\r\n");
    std::string body;
    if (request.starts_with("HEAD")) return {head, body};
    if (const auto length = number_after(head, "Content-Length: ")) body = socket.take(*length);
    return {head, body};
  }
  int status(const std::string& request) {
    const std::string head = ask(request).first;
    return head.size() > 12 ? std::stoi(head.substr(9, 3)) : 0;
  }
  std::string get(const std::string& target, const std::string& more = "") const {
    return "GET " + target + " HTTP/1.1\r\nHost: " + host_ + "\r\n" + more + "\r\n";
  }
  std::string upgrade(const std::string& origin) const {
    return get("/stream",
               "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: " +
                   origin + "\r\n");
  }

  nlohmann::json stop(int signal = SIGTERM) {
    view_->signal(signal);
    EXPECT_EQ(view_->wait(30s), 0) << view_->err();
    return nlohmann::json::parse(test::read_text(path("report.json")));
  }

  std::optional<Process> view_;
  int port_ = 0;
  std::string host_;
};

TEST_F(ViewProgramTest, ServesOnlyThePage) {
  serve_bus();
  const auto [head, body] = ask(get("/"));
  EXPECT_TRUE(head.starts_with("HTTP/1.1 200")) << head;
  EXPECT_NE(head.find("Content-Type: text/html; charset=utf-8"), std::string::npos) << head;
  EXPECT_NE(head.find("Content-Security-Policy: default-src 'none'; script-src 'self'"),
            std::string::npos);
  EXPECT_NE(head.find("X-Content-Type-Options: nosniff"), std::string::npos);
  EXPECT_EQ(head.find("Access-Control"), std::string::npos);
  EXPECT_EQ(body, test::read_text(SPRAG_SOURCE_DIR "/python/sprag/view/page/index.html"));
  // All files that the page refers to are complete.
  for (const char* file : {"/page.js", "/page.css", "/icon.svg", "/dygraph.js", "/dygraph.css"}) {
    EXPECT_NE(body.find(file), std::string::npos) << file;
    const auto [file_head, bytes] = ask(get(file));
    EXPECT_TRUE(file_head.starts_with("HTTP/1.1 200")) << file;
    EXPECT_GT(bytes.size(), 100u) << file;
  }
  EXPECT_EQ(status("HEAD / HTTP/1.1\r\nHost: " + host_ + "\r\n\r\n"), 200);
  EXPECT_EQ(status(get("/secret")), 404);
  EXPECT_EQ(status("POST / HTTP/1.1\r\nHost: " + host_ + "\r\nContent-Length: 3\r\n\r\nabc"), 405);
  EXPECT_EQ(status("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), 403);
  EXPECT_EQ(status("GET / HTTP/1.1\r\n\r\n"), 403);
  EXPECT_EQ(status("GET / HTTP/1.1\r\nHost: " + host_ + "\r\nHost: " + host_ + "\r\n\r\n"), 403);
  EXPECT_EQ(status("nonsense\r\n\r\n"), 400);
  EXPECT_EQ(status(get("/", "X: " + std::string(20000, 'x') + "\r\n")), 400);
  EXPECT_EQ(status(get("/stream")), 426);
  EXPECT_EQ(status(upgrade("http://evil.example")), 403);
  const nlohmann::json report = stop();
  EXPECT_EQ(report["clients"], 0);
  EXPECT_EQ(report["requests_refused"], 7);
}

TEST_F(ViewProgramTest, TwoRequestsShareOneConnection) {
  serve_bus();
  Socket socket(port_);
  for (int i = 0; i < 2; ++i) {
    socket.send(get("/icon.svg"));
    EXPECT_TRUE(socket.until("\r\n\r\n").starts_with("HTTP/1.1 200"));
    EXPECT_TRUE(socket.until("</svg>\n").ends_with("</svg>\n"));
  }
  stop(SIGINT);
}

TEST_F(ViewProgramTest, ReplayShowsEstimatesOfObserver) {
  ASSERT_EQ(run(MASTER_SIM, {scene, "--duration", "3", "--speed", "max", "--no-lcm", "--events",
                             path("events.csv")})
                .code,
            0);
  ASSERT_EQ(
      run(OBSERVER, {scene, "--replay", path("events.csv"), "--states", path("states.csv")}).code,
      0);
  serve({"--replay", path("events.csv"), "--speed", "max"});
  // A client that never reads.
  Socket dead(port_);
  dead.send(upgrade("http://" + host_));

  Socket socket(port_);
  socket.send(upgrade("http://" + host_));
  ASSERT_TRUE(socket.until("\r\n\r\n").starts_with("HTTP/1.1 101"));
  nlohmann::json frame;
  std::int64_t received = 0;
  bool over = false;
  while (!over || received < 40) {
    const std::string text = socket.text();
    ASSERT_FALSE(text.empty()) << "the stream has ended";
    const nlohmann::json message = nlohmann::json::parse(text);
    EXPECT_EQ(message["n"], ++received);
    over = message["over"];
    frame = message["frame"];
    socket.say(R"({"seen": )" + std::to_string(received) + "}");
  }
  StatesReader states(path("states.csv"));
  StateRow last;
  while (states.next(last)) {
  }
  EXPECT_GT(last.k, 1000);
  EXPECT_EQ(frame["settled"]["tick"], last.k);
  using Numbers = std::vector<double>;
  EXPECT_EQ(frame["settled"]["q"].get<Numbers>(), Numbers(last.q.begin(), last.q.end()));
  EXPECT_EQ(frame["settled"]["u"].get<Numbers>(), Numbers(last.u.begin(), last.u.end()));
  const nlohmann::json report = stop();
  EXPECT_EQ(report["clients"], 2);
  EXPECT_TRUE(report["observed_here"]);
  EXPECT_LE(report["frames"]["sent"].get<int>(), received + 3 + 3)
      << "no more than are acknowledged";
}

// All connections are taken by clients that never read, some of which do not even send a request.
TEST_F(ViewProgramTest, ClientsThatNeverReadDoNotBlockOthers) {
  serve_bus();
  std::vector<std::unique_ptr<Socket>> dead;
  for (int i = 0; i < 32; ++i) {
    dead.push_back(std::make_unique<Socket>(port_));
    ASSERT_TRUE(dead.back()->connected());
    if (i % 4 != 0) dead.back()->send(upgrade("http://" + host_));
  }
  Socket alive(port_);
  ASSERT_TRUE(alive.connected());
  alive.send(upgrade("http://" + host_));
  ASSERT_TRUE(alive.until("\r\n\r\n").starts_with("HTTP/1.1 101"));
  // It stays connected while more of the others arrive.
  for (int n = 1; n <= 100; ++n) {
    ASSERT_FALSE(alive.text().empty()) << "closed at frame " << n;
    alive.say(R"({"seen": )" + std::to_string(n) + "}");
    if (n % 20 == 0) dead.push_back(std::make_unique<Socket>(port_));
  }
  EXPECT_EQ(status(get("/")), 200);
  const nlohmann::json report = stop();
  EXPECT_GE(report["displaced"].get<int>(), 2);
}

TEST_F(ViewProgramTest, BusPortInUseIsReported) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(descriptor, reinterpret_cast<sockaddr*>(&address), size), 0);
  ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
  const std::string port = std::to_string(ntohs(address.sin_port));
  const Ended ended = run(
      VIEW, {scene, "--http", "127.0.0.1:0", "--url", "udpm://239.255.76.67:" + port + "?ttl=0"});
  ::close(descriptor);
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("UDP port " + port + " is in use"), std::string::npos) << ended.err;
  EXPECT_EQ(ended.err.find("ip route"), std::string::npos) << ended.err;
}

TEST_F(ViewProgramTest, ServerErrorsAreReported) {
  serve_bus();
  const Ended taken = run(VIEW, {scene, "--url", "memq://", "--http", host_});
  EXPECT_EQ(taken.code, 1);
  EXPECT_NE(taken.err.find(host_ + ": Address already in use; another program listens there"),
            std::string::npos)
      << taken.err;
  for (const char* http : {"nonsense", "127.0.0.1", "nohost:8080", "127.0.0.1:99999"}) {
    const Ended ended = run(VIEW, {scene, "--url", "memq://", "--http", http});
    EXPECT_EQ(ended.code, 2) << http;
    EXPECT_NE(ended.err.find("--http: "), std::string::npos) << ended.err;
  }
  EXPECT_EQ(run(VIEW, {scene, "--replay", path("nothing")}).code, 2);
  EXPECT_EQ(run(VIEW, {scene, "--speed", "2"}).code, 2);
  stop(SIGHUP);
}

}  // namespace
}  // namespace sprag::view
