#include "drivers/program/view/check_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/program/check/pacing.h"
#include "drivers/study/report/errors_json.h"

namespace epiline {

namespace {

constexpr double kSlowTurn = 0.15;  // rad/s: less may be a bias
constexpr double kLongestStep_s = 0.1;

template <class Stamps, class StampOf>
PacingResult pace(const Stamps& stamps, double seconds, StampOf stamp_of) {
  Pacing pacing;
  for (const auto& s : stamps)
    if ((stamp_of(stamps.back()) - stamp_of(s)).seconds() <= seconds) pacing.step(stamp_of(s), {});
  return pacing.result();
}

Json pace_json(const PacingResult& p) {
  return {{"hz", p.rate_hz()}, {"jitter_ms", 1e3 * p.jitter_s}, {"period_ms", 1e3 * p.period_s}};
}

/// The strongest oscillation, for words: Hz; 0: none that is faster than a hand.
double peak_hz(const std::vector<double>& density, double step_hz) {
  double strongest = 0, at_hz = 0;
  for (std::size_t i = 0; i < density.size(); ++i) {
    const double hz = step_hz * static_cast<double>(i + 1);
    if (hz < kFasterThanAHand_hz || density[i] <= strongest) continue;
    strongest = density[i];
    at_hz = hz;
  }
  return at_hz;
}

}  // namespace

void CheckModel::take(const Frame& frame, const TrackedFrame& tracked, double edge_px) {
  if (!sights_.empty() && frame.stamp <= sights_.back().stamp) return;
  sights_.push_back({frame.stamp, edge_px, tracked.features.size()});
  while ((frame.stamp - sights_.front().stamp).seconds() > kShown_s) sights_.pop_front();
}

void CheckModel::take(const ImuSample& sample) {
  if (!readings_.empty()) {
    const double step_s = (sample.stamp - readings_.back()).seconds();
    if (!(step_s > 0)) return;
    for (std::size_t i = 0; i < 3; ++i) {
      const double w = sample.angular_velocity_rad_s[i];
      if (std::abs(w) > kSlowTurn && step_s < kLongestStep_s) turned_[i] += std::abs(w) * step_s;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    rate_[i] = sample.angular_velocity_rad_s[i];
    force_[i] = sample.specific_force_m_s2[i];
  }
  readings_.push_back(sample.stamp);
  while ((sample.stamp - readings_.front()).seconds() > kPaced_s) readings_.pop_front();
  spectrum_.step(sample);
}

void CheckModel::take(double seconds, const Findings& findings) {
  seconds_ = seconds;
  findings_ = findings;
}

void CheckModel::note_accepted(const SettingHint& hint, const Status& written) {
  constexpr std::size_t kMostNotes = 20;
  if (written) accepted_.insert(name_of(hint));
  if (notes_.size() >= kMostNotes) notes_.erase(notes_.begin());
  notes_.push_back(written ? fmt::format("{} = {} is in the configuration; the check uses it when it is started again",
                                         name_of(hint), fmt::format("{:.6g}", hint.value))
                           : "not written: " + written.error().text());
}

void CheckModel::forget() {
  sights_.clear();
  readings_.clear();
  spectrum_ = {};
  turned_ = {};
}

std::string CheckModel::state_json() const {
  Json root;
  root["schema"] = 1;
  root["title"] = subject_.title;
  root["program"] = subject_.program;
  root["finished"] = finished_;
  root["seconds"] = seconds_;
  root["image"] = newest_image_;
  root["may_accept"] = subject_.may_accept;
  Json& findings = root["findings"] = Json::array();
  for (const Finding& f : findings_) {
    const bool has_hint = !f.hint.key.empty() && accepted_.count(name_of(f.hint)) == 0;
    findings.push_back({{"grade", kGradeNames[static_cast<std::size_t>(f.grade)]},
                        {"device", f.device},
                        {"text", f.text},
                        {"remedy", f.remedy},
                        {"setting", has_hint ? Json(name_of(f.hint)) : Json(nullptr)},
                        {"value", has_hint ? Json(f.hint.value) : Json(nullptr)}});
  }
  root["notes"] = notes_;
  Json& camera = root["camera"] = pace_json(pace(sights_, kPaced_s, [](const Sight& s) { return s.stamp; }));
  camera["edge_px"] = sights_.empty() ? 0 : sights_.back().edge_px;
  camera["tracks"] = sights_.empty() ? 0 : sights_.back().tracks;
  Json& edges = camera["edges"] = Json::array();  // seconds before the newest image, px
  for (const Sight& s : sights_)
    if (s.edge_px > 0) edges.push_back({(s.stamp - sights_.back().stamp).seconds(), s.edge_px});
  Json& imu = root["imu"] = pace_json(pace(readings_, kPaced_s, [](HostStamp s) { return s; }));
  imu["rate_rad_s"] = rate_;
  imu["force_m_s2"] = force_;
  imu["turned_rad"] = turned_;
  const ImuSpectrum s = spectrum_.result();
  root["spectrum"] = {{"step_hz", s.step_hz},
                      {"gyroscope", s.gyroscope},
                      {"accelerometer", s.accelerometer},
                      {"gyroscope_rms", s.gyroscope_rms},
                      {"accelerometer_rms", s.accelerometer_rms},
                      {"peak_hz", peak_hz(s.accelerometer, s.step_hz)},
                      {"gyroscope_configured", subject_.gyroscope_density},
                      {"accelerometer_configured", subject_.accelerometer_density}};
  // device names may hold any bytes
  return root.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace epiline
