#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "command_line/program.h"
#include "tools/listen/gpio_events.h"
#include "tools/listen/source.h"

#if __has_include(<linux/gpio.h>)
#include <linux/gpio.h>
#include <sys/ioctl.h>
#endif

namespace sprag {

#ifdef GPIO_V2_GET_LINE_IOCTL

namespace {

class GpioLines : public EdgeSource {
 public:
  GpioLines(const std::string& text, int contacts)
      : request_(parse_gpio(text, contacts)),
        name_(request_.chip),
        events_(request_.lines, host_start()) {
    const int chip = ::open(request_.chip.c_str(), O_RDONLY | O_CLOEXEC);
    if (chip < 0) throw UsageError(name_ + ": cannot be opened: " + std::strerror(errno));
    gpio_v2_line_request request{};
    for (std::size_t i = 0; i < request_.lines.size(); ++i) request.offsets[i] = request_.lines[i];
    request.num_lines = static_cast<__u32>(request_.lines.size());
    request.config.flags =
        GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING;
    request.event_buffer_size = 1024;
    std::strncpy(request.consumer, "sprag listen", sizeof request.consumer - 1);
    const int result = ::ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request);
    const int error = errno;
    ::close(chip);
    if (result < 0) throw UsageError(name_ + ": its lines cannot be had: " + std::strerror(error));
    descriptor_ = request.fd;
  }
  ~GpioLines() override { ::close(descriptor_); }
  GpioLines(const GpioLines&) = delete;
  GpioLines& operator=(const GpioLines&) = delete;

  const std::string& name() const override { return name_; }
  int descriptor() const override { return descriptor_; }

  bool read(Intake& intake, IntakeSink& sink, double now) override {
    std::array<gpio_v2_line_event, 64> events;
    const ssize_t bytes = ::read(descriptor_, events.data(), sizeof events);
    if (bytes < 0) return errno == EINTR || errno == EAGAIN;
    const std::size_t count = static_cast<std::size_t>(bytes) / sizeof events[0];
    for (std::size_t i = 0; i < count; ++i) {
      const gpio_v2_line_event& event = events[i];
      const auto edge = events_.take({.timestamp_ns = event.timestamp_ns,
                                      .rising = event.id == GPIO_V2_LINE_EVENT_RISING_EDGE,
                                      .line = event.offset,
                                      .seqno = event.seqno});
      ++number_;
      if (!edge) continue;
      if (edge->lost > 0) {
        lost_edges_ += edge->lost;
        sink.notice("the kernel has dropped " + std::to_string(edge->lost) +
                    " edges: they are missing in the estimate");
      }
      intake.take_parsed(edge->line, number_, "edge of line " + std::to_string(event.offset), now);
    }
    return true;
  }

 private:
  GpioRequest request_;
  std::string name_;
  GpioEvents events_;
  int descriptor_ = -1;
  std::int64_t number_ = 0;
};

}  // namespace

std::unique_ptr<EdgeSource> gpio_lines(const std::string& text, int contacts) {
  return std::make_unique<GpioLines>(text, contacts);
}

#else

std::unique_ptr<EdgeSource> gpio_lines(const std::string& text, int contacts) {
  parse_gpio(text, contacts);
  throw UsageError("--gpio " + text + ": this program was built without <linux/gpio.h>");
}

#endif

}  // namespace sprag
