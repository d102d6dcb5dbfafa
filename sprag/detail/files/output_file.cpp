#include "sprag/detail/files/output_file.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "sprag/error.h"

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
  std::setvbuf(stream, nullptr, _IONBF, 0);  // buffer_ is the only buffer, so that errors show
  buffer_.reserve(2 * buffer_size);
}

OutputFile::OutputFile(const std::filesystem::path& file)
    : OutputFile(file.string(), std::fopen(file.c_str(), "wb")) {}

OutputFile OutputFile::standard_output() { return {"standard output", stdout}; }

void OutputFile::write(std::string_view record) noexcept {
  if (error_ != 0 || !stream_) return;
  buffer_.append(record);
  record_ends_.push_back(buffer_.size());
  if (buffer_.size() >= buffer_size) flush();
}

bool OutputFile::flush() noexcept {
  std::string_view rest = buffer_;
  while (stream_ && good() && !rest.empty()) {
    errno = 0;
    const std::size_t written = std::fwrite(rest.data(), 1, rest.size(), stream_.get());
    rest.remove_prefix(written);
    if (rest.empty()) break;
    if (errno == EINTR) {  // a signal interrupted the write to a pipe: continue with the rest
      std::clearerr(stream_.get());
    } else {
      error_ = errno != 0 ? errno : EIO;
      cut_after(buffer_.size() - rest.size());
    }
  }
  size_ += buffer_.size();
  buffer_.clear();
  record_ends_.clear();
  return good();
}

// Removes an incomplete record from the end of the file.
void OutputFile::cut_after(std::size_t written) noexcept {
  const auto next = std::upper_bound(record_ends_.begin(), record_ends_.end(), written);
  const std::size_t whole = next == record_ends_.begin() ? 0 : *std::prev(next);
  // A pipe cannot be truncated; that error is ignored.
  (void)::ftruncate(::fileno(stream_.get()), static_cast<off_t>(size_ + whole));
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

void write_file(const std::filesystem::path& file, std::string_view text) {
  OutputFile out(file);
  out.write(text);
  if (!out.close()) throw Error(out.error());
}

}  // namespace sprag
