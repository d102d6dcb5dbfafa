#include "tools/report/run.h"

#include <iostream>
#include <nlohmann/json.hpp>

#include "sprag/detail/files/output_file.h"
#include "tools/plot/script_text.h"
#include "tools/report/html.h"
#include "tools/report/inputs.h"
#include "tools/report/pdf.h"

namespace sprag::report {
namespace {

Format format_of(const ReportRun& run) {
  if (run.format != Format::by_name) return run.format;
  const std::string extension = run.output.extension().string();
  if (extension == ".html") return Format::html;
  if (extension == ".pdf") return Format::pdf;
  throw UsageError("--output: " + run.output.string() +
                   " is not allowed; must end in .html or .pdf, or --format must be given");
}

}  // namespace

int run_report(const ReportRun& run, const CommonOptions& common, nlohmann::ordered_json& report) {
  const Format format = format_of(run);
  const Inputs inputs = read_inputs(run.files, common);
  for (const ReadFile& file : inputs.files) {
    if (file.damage.empty()) continue;
    const std::string what = file.name + ": " + file.damage;
    std::cerr << what << "; the report shows everything before it\n";
    report["damage"].push_back(what);
  }
  const Document document = make_document(inputs, run.title, run.shown);
  for (const Section& section : document.sections) report["sections"].push_back(section.title);
  const std::string html = html_of(document, plot::drawn);
  write_file(run.output, format == Format::pdf ? pdf_of(html) : html);
  return inputs.damaged() ? exit_failed : exit_done;
}

}  // namespace sprag::report
