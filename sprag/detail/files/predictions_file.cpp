#include "sprag/detail/files/predictions_file.h"

#include "sprag/detail/files/impacts_file.h"

namespace sprag {

PredictionsWriter::PredictionsWriter(const std::filesystem::path& file)
    : CsvWriter(OutputFile(file), "made_at,certain_until,t,contact,kind,sigma_t", 160) {}

void PredictionsWriter::write(const Prediction& prediction) noexcept {
  const auto begin = [&] {
    add(prediction.made_at);
    add(prediction.certain_until);
  };
  for (const PredictedEvent& event : prediction.events) {
    begin();
    add(event.t);
    add(std::int64_t{event.contact} + 1);
    add(name(event.kind));
    add(event.sigma);
    end_row();
  }
  if (!prediction.events.empty()) return;
  begin();
  for (int empty = 0; empty < 4; ++empty) add("");
  end_row();
}

}  // namespace sprag
