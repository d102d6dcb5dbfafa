#include "mechanics/output_file.h"

#include <cerrno>
#include <system_error>
#include <utility>

namespace sprag {

namespace {
constexpr std::size_t buffer_size = 65536;
}

void OutputFile::Closer::operator()(std::FILE* stream) const noexcept {
  if (stream != stdout) std::fclose(stream);
}

OutputFile::OutputFile(std::string name, std::FILE* stream)
    : name_(std::move(name)), stream_(stream) {
  if (!stream_) {
    error_ = errno;
    return;
  }
  std::setvbuf(stream, nullptr, _IONBF, 0);  // buffer_ is the only one, so that failures show
  buffer_.reserve(2 * buffer_size);
}

OutputFile::OutputFile(const std::filesystem::path& file)
    : OutputFile(file.string(), std::fopen(file.c_str(), "wb")) {}

OutputFile OutputFile::standard_output() { return {"standard output", stdout}; }

void OutputFile::write(std::string_view bytes) noexcept {
  if (error_ != 0 || !stream_) return;
  buffer_.append(bytes);
  if (buffer_.size() >= buffer_size) flush();
}

bool OutputFile::flush() noexcept {
  std::string_view rest = buffer_;
  while (stream_ && good() && !rest.empty()) {
    errno = 0;
    const std::size_t written = std::fwrite(rest.data(), 1, rest.size(), stream_.get());
    rest.remove_prefix(written);
    if (rest.empty()) break;
    if (errno == EINTR) {  // a signal during a write to a pipe: the rest is still to go
      std::clearerr(stream_.get());
    } else {
      error_ = errno != 0 ? errno : EIO;
    }
  }
  buffer_.clear();
  return good();
}

bool OutputFile::close() noexcept {
  flush();
  if (!stream_) return good();
  std::FILE* stream = stream_.release();
  errno = 0;
  const bool closed = stream == stdout ? std::fflush(stream) == 0 : std::fclose(stream) == 0;
  if (!closed && good()) error_ = errno != 0 ? errno : EIO;
  return good();
}

std::string OutputFile::error() const {
  return good() ? std::string{} : name_ + ": " + std::generic_category().message(error_);
}

}  // namespace sprag
