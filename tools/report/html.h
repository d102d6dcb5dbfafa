// A report as one HTML file: no script, no external resource, pictures as inline SVG.
#pragma once

#include <functional>
#include <string>

#include "tools/report/document.h"

namespace sprag::report {

/// `text` as HTML: one line without control characters, and without characters that HTML reads as
/// markup. All names in a report pass through it.
std::string escaped(const std::string& text);

/// An SVG of gnuplot for use within HTML: its <svg> element alone, which fills the width of its
/// place, with `label` as its description. Its identifiers and the references to them begin with
/// `prefix`, so that pictures of one page do not share any. Throws std::runtime_error if there is
/// no <svg> element.
std::string inline_svg(const std::string& svg, const std::string& prefix, const std::string& label);

/// Writes the document. `draw` converts a script of gnuplot to an SVG.
std::string html_of(const Document& document,
                    const std::function<std::string(const std::string&)>& draw);

}  // namespace sprag::report
