// What the page shows at one moment, and the curves of a window, apart from how they travel.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/estimates/confidence.h"
#include "tools/view/history.h"
#include "tools/view/raster.h"

namespace sprag::view {

/// Whose estimate it is. `free`: no contacts are heard, the estimate goes on without them.
/// `waiting`: there is no estimate.
enum class Badge { waiting, free, replica, filter };
enum class EstimatorShown { unknown, replica, timing, both, adaptive };

const char* name(Badge badge);
const char* name(EstimatorShown estimator);

/// A state at one tick, as it came.
struct Shown {
  std::int64_t tick = 0;
  double t = 0.0;
  Eigen::VectorXd q, u;
};

struct Energy {
  std::int64_t k = 0;
  double t = 0.0, V = 0.0;
};

struct Suspect {
  double t = 0.0;
  int contact = 0;  ///< from 0
  Suspicion suspicion = Suspicion::none;
};

struct ContactShown {
  std::optional<double> gap, sigma, truth;  ///< of the estimate and the machine now
  std::optional<double> height;             ///< of its stop in the picture
  bool closed = false;                      ///< as reported
  std::size_t events = 0;
  std::optional<double> last;  ///< time of its last event
};

struct ParameterShown {
  std::string key;
  double value = 0.0, sigma = std::numeric_limits<double>::infinity();
};

struct Frame {
  std::optional<std::int64_t> session;
  Badge badge = Badge::waiting;
  bool from_filter = false;
  double penetration = 0.0;  ///< depth of the estimate inside a support [m]; 0: it is inside none
  EstimatorShown estimator = EstimatorShown::unknown;
  std::optional<Shown> now;      ///< the estimate for now, provisional
  std::optional<Shown> settled;  ///< the last tick that is final
  std::optional<Shown> truth;    ///< the machine's own, if it is on the bus
  std::optional<Energy> energy;  ///< the last row as sync_logger has it
  double bound = std::numeric_limits<double>::infinity();
  std::int64_t inconsistencies = 0;
  std::optional<Suspect> suspect;  ///< the last one

  /// Simulated seconds per second, as the machine's messages say; infinite: as fast as it can.
  double speed = 1.0;

  /// The picture of the machine, of one instant.
  double t = 0.0;
  double base = 0.0;
  std::vector<double> estimate, sigma, truth_shape;  ///< empty: not known
  std::vector<ContactShown> contacts;
  std::vector<ParameterShown> parameters;  ///< of an adaptive observer
};

/// Curves of one quantity, closures and energies in a window.
struct Curves {
  Window window;
  std::size_t quantity = 0;
  Rows estimate;                               ///< low, mean, high
  Rows guaranteed;                             ///< low, high: the machine is proven to be between
  Rows truth;                                  ///< one column
  Rows energy;                                 ///< V
  Rows bound;                                  ///< B
  std::vector<std::vector<Closure>> closures;  ///< by contact
  std::vector<Closure> penetrating;            ///< when the settled estimate was inside a support
  std::vector<Suspect> suspects;
};

/// A quantity that has a curve.
struct Quantity {
  enum class Kind { gap, coordinate, output };
  Kind kind;
  std::size_t index;
  std::string name;   ///< g1, q1, or an output's
  std::string label;  ///< for people
};

}  // namespace sprag::view
