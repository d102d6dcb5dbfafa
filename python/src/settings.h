// Arguments of Python functions that several parts of the module take, and their warnings.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sprag/observer.h"

namespace sprag::python {

/// Throws std::invalid_argument "`what` is "given"; must be ...", except for the choices.
[[noreturn]] void refuse_choice(const std::string& what, const std::string& given,
                                const std::vector<std::string>& choices);

/// The value of a name. Throws std::invalid_argument for an unknown one.
template <typename T>
T chosen(const std::string& what, const std::string& given,
         const std::vector<std::pair<std::string, T>>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, value] : choices) {
    if (name == given) return value;
    names.push_back(name);
  }
  refuse_choice(what, given, names);
}

/// Throws std::invalid_argument for an unknown name.
EstimatorKind to_estimator(const std::string& name);
/// Throws std::invalid_argument for an unknown name.
ObserverSettings to_settings(double tick, const std::string& estimator);

/// Issues a RuntimeWarning. Throws where the user has made it an exception.
void warn(const std::string& text);

}  // namespace sprag::python
