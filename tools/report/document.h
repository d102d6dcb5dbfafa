// Content of a report, independent of its format: verdicts, then sections of paragraphs, tables and
// pictures.
#pragma once

#include <string>
#include <variant>
#include <vector>

namespace sprag::report {

struct Paragraph {
  std::string text;
};

struct TextTable {
  std::string caption;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;  ///< as many cells as `head`
};

struct Picture {
  std::string caption;
  std::string script;  ///< of gnuplot, for an SVG
};

using Block = std::variant<Paragraph, TextTable, Picture>;

struct Section {
  std::string title;
  std::vector<Block> blocks;
};

enum class Tone { good, bad, neutral };

/// Two sentences.
struct Verdict {
  std::string about;  ///< program and run
  std::string first, second;
  Tone tone = Tone::neutral;
};

struct Document {
  std::string title;
  std::vector<Verdict> verdicts;
  std::vector<Section> sections;
};

}  // namespace sprag::report
