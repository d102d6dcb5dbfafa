// Reads and writes states CSV files: the state at ticks k = 0, 1, ...
//
// The header is `k,t,q1,...,qf,u1,...,uf`. Values are those after events at the tick, with 17
// significant digits. More columns may follow; StatesReader ignores them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/csv_writer.h"

namespace sprag {

/// Writes a states CSV. The first failure is kept: good() is false and error() describes it.
class StatesWriter : public CsvWriter {
 public:
  /// Creates or empties a file and writes the header with the names of additional columns. A
  /// failure is reported by good().
  StatesWriter(const std::filesystem::path& file, Eigen::Index coordinates,
               const std::vector<std::string>& more = {});

  /// Appends the row of tick k at t [s], f entries of q and u each. A failure is reported by
  /// good().
  void write(std::int64_t k, double t, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u,
             std::span<const double> more = {}) noexcept;
};

/// State at one tick.
struct StateRow {
  std::int64_t k = 0;    ///< number of the tick
  double t = 0.0;        ///< [s]
  Eigen::VectorXd q, u;  ///< f entries each
};

/// Reads a states CSV row by row.
class StatesReader {
 public:
  /// Opens a file and reads its header. Throws InputError if the file cannot be opened or its
  /// header is not that of a states CSV.
  explicit StatesReader(const std::filesystem::path& file);

  /// Number of coordinates f, from the header.
  Eigen::Index coordinates() const { return coordinates_; }

  /// Reads the next row. Returns false at the end of the file or at damage, which ends the reading:
  /// a garbled or truncated line, a number that is not finite, a time that does not rise.
  bool next(StateRow& row);

  /// Where and why reading stopped before the end of the file; empty without damage.
  const std::optional<FileProblem>& damage() const { return damage_; }

 private:
  bool parse(std::string_view line, StateRow& row);

  LineReader reader_;
  Eigen::Index coordinates_ = 0;
  std::size_t columns_ = 0;
  std::vector<std::string_view> fields_;
  std::optional<double> last_t_;
  std::optional<FileProblem> damage_;
  bool ended_ = false;
};

}  // namespace sprag
