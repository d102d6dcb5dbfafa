#include "tools/report/html.h"

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "command_line/printable.h"
#include "sprag/version.h"

namespace sprag::report {
namespace {

constexpr std::string_view style = R"(
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 56rem; padding: 1rem 1rem 3rem; color: #1a1a1a; background: #fff;
  font: 1rem/1.5 "DejaVu Sans", Verdana, "Helvetica Neue", Arial, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0.5rem 0 0; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 0.5rem; border-bottom: 1px solid #ccc; break-after: avoid; }
p { margin: 0.5rem 0; }
.verdict { margin: 1rem 0; padding: 0.6rem 1rem; background: #f4f4f4; border-left: 0.4rem solid #7f7f7f; }
.verdict.good { border-color: #009e73; }
.verdict.bad { border-color: #d55e00; }
.verdict p { margin: 0.2rem 0; }
.about { font-size: 0.85em; color: #555; }
.scroll { overflow-x: auto; margin: 0.8rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; }
caption { text-align: left; padding: 0.3rem 0; color: #444; break-after: avoid; }
th, td { padding: 0.25rem 0.7rem 0.25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid #e2e2e2; overflow-wrap: normal; }
th { border-bottom-color: #888; }
td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
th.number { text-align: right; }
td.long { min-width: 14rem; overflow-wrap: anywhere; }
figure { margin: 1rem 0; break-inside: avoid; }
figure svg { display: block; width: 100%; min-width: 32rem; height: auto; }
figcaption { font-size: 0.9em; color: #444; }
footer { margin-top: 2.5rem; font-size: 0.85rem; color: #555; }
@page { size: A4; margin: 16mm 14mm; }
@media print {
  body { max-width: none; padding: 0; font-size: 9.5pt; }
  .scroll { overflow: visible; }
  figure svg { min-width: 0; max-width: 17cm; }
  table { font-size: 8.5pt; }
  tr, .verdict, .short { break-inside: avoid; }
}
)";

// A cell that is shown to the right: a number, or nothing.
bool is_number(const std::string& cell) {
  if (cell.empty()) return true;
  const std::size_t digit = cell.find_first_not_of("[+-");
  return digit != std::string::npos && digit <= 2 && cell[digit] >= '0' && cell[digit] <= '9' &&
         cell.find_first_not_of("0123456789+-.e% ±,[]") == std::string::npos;
}

bool all_numbers(const TextTable& table, std::size_t column) {
  return !table.rows.empty() &&
         std::all_of(table.rows.begin(), table.rows.end(),
                     [column](const auto& row) { return is_number(row[column]); });
}

std::string cell(const char* tag, const std::string& text, bool number) {
  constexpr std::size_t long_text = 40;
  const char* kind = number                    ? " class=\"number\""
                     : text.size() > long_text ? " class=\"long\""
                                               : "";
  return std::string("<") + tag + kind + ">" + escaped(text) + "</" + tag + ">";
}

std::string html_of(const TextTable& table) {
  constexpr std::size_t most_of_short = 8;  // rows; longer ones would leave much of a page empty
  const bool is_short = table.rows.size() <= most_of_short;
  std::string html =
      std::string("<div class=\"scroll") + (is_short ? " short" : "") + "\"><table>\n";
  if (!table.caption.empty()) html += "<caption>" + escaped(table.caption) + "</caption>\n";
  std::vector<bool> numbers;
  for (std::size_t i = 0; i < table.head.size(); ++i) numbers.push_back(all_numbers(table, i));
  html += "<thead><tr>";
  for (std::size_t i = 0; i < table.head.size(); ++i) html += cell("th", table.head[i], numbers[i]);
  html += "</tr></thead>\n<tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) html += cell("td", row[i], numbers[i]);
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

// Adds `prefix` to the identifiers of a tag: id="x", and references "#x" and url(#x).
std::string renamed(std::string_view tag, const std::string& prefix) {
  std::string result;
  for (std::size_t i = 0; i < tag.size(); ++i) {
    result += tag[i];
    const std::string_view before = tag.substr(0, i + 1);
    const bool is_id = before.ends_with(" id=\"") || before.ends_with(" id='") ||
                       before.ends_with("\tid=\"") || before.ends_with("\nid=\"");
    const bool is_reference =
        before.ends_with("href='#") || before.ends_with("href=\"#") || before.ends_with("url(#");
    if (is_id || is_reference) result += prefix;
  }
  return result;
}

// Value of an attribute of a tag; empty if it has none.
std::string_view attribute(std::string_view tag, std::string_view name) {
  const std::size_t at = tag.find(name);
  if (at == std::string_view::npos || at + name.size() >= tag.size()) return {};
  const char quote = tag[at + name.size()];
  const std::size_t begin = at + name.size() + 1;
  return tag.substr(begin, tag.find(quote, begin) - begin);
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\'':
        html += "&#39;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string inline_svg(const std::string& svg, const std::string& prefix,
                       const std::string& label) {
  const std::size_t begin = svg.find("<svg");
  const std::size_t end = svg.rfind("</svg>");
  if (begin == std::string::npos || end == std::string::npos || end < begin) {
    throw std::runtime_error("gnuplot has failed: there is no picture");
  }
  const std::string_view whole = std::string_view(svg).substr(begin, end - begin);
  // A browser would show the title of gnuplot's own as a hint.
  constexpr std::string_view own_title = "<title>Gnuplot</title>";
  const std::size_t title = whole.find(own_title);
  const std::size_t inside =
      title == std::string_view::npos ? whole.find('>') + 1 : title + own_title.size();
  std::string html = "<svg viewBox=\"" + escaped(std::string(attribute(whole, "viewBox="))) +
                     "\" role=\"img\" aria-label=\"" + escaped(label) + "\">";
  // Text between tags stays as it is.
  for (std::size_t i = inside; i < whole.size();) {
    const std::size_t tag = std::min(whole.find('<', i), whole.size());
    html += whole.substr(i, tag - i);
    const std::size_t close = std::min(whole.find('>', tag), whole.size());
    html += renamed(whole.substr(tag, close - tag), prefix);
    i = close;
    if (i < whole.size()) html += whole[i++];
  }
  return html + "</svg>";
}

std::string html_of(const Document& document,
                    const std::function<std::string(const std::string&)>& draw) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
      "'unsafe-inline'\">\n<title>" +
      escaped(document.title) + "</title>\n<style>" + std::string(style) +
      "</style>\n</head>\n<body>\n<h1>" + escaped(document.title) + "</h1>\n";
  for (const Verdict& verdict : document.verdicts) {
    const char* tone = verdict.tone == Tone::good  ? " good"
                       : verdict.tone == Tone::bad ? " bad"
                                                   : "";
    html += std::string("<div class=\"verdict") + tone + "\">\n<p class=\"about\">" +
            escaped(verdict.about) + "</p>\n<p><strong>" + escaped(verdict.first) + "</strong> " +
            escaped(verdict.second) + "</p>\n</div>\n";
  }
  int pictures = 0;
  for (const Section& section : document.sections) {
    html += "<section>\n<h2>" + escaped(section.title) + "</h2>\n";
    for (const Block& block : section.blocks) {
      if (const auto* paragraph = std::get_if<Paragraph>(&block)) {
        html += "<p>" + escaped(paragraph->text) + "</p>\n";
      } else if (const auto* table = std::get_if<TextTable>(&block)) {
        html += html_of(*table);
      } else if (const auto* picture = std::get_if<Picture>(&block)) {
        const std::string prefix = std::string("p").append(std::to_string(++pictures)).append("_");
        html += "<figure><div class=\"scroll\">" +
                inline_svg(draw(picture->script), prefix, picture->caption) + "</div><figcaption>" +
                escaped(picture->caption) + "</figcaption></figure>\n";
      }
    }
    html += "</section>\n";
  }
  return html + "<footer>Made by Sprag " SPRAG_VERSION
                ", program report.</footer>\n</body>\n</html>\n";
}

}  // namespace sprag::report
