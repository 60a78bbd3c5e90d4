#include "drivers/study/report/heights_json.h"

namespace epiline {

Json heights_json(const EstimatorStats& stats) {
  constexpr std::array kNames{"barometer", "range_finder"};
  Json json = Json::object();
  for (std::size_t i = 0; i < kHeightKinds; ++i) {
    if (stats.height_samples[i] + stats.height_refused[i] == 0) continue;
    json[kNames[i]] = {{"samples", stats.height_samples[i]},
                       {"refused", stats.height_refused[i]},
                       {"frames", stats.height_frames[i]},
                       {"jumps", stats.height_jumps[i]}};
  }
  return json;
}

Json wheels_json(const EstimatorStats& stats) {
  if (stats.wheel_samples + stats.wheel_refused == 0) return Json::object();
  return {{"samples", stats.wheel_samples},
          {"refused", stats.wheel_refused},
          {"frames", stats.wheel_frames},
          {"slips", stats.wheel_slips}};
}

}  // namespace epiline
