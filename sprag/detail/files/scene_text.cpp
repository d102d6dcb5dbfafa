#include "sprag/detail/files/scene_text.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <initializer_list>
#include <span>
#include <utility>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

std::vector<std::string_view> parts_of(std::string_view path) {
  std::vector<std::string_view> parts;
  split_fields(path, parts, '.');
  return parts;
}

toml::table parsed(std::string_view text, const std::string& file) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    const toml::source_position& at = error.source().begin;
    throw SceneError(file, static_cast<int>(at.line), static_cast<int>(at.column),
                     std::string(error.description()));
  }
}

const toml::node* child(const toml::node& node, std::string_view part) {
  if (const toml::table* table = node.as_table()) return table->get(part);
  const toml::array* array = node.as_array();
  std::size_t index = 0;
  const char* const end = part.data() + part.size();
  if (array == nullptr || std::from_chars(part.data(), end, index).ptr != end || index == 0) {
    return nullptr;
  }
  return array->get(index - 1);
}

const toml::node* find(const toml::table& root, std::span<const std::string_view> parts) {
  const toml::node* node = &root;
  for (std::size_t i = 0; node != nullptr && i < parts.size(); ++i) node = child(*node, parts[i]);
  return node;
}

// Byte offset of a position. Requires only ASCII characters before it on its line.
std::size_t offset(std::string_view text, const toml::source_position& position) {
  std::size_t at = 0;
  for (std::uint32_t line = 1; line < position.line; ++line) at = text.find('\n', at) + 1;
  return at + position.column - 1;
}

struct Edit {
  std::size_t from, to;
  std::string by;
};

std::string written(const SceneValue& value) {
  if (!value.array) return to_text(value.numbers.at(0));
  std::string text = "[";
  for (std::size_t i = 0; i < value.numbers.size(); ++i) {
    const bool begins = value.columns > 0 && i % value.columns == 0;
    if (i > 0) text += begins ? "],\n     " : ", ";
    if (begins) text += "[";
    text += to_text(value.numbers[i]);
  }
  if (value.columns > 0) text += "]";
  return text + "]";
}

// End of a table's last key, or of its header without keys.
std::size_t end_of(std::string_view text, const toml::table& table) {
  std::size_t end = offset(text, table.source().begin);
  for (const auto& [key, node] : table) {
    if (node.is_table() && !node.as_table()->is_inline()) continue;
    if (node.is_array_of_tables()) continue;
    end = std::max(end, offset(text, node.source().end));
  }
  return end;
}

Edit added(std::string_view text, const toml::table& table, std::string_view key,
           const std::string& value) {
  const std::size_t end = end_of(text, table);
  const std::string entry = std::string(key) + " = " + value;
  if (table.is_inline()) return {end, end, ", " + entry};
  const std::size_t line_end = std::min(text.find('\n', end), text.size());
  return {line_end, line_end, "\n" + entry};
}

std::string with_edits(std::string_view text, std::vector<Edit> edits) {
  std::stable_sort(edits.begin(), edits.end(),
                   [](const Edit& a, const Edit& b) { return a.from < b.from; });
  std::string edited;
  std::size_t at = 0;
  for (const Edit& edit : edits) {
    edited += text.substr(at, edit.from - at);
    edited += edit.by;
    at = edit.to;
  }
  edited += text.substr(at);
  return edited;
}

}  // namespace

std::string in_quotes(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04X", static_cast<unsigned>(c));
      quoted += escape;
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

std::string with_values(std::string_view text, const std::vector<SceneValue>& values,
                        const std::string& file) {
  const toml::table root = parsed(text, file);
  std::vector<Edit> edits;
  std::string end;
  std::string table_at_end;
  for (const SceneValue& value : values) {
    const std::vector<std::string_view> parts = parts_of(value.path);
    if (const toml::node* node = find(root, parts)) {
      const toml::source_region& at = node->source();
      edits.push_back({offset(text, at.begin), offset(text, at.end), written(value)});
      continue;
    }
    const toml::node* parent = find(root, std::span(parts).first(parts.size() - 1));
    if (parent != nullptr && parent->is_table()) {
      edits.push_back(added(text, *parent->as_table(), parts.back(), written(value)));
      continue;
    }
    if (parts.size() != 2) throw SceneError(file, "has no " + value.path);
    const std::string table(parts.front()), key(parts.back());
    if (table_at_end != table) end += "\n[" + table + "]\n";
    table_at_end = table;
    end += key + " = " + written(value) + "\n";
  }
  std::string edited = with_edits(text, std::move(edits));
  if (!end.empty() && !edited.empty() && edited.back() != '\n') edited += '\n';
  return edited + end;
}

namespace {

// The first part of a key, or of the name in a header.
std::string_view first_part(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t["), text.size()));
  if (text.empty()) return text;
  if (text[0] == '"' || text[0] == '\'') {
    const std::size_t end = end_of_token(text, 0);
    return end < 2 ? std::string_view() : text.substr(1, end - 2);
  }
  return text.substr(0, text.find_first_of(" \t.=]\r\n"));
}

// End of the statement at text[at], including its newline. A statement is a header, a key with its
// value, a comment or an empty line.
std::size_t end_of_statement(std::string_view text, std::size_t at) {
  int depth = 0;
  for (std::size_t i = at; i < text.size(); i = end_of_token(text, i)) {
    if (text[i] == '[' || text[i] == '{') ++depth;
    if (text[i] == ']' || text[i] == '}') --depth;
    if (text[i] == '\n' && depth <= 0) return i + 1;
  }
  return text.size();
}

}  // namespace

std::string without_table(std::string_view text, std::string_view table) {
  std::string left;
  std::string_view gap;  // empty lines and comments, kept or removed with the next statement
  bool at_root = true, inside = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = end_of_statement(text, at);
    const std::string_view statement = text.substr(at, end - at);
    const std::size_t first = statement.find_first_not_of(" \t\r\n");
    at = end;
    if (first == std::string_view::npos || statement[first] == '#') {
      gap = {gap.empty() ? statement.data() : gap.data(), gap.size() + statement.size()};
      continue;
    }
    const bool header = statement[first] == '[';
    const bool named = (header || at_root) && first_part(statement) == table;
    if (header) at_root = false;
    const bool goes = named || (inside && !header);
    // A comment before the table does not belong to it.
    if (!goes || !inside) left += gap;
    if (!goes) left += statement;
    gap = {};
    inside = goes && (header || !at_root);
  }
  return left + std::string(gap);
}

std::string with_files_from(std::string_view text, const std::filesystem::path& from,
                            const std::filesystem::path& to, const std::string& file) {
  namespace fs = std::filesystem;
  const toml::table root = parsed(text, file);
  std::vector<Edit> edits;
  const auto look_at = [&](const toml::table& table, const std::string& key) {
    const toml::node* node = table.get(key);
    if (node == nullptr || !node->is_string()) return;
    const fs::path named = node->as_string()->get();
    if (named.is_absolute()) return;
    // An empty folder is the current one.
    const fs::path seen =
        fs::proximate(fs::absolute(from / named), fs::absolute(to.empty() ? "." : to));
    if (seen == named) return;
    const toml::source_region& at = node->source();
    edits.push_back({offset(text, at.begin), offset(text, at.end), in_quotes(seen.string())});
  };
  for (const auto& [table, keys] :
       std::initializer_list<std::pair<const char*, std::vector<std::string>>>{
           {"beam", {"damping_ratio", "modal_damping"}},
           {"system", {"M", "C", "K", "damping_ratio", "modal_damping"}},
           {"excitation", {"influence", "file"}},
           {"force", {"direction", "file"}},
           {"contact", {"direction"}},
           {"output", {"direction"}},
           {"master", {"q", "u"}},
           {"replica", {"q", "u", "restitution", "uncertainty", "sigma_q", "sigma_u"}},
           {"adapt", {"within", "walk"}}}) {
    const toml::node* node = root.get(table);
    if (node == nullptr) continue;
    const auto look_at_all = [&, all = &keys](const toml::table& of) {
      for (const std::string& key : *all) look_at(of, key);
    };
    if (node->is_table()) look_at_all(*node->as_table());
    if (!node->is_array()) continue;
    for (const toml::node& of : *node->as_array()) {
      if (of.is_table()) look_at_all(*of.as_table());
    }
  }
  return with_edits(text, std::move(edits));
}

bool is_text(std::string_view text, std::string_view path, const std::string& file) {
  const toml::table root = parsed(text, file);
  const toml::node* node = find(root, parts_of(path));
  return node != nullptr && node->is_string();
}

bool has_key(std::string_view text, std::string_view path, const std::string& file) {
  return find(parsed(text, file), parts_of(path)) != nullptr;
}

double number_of(std::string_view text, std::string_view path, double fallback,
                 const std::string& file) {
  const toml::table root = parsed(text, file);
  const toml::node* node = find(root, parts_of(path));
  return node != nullptr ? node->value<double>().value_or(fallback) : fallback;
}

}  // namespace sprag
