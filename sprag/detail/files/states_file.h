/// \file
/// \brief Reads and writes states CSV files: the state at ticks k = 0, 1, ...
///
/// The header is `k,t,q1,...,qf,u1,...,uf`. Values are those after events at the tick, with 17
/// significant digits. More columns may follow; StatesReader ignores them.
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

/// \brief Writes a states CSV. The first failure is kept: good() is false and error() describes it.
class StatesWriter : public CsvWriter {
 public:
  /// \brief Creates or empties a file and writes the header. A failure is reported by good().
  /// \param file its path.
  /// \param coordinates f.
  /// \param more names of additional columns.
  StatesWriter(const std::filesystem::path& file, Eigen::Index coordinates,
               const std::vector<std::string>& more = {});

  /// \brief Appends the row of a tick. A failure is reported by good().
  /// \param k number of the tick.
  /// \param t its time [s].
  /// \param q coordinates, f entries.
  /// \param u velocities, f entries.
  /// \param more values of the additional columns.
  void write(std::int64_t k, double t, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u,
             std::span<const double> more = {}) noexcept;
};

/// \brief State at one tick.
struct StateRow {
  std::int64_t k = 0;    ///< number of the tick
  double t = 0.0;        ///< [s]
  Eigen::VectorXd q, u;  ///< f entries each
};

/// \brief Reads a states CSV row by row.
class StatesReader {
 public:
  /// \brief Opens a file and reads its header.
  /// \param file its path.
  /// \throws InputError if the file cannot be opened or its header is not that of a states CSV.
  explicit StatesReader(const std::filesystem::path& file);

  /// \brief Number of coordinates, from the header.
  /// \return f.
  Eigen::Index coordinates() const { return coordinates_; }

  /// \brief Reads the next row.
  /// \param row receives the state.
  /// \return false at the end of the file or at damage, which ends the reading: a garbled or
  /// truncated line, a number that is not finite, a time that does not rise.
  bool next(StateRow& row);

  /// \brief Where and why reading stopped before the end of the file.
  /// \return empty if there was no damage.
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
