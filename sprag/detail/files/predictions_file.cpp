#include "sprag/detail/files/predictions_file.h"

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/impacts_file.h"

namespace sprag {

PredictionsWriter::PredictionsWriter(const std::filesystem::path& file)
    : CsvWriter(OutputFile(file), "made_at,certain_until,t,contact,kind,sigma_t", 160) {}

void PredictionsWriter::write(const Prediction& prediction) noexcept {
  const auto begin = [&] {
    row_.clear();
    append_number(row_, prediction.made_at);
    row_ += ',';
    append_number(row_, prediction.certain_until);
    row_ += ',';
  };
  for (const PredictedEvent& event : prediction.events) {
    begin();
    append_number(row_, event.t);
    row_ += ',';
    append_number(row_, std::int64_t{event.contact} + 1);
    row_ += ',';
    row_ += name(event.kind);
    row_ += ',';
    append_number(row_, event.sigma);
    row_ += '\n';
    file_.write(row_);
  }
  if (!prediction.events.empty()) return;
  begin();
  row_ += ",,,\n";
  file_.write(row_);
}

}  // namespace sprag
