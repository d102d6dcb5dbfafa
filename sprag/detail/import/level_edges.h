// Finds the edges in the levels of a channel.
#pragma once

#include <optional>

namespace sprag {

/// Which edges of a level are impacts; `closed`: none, the contact is closed while the level is
/// high.
enum class Edge { closed, rising, falling, both };

enum class LevelChange { none, rises, falls };

class LevelEdges {
 public:
  /// A level above the threshold is high; `inverted`: low. `initially_low`: the channel is known to
  /// be low before the first level, else the first one is that of the start.
  LevelEdges(double threshold, bool inverted, bool initially_low = false)
      : threshold_(threshold), inverted_(inverted) {
    if (initially_low) high_ = false;
  }

  /// The edge at this level. At the first level of a channel whose state is unknown there is none.
  LevelChange take(double level) {
    const bool high = (level > threshold_) != inverted_;
    const bool changes = high_.has_value() && *high_ != high;
    high_ = high;
    if (!changes) return LevelChange::none;
    return high ? LevelChange::rises : LevelChange::falls;
  }

  /// Whether the last level is high, after inversion; nullopt before the first one.
  std::optional<bool> high() const { return high_; }

 private:
  double threshold_;
  bool inverted_;
  std::optional<bool> high_;
};

}  // namespace sprag
