// A mass of 1 kg under gravity above a support.
#pragma once

#include <string>

#include "sprag/scene_file.h"

namespace sprag::test {

/// C [N s/m]; lines of [impact]; `rest` follows the lines of [[contact]].
inline Scene ball(const std::string& C, const std::string& impact, const std::string& rest) {
  return parse_scene("[system]\nM = [[1.0]]\nC = [[" + C +
                         "]]\nK = [[0.0]]\n[[force]]\ndirection = [1.0]\nconstant = -9.81\n"
                         "[impact]\n" +
                         impact + "\n[[contact]]\ndirection = [1.0]\n" + rest,
                     "ball.toml");
}

}  // namespace sprag::test
