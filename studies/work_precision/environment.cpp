#include "studies/work_precision/environment.h"

#include <sys/utsname.h>

#include <Eigen/Core>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#ifdef SPRAG_HAS_ODEINT
#include <boost/version.hpp>
#endif
#ifdef SPRAG_HAS_CVODE
#include <sundials/sundials_config.h>
#endif
#ifdef SPRAG_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

#ifndef SPRAG_BUILD_FLAGS
#define SPRAG_BUILD_FLAGS ""
#endif

namespace sprag::work_precision {
namespace {

std::string cpu() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line)) {
    const auto colon = line.find(": ");
    if (line.compare(0, 10, "model name") == 0 && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

std::string kernel() {
  utsname names{};
  if (uname(&names) != 0) return "unknown";
  return std::string(names.sysname) + " " + names.release + " " + names.machine;
}

std::string date() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  return {text, std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc)};
}

nlohmann::ordered_json libraries() {
  nlohmann::ordered_json versions{{"Eigen", std::to_string(EIGEN_WORLD_VERSION) + "." +
                                                std::to_string(EIGEN_MAJOR_VERSION) + "." +
                                                std::to_string(EIGEN_MINOR_VERSION)}};
#ifdef SPRAG_HAS_ODEINT
  versions["Boost"] = BOOST_LIB_VERSION;
#endif
#ifdef SPRAG_HAS_SICONOS
  versions["Siconos"] = SPRAG_SICONOS_LIBRARY;
#endif
#ifdef SPRAG_HAS_CVODE
  versions["SUNDIALS"] = SUNDIALS_VERSION;
#endif
#ifdef SPRAG_HAS_MUJOCO
  versions["MuJoCo"] = mj_versionString();
#endif
  return versions;
}

}  // namespace

nlohmann::ordered_json environment() {
  return {{"cpu", cpu()},
          {"kernel", kernel()},
          {"compiler", __VERSION__},
          {"flags", SPRAG_BUILD_FLAGS},
          {"date", date()},
          {"libraries", libraries()}};
}

}  // namespace sprag::work_precision
