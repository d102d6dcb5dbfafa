// Runs programs in a directory of their own, one after the other.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_directory.h"

namespace sprag::test {

using Arguments = std::vector<std::string>;

/// The arguments of both, in this order.
inline Arguments operator+(Arguments left, const Arguments& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

class ProgramTest : public testing::Test {
 protected:
  struct Ended {
    int code;  ///< -1: did not end
    std::string out, err;
  };

  std::string path(const std::string& name) const { return (directory_ / name).string(); }

  Ended run(const std::string& program, Arguments arguments) {
    arguments.insert(arguments.begin(), program);
    Process process(std::move(arguments), directory_ / "",
                    "process_" + std::to_string(processes_++));
    const auto code = process.wait(std::chrono::seconds(120));
    return {code.value_or(-1), process.out(), process.err()};
  }

  TemporaryDirectory directory_;

 private:
  int processes_ = 0;
};

}  // namespace sprag::test
