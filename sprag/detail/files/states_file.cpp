#include "sprag/detail/files/states_file.h"

namespace sprag {

namespace {

std::string header(Eigen::Index coordinates, const std::vector<std::string>& more = {}) {
  std::string text = "k,t";
  for (const char* name : {",q", ",u"}) {
    for (Eigen::Index i = 1; i <= coordinates; ++i) {
      text += name;
      append_number(text, std::int64_t{i});
    }
  }
  for (const std::string& name : more) text += ',' + name;
  return text;
}

}  // namespace

StatesWriter::StatesWriter(const std::filesystem::path& file, Eigen::Index coordinates,
                           const std::vector<std::string>& more)
    : CsvWriter(OutputFile(file), header(coordinates, more),
                (static_cast<std::size_t>(2 * coordinates + 2) + more.size()) * 26) {}

void StatesWriter::write(std::int64_t k, double t, const Eigen::Ref<const Eigen::VectorXd>& q,
                         const Eigen::Ref<const Eigen::VectorXd>& u,
                         std::span<const double> more) noexcept {
  add(k);
  add(t);
  for (const double value : q) add(value);
  for (const double value : u) add(value);
  for (const double value : more) add(value);
  end_row();
}

StatesReader::StatesReader(const std::filesystem::path& file) : reader_(file) {
  std::string_view line;
  if (reader_.next(line) == LineReader::Result::line) {
    split_fields(line, fields_);
    columns_ = fields_.size();
    for (std::size_t i = 2; i < columns_ && fields_[i].starts_with('q'); ++i) ++coordinates_;
    const std::string expected = header(coordinates_);
    const bool more = line.size() > expected.size() && line[expected.size()] == ',';
    if (coordinates_ >= 1 && line.starts_with(expected) && (line == expected || more)) return;
  }
  throw InputError(file.string() + ":1: header must begin with k,t,q1,...,qf,u1,...,uf");
}

bool StatesReader::next(StateRow& row) {
  if (ended_) return false;
  std::string_view line;
  const LineReader::Result got = reader_.next(line);
  if (got == LineReader::Result::line) {
    if (!parse(line, row)) {
      damage_ = {reader_.number(), "garbled line (expected k,t,q1,...,uf, all finite)"};
    } else if (last_t_ && row.t <= *last_t_) {
      damage_ = {reader_.number(), "time does not rise"};
    }
    last_t_ = row.t;
  } else if (got != LineReader::Result::end) {
    damage_ = {reader_.number(), describe(got)};
  }
  ended_ = damage_ || got == LineReader::Result::end;
  return !ended_;
}

bool StatesReader::parse(std::string_view line, StateRow& row) {
  split_fields(line, fields_);
  if (fields_.size() != columns_) return false;
  const auto k = parse_integer(fields_[0]);
  const auto t = parse_double(fields_[1]);
  if (!k || !t) return false;
  row.k = *k;
  row.t = *t;
  row.q.resize(coordinates_);
  row.u.resize(coordinates_);
  for (Eigen::Index i = 0; i < coordinates_; ++i) {
    const auto q = parse_double(fields_[static_cast<std::size_t>(2 + i)]);
    const auto u = parse_double(fields_[static_cast<std::size_t>(2 + coordinates_ + i)]);
    if (!q || !u) return false;
    row.q[i] = *q;
    row.u[i] = *u;
  }
  return true;
}

}  // namespace sprag
