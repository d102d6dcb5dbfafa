// Tables of tests/reference.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace sprag::test {

/// The rows of numbers of tests/reference/`name`.csv, without comments and header.
inline std::vector<std::vector<double>> reference_rows(const std::string& name) {
  std::ifstream file(SPRAG_SOURCE_DIR "/tests/reference/" + name + ".csv");
  EXPECT_TRUE(file) << name;
  std::vector<std::vector<double>> all;
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || std::isdigit(static_cast<unsigned char>(line[0])) == 0) continue;
    std::istringstream fields(line);
    std::string field;
    all.emplace_back();
    while (std::getline(fields, field, ',')) all.back().push_back(std::stod(field));
  }
  return all;
}

}  // namespace sprag::test
