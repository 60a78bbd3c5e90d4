#include "drivers/study/report/errors_json.h"

namespace epiline {

namespace {

Json motion_json(const std::vector<MotionError>& motion) {
  Json list = Json::array();
  for (const MotionError& m : motion) {
    list.push_back({{"seconds", m.seconds},
                    {"translation_m", to_json(m.translation_m)},
                    {"rotation_deg", to_json(m.rotation_deg)},
                    {"pairs", m.translation_m.count}});
  }
  return list;
}

/// null without errors
Json curve_json(const CalibrationCurve& curve) {
  if (curve.errors == 0) return nullptr;
  return {{"errors", curve.errors}, {"share", curve.share}};
}

}  // namespace

Json to_json(const Summary& s) {
  if (s.count == 0)
    return {{"rmse", nullptr}, {"mean", nullptr}, {"median", nullptr}, {"p95", nullptr}, {"max", nullptr}};
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"p95", s.p95}, {"max", s.max}};
}

Json to_json(const TrajectoryErrors& e) {
  const auto if_any = [&](double value) { return e.poses > 0 ? std::optional(value) : std::nullopt; };
  Json rpe = Json::array();
  for (const RelativeError& r : e.rpe) {
    rpe.push_back({{"distance_m", r.distance_m},
                   {"translation_percent", r.translation_percent},
                   {"rotation_deg", r.rotation_deg},
                   {"pairs", r.pairs}});
  }
  return {{"poses", e.poses},
          {"coverage", nullptr},
          {"path_length_m", if_any(e.path_length_m)},
          {"ate_4dof_m", to_json(e.ate_4dof)},
          {"ate_se3_m", to_json(e.ate_se3)},
          {"ate_sim3_m", to_json(e.ate_sim3)},
          {"scale_error", if_any(e.scale_error)},
          {"yaw_drift_deg", if_any(e.yaw_drift_deg)},
          {"rpe", std::move(rpe)},
          {"motion", motion_json(e.motion)},
          {"nees_position", e.nees.position},
          {"nees_yaw", e.nees.yaw},
          {"nees_velocity", e.nees.velocity},
          {"nees_tilt", e.nees.tilt},
          {"calibration_curve",
           {{"probability", kClaimedProbabilities},
            {"position", curve_json(e.nees.curves.position)},
            {"yaw", curve_json(e.nees.curves.yaw)},
            {"velocity", curve_json(e.nees.curves.velocity)},
            {"tilt", curve_json(e.nees.curves.tilt)}}}};
}

Json evaluation_json(const TrajectoryErrors& errors, const std::string& align) {
  Json json = {{"schema", 1}};
  json.update(to_json(errors));
  json["align"] = align;
  json["ate_m"] = to_json(errors.ate(*alignment_from(align)));
  return json;
}

Error no_common_time(const std::string& estimate) {
  return {ErrorKind::kUsage, estimate, 0, "no pose at a time that the reference covers",
          "timestamps of the same clock in both files"};
}

}  // namespace epiline
