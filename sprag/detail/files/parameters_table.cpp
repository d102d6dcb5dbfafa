#include "sprag/detail/files/parameters_table.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sprag/detail/mechanics/definiteness.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

struct Entry {
  std::string key;
  const toml::table* table = nullptr;
  toml::source_position position;
};

bool is_parameter(const Scene& scene, const std::string& key) {
  try {
    parameter_of(scene, key);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

// Each part of a dotted key except the last is a table. A table is an entry if it is empty or
// contains sigma or consider, or if its path names a parameter and it contains anything but tables.
bool is_entry(const toml::table& table, const std::string& key, const Scene& scene) {
  if (table.empty() || table.contains("sigma") || table.contains("consider")) return true;
  const bool nested = std::all_of(table.begin(), table.end(),
                                  [](const auto& entry) { return entry.second.is_table(); });
  return !nested && is_parameter(scene, key);
}

void add_entries(const TomlTable& root, const toml::table& table, const std::string& path,
                 const Scene& scene, std::vector<Entry>& entries) {
  for (const auto& [part, node] : table) {
    if (path.empty() && (part.str() == "consider" || part.str() == "correlation")) continue;
    const std::string key =
        path.empty() ? std::string(part.str()) : path + '.' + std::string(part.str());
    if (!node.is_table()) {
      root.fail_type(node, root.path_of(key), "a table, as in " + key + " = { sigma = 0.01 }");
    }
    if (is_entry(*node.as_table(), key, scene)) {
      entries.push_back({key, node.as_table(), part.source().begin});
    } else {
      add_entries(root, *node.as_table(), key, scene, entries);
    }
  }
}

// toml++ sorts the keys of a table; this restores the order of the file.
std::vector<Entry> entries_of(const TomlTable& table, const Scene& scene) {
  std::vector<Entry> entries;
  add_entries(table, table.contents(), "", scene, entries);
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.position.line, a.position.column) <
           std::pair(b.position.line, b.position.column);
  });
  return entries;
}

void check_key(const TomlTable& table, const Entry& entry, const Scene& scene) {
  try {
    const Parameter unknown = parameter_of(scene, entry.key);
    if (!can_be_filtered(unknown)) {
      table.fail_at(entry.position,
                    table.path_of(entry.key) +
                        " is of the contact clock, which a filter cannot estimate; must be known, "
                        "or found by identify");
    }
  } catch (const std::invalid_argument& error) {
    table.fail_at(entry.position, "parameters: " + std::string(error.what()));
  }
}

// Index of the parameter that an entry of a correlation names.
Eigen::Index index_of(const TomlTable& table, const toml::node& node, const std::string& path,
                      const std::vector<std::string>& keys) {
  const auto* key = node.as_string();
  if (key == nullptr) {
    table.fail_type(node, path, "the key of a parameter, in quotes");
  }
  const auto at = std::find(keys.begin(), keys.end(), key->get());
  if (at == keys.end()) {
    std::string message = path + " is " + key->get() + ", which has no sigma here";
    for (const std::string& of : keys) {
      message += (of == keys.front() ? "; must be one of " : ", ") + of;
    }
    table.fail_at(node.source().begin, message);
  }
  return at - keys.begin();
}

void read_correlations(const TomlTable& table, ParameterUncertainty& parameters) {
  const Eigen::Index n = std::ssize(parameters.keys);
  Eigen::MatrixXd& correlation = parameters.correlation;
  correlation.setIdentity(n, n);
  if (!table.has("correlation")) return;
  const std::string all = table.path_of("correlation");
  const std::string shape = "an array of [\"key\", \"other key\", number]";
  const toml::node& given_pairs = *table.contents().get("correlation");
  const toml::array* pairs = given_pairs.as_array();
  if (pairs == nullptr) table.fail_type(given_pairs, all, shape);
  Eigen::MatrixXi given = Eigen::MatrixXi::Zero(n, n);
  for (std::size_t k = 0; k < pairs->size(); ++k) {
    const std::string path = all + "[" + std::to_string(k + 1) + "]";
    const toml::node& node = (*pairs)[k];
    const toml::array* pair = node.as_array();
    const toml::source_position at = node.source().begin;
    if (pair == nullptr) table.fail_type(node, path, "[\"key\", \"other key\", number]");
    if (pair->size() != 3) {
      table.fail_at(at, path + " has " + std::to_string(pair->size()) +
                            " entries; must have 3, [\"key\", \"other key\", number]");
    }
    const Eigen::Index i = index_of(table, (*pair)[0], path + "[1]", parameters.keys);
    const Eigen::Index j = index_of(table, (*pair)[1], path + "[2]", parameters.keys);
    const std::string& key = parameters.keys[static_cast<std::size_t>(i)];
    const std::string& other = parameters.keys[static_cast<std::size_t>(j)];
    if (i == j) {
      table.fail_at(at, path + " is of " + key + " with itself; must be of two parameters");
    }
    if (given(i, j) != 0) {
      table.fail_at(at, path + " is of " + key + " and " + other + " again; must be given once");
    }
    given(i, j) = given(j, i) = 1;
    correlation(i, j) = correlation(j, i) =
        table.number_at((*pair)[2], path + "[3]", {.low = -1.0, .high = 1.0});
  }
  if (n == 0) return;
  const Definiteness signs = definiteness(correlation);
  if (!signs.semidefinite) {
    table.fail("correlation", "makes a matrix with the eigenvalue " + rounded(signs.smallest) +
                                  "; must be positive semidefinite");
  }
}

}  // namespace

ParameterUncertainty read_parameters(const TomlTable& root, const Scene& scene) {
  ParameterUncertainty parameters;
  const auto table = root.open_table("parameters");
  if (!table) return parameters;
  const bool consider = table->boolean_or("consider", false);
  const std::vector<Entry> entries = entries_of(*table, scene);
  parameters.sigma.resize(std::ssize(entries));
  for (const Entry& entry : entries) {
    check_key(*table, entry, scene);
    if (std::find(parameters.keys.begin(), parameters.keys.end(), entry.key) !=
        parameters.keys.end()) {
      table->fail_at(entry.position,
                     table->path_of(entry.key) + " is listed again; must be listed once");
    }
    const TomlTable of =
        table->inside(*entry.table, table->path_of(entry.key), {"sigma", "consider"});
    parameters.sigma[std::ssize(parameters.keys)] = of.number("sigma", positive);
    parameters.consider.push_back(of.boolean_or("consider", consider));
    parameters.keys.push_back(entry.key);
  }
  read_correlations(*table, parameters);
  return parameters;
}

}  // namespace sprag
