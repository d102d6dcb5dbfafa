#include "sprag/detail/files/unsupported_key.h"

#include <algorithm>
#include <array>

#include "sprag/detail/files/csv.h"

namespace sprag {
namespace {

/// A word in a key, in lower case. `whole`: it must be the whole key or a part between underscores;
/// otherwise any substring matches.
struct Word {
  std::string_view text;
  bool whole = false;
};

constexpr std::array friction_words{
    Word{"friction"}, Word{"coulomb"}, Word{"tangent"}, Word{"stribeck"}, Word{"stiction"},
    Word{"sliding"},  Word{"slip"},    Word{"stick"},   Word{"mu", true}, Word{"mue", true}};
constexpr std::array compliance_words{Word{"stiffness"}, Word{"complian"}, Word{"hertz"},
                                      Word{"penalty"},   Word{"damp"},     Word{"spring"},
                                      Word{"k", true},   Word{"c", true}};
constexpr std::array nonlinear_words{Word{"nonlinear"}, Word{"non_linear"}, Word{"cubic"},
                                     Word{"duffing"},   Word{"quadratic"},  Word{"hysteres"}};
constexpr std::array gyroscopic_words{Word{"gyro"}, Word{"coriolis"}, Word{"circulatory"}};

bool has(std::string_view key, const Word& word) {
  for (std::size_t at = key.find(word.text); at != std::string_view::npos;
       at = key.find(word.text, at + 1)) {
    const std::size_t end = at + word.text.size();
    const bool begins = at == 0 || key[at - 1] == '_';
    const bool ends = end == key.size() || key[end] == '_';
    if (!word.whole || (begins && ends)) return true;
  }
  return false;
}

template <std::size_t n>
bool has_one(std::string_view key, const std::array<Word, n>& words) {
  return std::any_of(words.begin(), words.end(), [&](const Word& word) { return has(key, word); });
}

}  // namespace

std::optional<std::string> unsupported_key(std::string_view path, std::string_view key) {
  const std::string lower = lower_case(key);
  if (has_one(lower, friction_words)) {
    return "is not supported: contacts are frictionless, with a normal force alone. Leave the key "
           "out if friction is small; otherwise the model does not describe this machine";
  }
  if (path.starts_with("contact") && has_one(lower, compliance_words)) {
    return "is not supported: contacts are rigid, with a restitution as their only loss. Leave the "
           "key out if the contact lasts a small part of a period; otherwise the model does not "
           "describe this machine";
  }
  if (has_one(lower, nonlinear_words)) {
    return "is not supported: the machine is linear between impacts, M u' + C u + K q = f(t). Give "
           "the linear part about the working point";
  }
  if (!path.starts_with("contact") && has_one(lower, gyroscopic_words)) {
    return "is not supported: forces of the motion are those of symmetric C and K, without "
           "gyroscopic or circulatory ones";
  }
  return std::nullopt;
}

}  // namespace sprag
