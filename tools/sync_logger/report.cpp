#include "tools/sync_logger/report.h"

#include <nlohmann/json.hpp>

namespace sprag {

nlohmann::ordered_json to_json(const Pairing& pairing) {
  const SyncFigures& figures = pairing.figures();
  nlohmann::ordered_json json{{"rows", figures.rows}, {"sessions", figures.sessions}};
  if (figures.rows > 0) {
    json["t"] = {{"first", figures.first_t}, {"last", figures.last_t}};
    json["V"] = {{"first", figures.first_v},
                 {"last", figures.last_v},
                 {"max_growth", figures.max_growth},
                 {"max_growth_t", figures.max_growth_t}};
  }
  json["unpaired"] = {
      {"truth", figures.unpaired_truth + static_cast<std::int64_t>(pairing.waiting_truth())},
      {"estimate",
       figures.unpaired_estimate + static_cast<std::int64_t>(pairing.waiting_estimate())}};
  json["ignored"] = {{"doubled", figures.doubled},
                     {"late", figures.late},
                     {"old_session", figures.old_session},
                     {"wrong_truth_size", figures.wrong_truth_size},
                     {"wrong_estimate_size", figures.wrong_estimate_size}};
  return json;
}

}  // namespace sprag
