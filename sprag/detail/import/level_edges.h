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
      : threshold_(threshold),
        inverted_(inverted),
        level_(initially_low ? Level::low : Level::unknown) {}

  /// The edge at this level. At the first level of a channel whose state is unknown there is none.
  LevelChange take(double level) {
    const Level before = level_;
    level_ = (level > threshold_) != inverted_ ? Level::high : Level::low;
    if (before == Level::unknown || before == level_) return LevelChange::none;
    return level_ == Level::high ? LevelChange::rises : LevelChange::falls;
  }

  /// Whether the last level is high, after inversion; nullopt before the first one.
  std::optional<bool> high() const {
    if (level_ == Level::unknown) return std::nullopt;
    return level_ == Level::high;
  }

 private:
  enum class Level { unknown, low, high };

  double threshold_;
  bool inverted_;
  Level level_;
};

}  // namespace sprag
