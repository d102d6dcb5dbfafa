#include "sprag/detail/files/matrix_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/text_lines.h"

namespace sprag {
namespace {

constexpr std::string_view mark = "%%MatrixMarket";

std::string shown(std::string_view text) {
  constexpr std::size_t longest = 30;
  std::string quoted = "'";
  quoted += text.substr(0, longest);
  quoted += text.size() > longest ? "...'" : "'";
  return quoted;
}

double number(std::string_view field, const TextLines& lines) {
  field = trimmed(field);
  std::string_view digits = field;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  double value = 0.0;
  const char* const end = digits.data() + digits.size();
  const auto [last, error] = std::from_chars(digits.data(), end, value);
  if (field.empty()) lines.fail(field, "a field is empty; must be a number");
  if (last != end || (error != std::errc() && error != std::errc::result_out_of_range)) {
    lines.fail(field, shown(field) + " is not a number; must be one, as 0.25 or 1e-3" +
                          (field.find(',') != std::string_view::npos ? " (decimal point)" : ""));
  }
  if (error != std::errc() || !std::isfinite(value)) {
    lines.fail(field, shown(field) + " is not a finite double; must be one");
  }
  return value;
}

Eigen::Index whole_number(std::string_view field, Eigen::Index low, Eigen::Index high,
                          const TextLines& lines) {
  Eigen::Index value = 0;
  const char* const end = field.data() + field.size();
  const auto [last, error] = std::from_chars(field.data(), end, value);
  if (error != std::errc() || last != end || value < low || value > high) {
    lines.fail(field, shown(field) + "; must be a whole number in " + std::to_string(low) + ".." +
                          std::to_string(high));
  }
  return value;
}

Eigen::MatrixXd rows_of(TextLines& lines, Eigen::Index largest) {
  std::optional<char> separator;
  std::vector<std::string_view> fields;
  std::vector<std::vector<double>> rows;
  while (lines.next_data("#%")) {
    const std::string_view line = lines.line();
    if (!separator) {
      const auto has = [&](char c) { return line.find(c) != std::string_view::npos; };
      separator = has(';') ? ';' : has(',') ? ',' : '\0';
    }
    if (*separator == '\0') {
      split_words(line, fields);
    } else {
      split_fields(line, fields, *separator);
    }
    if (static_cast<Eigen::Index>(std::max(fields.size(), rows.size() + 1)) > largest) {
      lines.fail("is larger than " + std::to_string(largest) + " x " + std::to_string(largest));
    }
    std::vector<double> row;
    for (const std::string_view field : fields) row.push_back(number(field, lines));
    if (!rows.empty() && row.size() != rows.front().size()) {
      lines.fail("the row has " + std::to_string(row.size()) + " numbers; must have " +
                 std::to_string(rows.front().size()) + ", as the rows before");
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) lines.fail_whole("has no numbers");
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()),
                         static_cast<Eigen::Index>(rows.front().size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    const std::vector<double>& row = rows[static_cast<std::size_t>(i)];
    std::copy(row.begin(), row.end(), matrix.row(i).begin());
  }
  return matrix;
}

struct MarketHeader {
  bool coordinates = false;
  bool symmetric = false;
};

MarketHeader market_header(const TextLines& lines) {
  const std::string words = lower_case(lines.line());
  std::vector<std::string_view> fields;
  split_words(words, fields);
  fields.resize(5);
  const auto must_be = [&](std::size_t i, std::initializer_list<std::string_view> allowed,
                           const char* text) {
    if (std::find(allowed.begin(), allowed.end(), fields[i]) != allowed.end()) return;
    lines.fail("is a file of '" + std::string(fields[i]) + "'; must be " + text);
  };
  must_be(1, {"matrix"}, "a matrix");
  must_be(2, {"coordinate", "array"}, "coordinate or array");
  must_be(3, {"real", "double", "integer"}, "real or integer");
  must_be(4, {"general", "symmetric"}, "general or symmetric");
  return {fields[2] == "coordinate", fields[4] == "symmetric"};
}

Eigen::MatrixXd market_matrix(TextLines& lines, Eigen::Index largest) {
  lines.next();
  const MarketHeader header = market_header(lines);
  std::vector<std::string_view> fields;
  const auto next = [&](std::size_t count, const std::string& what) {
    if (!lines.next_data("%")) lines.fail_whole("ends before " + what);
    split_words(lines.line(), fields);
    if (fields.size() != count) {
      lines.fail("the line has " + std::to_string(fields.size()) + " fields; must have " +
                 std::to_string(count) + ": " + what);
    }
  };
  next(header.coordinates ? 3 : 2,
       header.coordinates ? "rows, columns and entries" : "rows and columns");
  const Eigen::Index rows = whole_number(fields[0], 1, largest, lines);
  const Eigen::Index columns = whole_number(fields[1], 1, largest, lines);
  if (header.symmetric && rows != columns) lines.fail("is symmetric; must have as many columns");
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(rows, columns);
  const auto add = [&](Eigen::Index i, Eigen::Index j, double value) {
    matrix(i, j) += value;
    if (header.symmetric && i != j) matrix(j, i) += value;
  };
  if (header.coordinates) {
    constexpr Eigen::Index many = Eigen::Index{1} << 40;
    const Eigen::Index entries = whole_number(fields[2], 0, many, lines);
    for (Eigen::Index k = 0; k < entries; ++k) {
      next(3, "row, column and value of entry " + std::to_string(k + 1) + " of " +
                  std::to_string(entries));
      const Eigen::Index i = whole_number(fields[0], 1, rows, lines) - 1;
      const Eigen::Index j = whole_number(fields[1], 1, columns, lines) - 1;
      if (header.symmetric && j > i) {
        lines.fail("the entry lies above the diagonal; a symmetric file must have the lower half");
      }
      add(i, j, number(fields[2], lines));
    }
  } else {
    for (Eigen::Index j = 0; j < columns; ++j) {
      for (Eigen::Index i = header.symmetric ? j : 0; i < rows; ++i) {
        next(1, "the value of row " + std::to_string(i + 1) + ", column " + std::to_string(j + 1));
        add(i, j, number(fields[0], lines));
      }
    }
  }
  if (lines.next_data("%")) lines.fail("has more entries than it says");
  return matrix;
}

}  // namespace

Eigen::MatrixXd read_matrix_file(const std::filesystem::path& file, Eigen::Index largest) {
  const std::string text = read_regular_text(file);
  TextLines lines(file.string(), text);
  if (text.starts_with("\x93NUMPY") || text.starts_with("MATLAB ") || text.starts_with("PK\x03")) {
    lines.fail_whole("is no text; must be CSV or Matrix Market (numpy.savetxt, scipy.io.mmwrite)");
  }
  if (text.starts_with(mark)) return market_matrix(lines, largest);
  if (file.extension() == ".mtx") {
    lines.next();
    lines.fail("a Matrix Market file must begin with " + std::string(mark));
  }
  return rows_of(lines, largest);
}

}  // namespace sprag
