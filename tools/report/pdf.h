// HTML to PDF by a program of Debian: chromium, else weasyprint.
#pragma once

#include <string>

namespace sprag::report {

/// Converts an HTML document without external resources to a PDF. Throws std::runtime_error, with
/// the names of the packages, if neither program is installed, and if the program fails or takes
/// longer than two minutes.
std::string pdf_of(const std::string& html);

}  // namespace sprag::report
