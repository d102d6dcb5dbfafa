// States CSV `k,t,q1,...,qf,u1,...,uf`: the state at ticks k = 0, 1, ... (post-event values),
// 17 significant digits. More columns may follow, which readers of states pass over.
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

class StatesWriter : public CsvWriter {
 public:
  /// Creates or empties the file and writes the header for f = `coordinates`, with the names of the
  /// columns that follow; a failure shows in good().
  StatesWriter(const std::filesystem::path& file, Eigen::Index coordinates,
               const std::vector<std::string>& more = {});

  /// Appends the row of tick k at time t [s]; q and u have f entries, `more` one for each column
  /// that follows. Failures are remembered.
  void write(std::int64_t k, double t, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u,
             std::span<const double> more = {}) noexcept;
};

struct StateRow {
  std::int64_t k = 0;
  double t = 0.0;        ///< [s]
  Eigen::VectorXd q, u;  ///< f entries each
};

/// Reads a states CSV row by row.
class StatesReader {
 public:
  /// Throws InputError if the file cannot be opened or its header is not that of a states CSV.
  explicit StatesReader(const std::filesystem::path& file);

  /// f, from the header.
  Eigen::Index coordinates() const { return coordinates_; }

  /// Reads the next row. Returns false at the end of the file or at damage (a garbled or truncated
  /// line, a number that is not finite, a time that does not rise), which ends the reading.
  bool next(StateRow& row);

  /// Where and why reading stopped before the end of the file.
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
