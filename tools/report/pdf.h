// HTML to PDF by chromium. (weasyprint 57 of Debian 12 cannot draw the symbols of gnuplot's SVG.)
#pragma once

#include <string>

namespace sprag::report {

/// Converts an HTML document without external resources to a PDF. Throws std::runtime_error, with
/// the name of the package, if chromium is not installed, and if it fails or takes longer than two
/// minutes.
std::string pdf_of(const std::string& html);

}  // namespace sprag::report
