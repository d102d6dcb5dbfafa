#include "tools/study/row_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace sprag::study {
namespace {

constexpr auto time_between_syncs = std::chrono::seconds(10);

// Position of a line within its run.
struct ParsedRow {
  std::int64_t index = 0;
  bool first = true, last = true;  // row of its run
  bool failed = false;
};

std::optional<ParsedRow> parse_row(std::string_view line, const Layout& layout,
                                   std::vector<std::string_view>& fields) {
  split_fields(line, fields);
  if (fields.size() != layout.fields) return std::nullopt;
  const auto index = parse_integer(fields[0]);
  if (!index) return std::nullopt;
  ParsedRow row{*index, true, true, !fields.back().empty()};
  if (layout.n_field == 0) return row;
  const auto n = parse_integer(fields[layout.n_field]);
  if (!n || (*n == 0) != row.failed) return std::nullopt;
  row.first = *n <= 1;
  row.last = *n == 0 || *n == layout.n_last;
  return row;
}

[[noreturn]] void refuse(const std::filesystem::path& file, std::size_t line,
                         const std::string& what) {
  throw InputError(file.string() + ":" + std::to_string(line) + ": " + what +
                   "; it is no file of this study: move it away, or use another --output");
}

}  // namespace

std::vector<Range> Contents::ranges() const {
  std::vector<Range> ranges;
  for (const Segment& segment : segments) ranges.push_back(segment.range);
  return ranges;
}

Contents read_rows(const std::filesystem::path& file, const Layout& layout, Range all) {
  LineReader lines(file);
  Contents contents;
  std::string_view line;
  LineReader::Result result = lines.next(line);
  if (result == LineReader::Result::end || result == LineReader::Result::truncated) {
    return contents;
  }
  if (result != LineReader::Result::line || line != layout.header) {
    refuse(file, 1, "has another header");
  }
  std::uint64_t at = line.size() + 1;
  contents.end = at;
  std::vector<std::string_view> fields;
  std::optional<ParsedRow> before;
  std::uint64_t begin = at;  // of the current run
  while ((result = lines.next(line)) == LineReader::Result::line) {
    if (lines.number() % 10000 == 0) check_interrupt();
    const std::optional<ParsedRow> row = parse_row(line, layout, fields);
    if (!row) refuse(file, lines.number(), "is no row");
    const bool within = before && !before->last;  // the run of `before` continues
    if (within ? row->index != before->index || row->first : !row->first) {
      refuse(file, lines.number(), "does not follow the row before it");
    }
    if (row->index < all.first || row->index >= all.end) {
      refuse(file, lines.number(), "has index " + std::to_string(row->index));
    }
    at += line.size() + 1;
    before = row;
    if (!row->last) continue;
    if (row->failed) ++contents.failures;
    auto& segments = contents.segments;
    if (!segments.empty() && segments.back().range.end == row->index) {
      ++segments.back().range.end;
      segments.back().end = at;
    } else {
      segments.push_back({{row->index, row->index + 1}, begin, at});
    }
    contents.end = begin = at;
  }
  if (result == LineReader::Result::unreadable || result == LineReader::Result::too_long) {
    throw InputError(file.string() + ":" + std::to_string(lines.number()) + ": " +
                     describe(result));
  }
  std::error_code error;
  if (result == LineReader::Result::end && std::filesystem::file_size(file, error) != at) {
    refuse(file, 1, "has other ends of line");
  }
  std::vector<Range> ranges = contents.ranges();
  std::sort(ranges.begin(), ranges.end(),
            [](const Range& a, const Range& b) { return a.first < b.first; });
  for (std::size_t i = 1; i < ranges.size(); ++i) {
    if (ranges[i].first < ranges[i - 1].end) {
      throw InputError(
          file.string() + ": has run " + std::to_string(ranges[i].first) +
          " twice; it is no file of this study: move it away, or use another --output");
    }
  }
  return contents;
}

RowFile::RowFile(std::filesystem::path file)
    : file_(std::move(file)), synced_(std::chrono::steady_clock::now()) {
  descriptor_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail();
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(descriptor_);
    throw UsageError(file_.string() + ": another process is at this study");
  }
}

RowFile::~RowFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void RowFile::fail() const {
  throw std::runtime_error(file_.string() + ": " + std::generic_category().message(errno));
}

void RowFile::go_on(const Contents& contents, const Layout& layout) {
  size_ = contents.end;
  if (::ftruncate(descriptor_, static_cast<off_t>(size_)) != 0) fail();
  if (::lseek(descriptor_, static_cast<off_t>(size_), SEEK_SET) < 0) fail();
  if (size_ == 0) write(layout.header + '\n');
}

void RowFile::write(const std::string& text) {
  std::string_view rest = text;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written > 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    } else if (written == 0 || errno != EINTR) {
      const int error = written == 0 ? ENOSPC : errno;
      // Removes an incomplete chunk; earlier ones remain.
      (void)!::ftruncate(descriptor_, static_cast<off_t>(size_));
      errno = error;
      fail();
    }
  }
  size_ += text.size();
}

void RowFile::append(const Chunk& chunk) {
  write(chunk.text);
  const auto now = std::chrono::steady_clock::now();
  if (now - synced_ < time_between_syncs) return;
  synced_ = now;
  if (::fdatasync(descriptor_) != 0 && errno != EINVAL) fail();
}

void RowFile::close() {
  const bool synced = ::fdatasync(descriptor_) == 0 || errno == EINVAL;
  if (!synced) fail();
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) fail();
}

void merge_rows(const std::vector<RowSource>& sources, const Layout& layout,
                const std::filesystem::path& file) {
  struct Piece {
    Segment segment;
    std::size_t source;
  };
  std::vector<Piece> pieces;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    for (const Segment& segment : sources[i].contents.segments) pieces.push_back({segment, i});
  }
  const bool ordered = std::is_sorted(
      pieces.begin(), pieces.end(),
      [](const Piece& a, const Piece& b) { return a.segment.range.first < b.segment.range.first; });
  if (sources.size() == 1 && sources[0].own && ordered) {
    std::filesystem::rename(sources[0].file, file);
    return;
  }
  std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
    return a.segment.range.first < b.segment.range.first;
  });
  const std::filesystem::path partly = file.string() + ".part";
  RowFile output(partly);
  output.go_on({}, layout);
  std::size_t at_source = sources.size();
  int descriptor = -1;
  const auto close = [&] {
    if (descriptor >= 0) ::close(descriptor);
  };
  try {
    Chunk chunk;
    for (const Piece& piece : pieces) {
      if (piece.source != at_source) {
        close();
        at_source = piece.source;
        descriptor = ::open(sources[at_source].file.c_str(), O_RDONLY | O_CLOEXEC);
      }
      std::uint64_t at = piece.segment.begin;
      while (at < piece.segment.end) {
        check_interrupt();
        constexpr std::uint64_t block = 1U << 20U;
        chunk.text.resize(std::min(block, piece.segment.end - at));
        const ssize_t got =
            ::pread(descriptor, chunk.text.data(), chunk.text.size(), static_cast<off_t>(at));
        if (got <= 0) {
          throw std::runtime_error(sources[at_source].file.string() +
                                   ": cannot be read: " + std::generic_category().message(errno));
        }
        chunk.text.resize(static_cast<std::size_t>(got));
        output.append(chunk);
        at += static_cast<std::uint64_t>(got);
      }
    }
    close();
    output.close();
  } catch (...) {
    close();
    std::error_code ignored;
    std::filesystem::remove(partly, ignored);
    throw;
  }
  std::filesystem::rename(partly, file);
}

}  // namespace sprag::study
