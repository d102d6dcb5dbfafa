#include "sprag/detail/files/input_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "sprag/detail/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr std::size_t piece = 65536;
constexpr int look_at_requests = 100;  // interval of checks for a stop request [ms]

}  // namespace

InputFile::InputFile(std::filesystem::path file)
    : path_(std::move(file)), descriptor_(::open(path_.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0)
    throw InputError(path_.string() + ": " + std::generic_category().message(errno));
  struct stat status {};
  if (::fstat(descriptor_, &status) == 0 && S_ISDIR(status.st_mode)) {
    ::close(descriptor_);
    throw InputError(path_.string() + ": is a directory");
  }
}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      buffer_(std::move(other.buffer_)),
      begin_(other.begin_),
      offset_(other.offset_),
      ended_(other.ended_),
      failed_(other.failed_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string_view InputFile::ahead(std::size_t count) {
  while (buffer_.size() - begin_ < count && fill()) {
  }
  return std::string_view(buffer_).substr(begin_);
}

void InputFile::skip(std::size_t count) {
  begin_ += count;
  offset_ += count;
}

// False at the end of the file.
bool InputFile::fill() {
  if (ended_) return false;
  buffer_.erase(0, std::exchange(begin_, 0));
  const std::size_t size = buffer_.size();
  buffer_.resize(size + piece);
  ssize_t got = -1;
  do {
    check_interrupt();
    pollfd ready{descriptor_, POLLIN, 0};
    errno = EINTR;
    if (::poll(&ready, 1, look_at_requests) > 0)
      got = ::read(descriptor_, buffer_.data() + size, piece);
  } while (got < 0 && (errno == EINTR || errno == EAGAIN));
  failed_ = got < 0;
  ended_ = got <= 0;
  buffer_.resize(size + (got > 0 ? static_cast<std::size_t>(got) : 0));
  return got > 0;
}

std::string read_whole(const std::filesystem::path& file, std::size_t most) {
  InputFile input(file);
  std::size_t size = 0;
  while (input.ahead(size + 1).size() > size) {
    size = input.ahead(size).size();
    if (size <= most) continue;
    throw InputError(file.string() + ": is larger than " + std::to_string(most >> 20U) +
                     " MiB, the most that is read");
  }
  if (input.failed()) throw InputError(file.string() + ": cannot be read");
  return std::string(input.ahead(size));
}

}  // namespace sprag
