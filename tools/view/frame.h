// Contents of the page at one instant (Frame) and curves of a time window (Curves), independent of
// their encoding.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/confidence.h"
#include "tools/view/history.h"
#include "tools/view/raster.h"

namespace sprag::view {

/// Source of the estimate shown. `free`: no contact messages arrive, the estimate is a free
/// prediction. `waiting`: there is no current estimate.
enum class Badge { waiting, free, replica, filter };
enum class EstimatorShown { unknown, replica, timing, both, adaptive };

const char* name(Badge badge);
const char* name(EstimatorShown estimator);

/// A state at one tick, as received.
struct Shown {
  std::int64_t tick = 0;
  double t = 0.0;
  Eigen::VectorXd q, u;
};

struct Energy {
  std::int64_t k = 0;
  double t = 0.0, V = 0.0;
};

/// The filter's innovation at a reported closing.
struct ClosingInnovation {
  double t = 0.0;
  int contact = 0;     ///< from 0
  double ratio = 0.0;  ///< gap of the estimate just before, over its standard deviation
};

struct Suspect {
  double t = 0.0;
  int contact = 0;  ///< from 0
  Suspicion suspicion = Suspicion::none;
};

struct ContactShown {
  std::optional<double> gap, sigma,
      truth;                     ///< gap and its deviation of the estimate, gap of the machine
  std::optional<double> height;  ///< of the stop in the picture
  bool closed = false;           ///< as reported
  std::size_t events = 0;
  std::optional<double> last;  ///< time of the last event
};

struct ParameterShown {
  std::string key;
  double value = 0.0, sigma = std::numeric_limits<double>::infinity();
};

struct Frame {
  std::optional<std::int64_t> session;
  Badge badge = Badge::waiting;
  bool from_filter = false;
  double penetration = 0.0;  ///< depth of the estimate inside a support [m]; 0: no penetration
  EstimatorShown estimator = EstimatorShown::unknown;
  std::optional<Shown> now;                     ///< latest provisional estimate
  std::optional<Shown> settled;                 ///< latest settled estimate
  std::optional<Shown> truth;                   ///< true state, if a simulated machine publishes it
  std::optional<Energy> energy;                 ///< last row, computed as in sync_logger
  std::optional<ClosingInnovation> innovation;  ///< the last one
  double bound = std::numeric_limits<double>::infinity();
  std::int64_t inconsistencies = 0;
  std::optional<Suspect> suspect;  ///< the latest

  /// Simulated seconds per second, as reported in contact messages; infinite: unpaced.
  double speed = 1.0;

  /// Picture of the machine at one instant.
  double t = 0.0;
  double base = 0.0;
  std::vector<double> estimate, sigma, truth_shape;  ///< empty: unknown
  std::vector<ContactShown> contacts;
  std::vector<ParameterShown> parameters;  ///< of an adaptive observer
};

/// Curves of one quantity, closures and energies in a window.
struct Curves {
  Window window;
  std::size_t quantity = 0;
  Rows estimate;    ///< low, mean, high
  Rows guaranteed;  ///< low, high: guaranteed bounds of the machine's value
  Rows truth;       ///< one column
  Rows energy;      ///< V
  Rows bound;       ///< B
  Rows innovation;  ///< ClosingInnovation::ratio
  std::vector<std::vector<Closure>> closures;  ///< by contact
  std::vector<Closure> penetrating;            ///< when the settled estimate was inside a support
  Rows input;                                  ///< the recorded or streamed input, one column
  std::vector<Suspect> suspects;
};

/// A quantity that has a curve.
struct Quantity {
  enum class Kind { gap, coordinate, output };
  Kind kind;
  std::size_t index;
  std::string name;   ///< g1, q1, or an output's
  std::string label;  ///< text of the page
};

}  // namespace sprag::view
