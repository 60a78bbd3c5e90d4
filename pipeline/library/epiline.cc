#include "pipeline/library/epiline.h"

#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <string>

#include "pipeline/library/odometer.h"
#include "pipeline/library/state.h"
#include "pipeline/text/suspicion_text.h"

using epiline::Done;
using epiline::HostStamp;
using epiline::Odometer;
using epiline::Result;
using epiline::Status;

static_assert(sizeof(epiline_point) == sizeof(epiline::TrackPoint) &&
              alignof(epiline_point) == alignof(epiline::TrackPoint));

struct epiline_estimator {
  std::unique_ptr<Odometer> odometer;
  epiline_state state{};
  std::string error, explanation;

  int taken(const Status& status) {
    if (status) return 0;
    error = status.error().text();
    return -1;
  }
};

namespace {

Result<std::unique_ptr<Odometer>> odometer_of(const char* settings, epiline_input input) {
  const auto file = epiline::ConfigFile::parse(settings, "settings");
  if (!file) return file.error();
  return Odometer::create(*file, input == EPILINE_IMAGES);
}

/// Reasons by name, then what the flight contradicts.
std::string explanation_of(const epiline::Health& health, const epiline::Suspicions& suspicions) {
  std::string text = epiline::kHealthStateNames[static_cast<std::size_t>(health.state)];
  const char* separator = ": ";
  for (std::size_t i = 0; i < epiline::kHealthReasonNames.size(); ++i) {
    if ((health.reasons >> i & 1U) == 0) continue;
    text.append(separator).append(epiline::kHealthReasonNames[i]);
    separator = ", ";
  }
  for (const std::string& suspicion : epiline::texts_of(suspicions)) text.append("; ").append(suspicion);
  return text;
}

}  // namespace

extern "C" {

const char* epiline_version() { return EPILINE_VERSION; }

epiline_estimator* epiline_create(const char* settings, epiline_input input, char* error, size_t error_size) {
  std::string why;
  try {
    auto odometer = odometer_of(settings, input);
    if (odometer) return new epiline_estimator{std::move(*odometer), {}, {}, {}};
    why = odometer.error().text();
  } catch (const std::exception& e) {
    why = e.what();
  }
  if (error != nullptr && error_size > 0) std::snprintf(error, error_size, "%s", why.c_str());
  return nullptr;
}

void epiline_destroy(epiline_estimator* estimator) { delete estimator; }

int epiline_push_imu(epiline_estimator* estimator, int64_t ns, const double angular_velocity_rad_s[3],
                     const double specific_force_m_s2[3]) {
  epiline::ImuSample sample;
  sample.stamp = HostStamp{ns};
  for (std::size_t i = 0; i < 3; ++i) {
    sample.angular_velocity_rad_s[i] = angular_velocity_rad_s[i];
    sample.specific_force_m_s2[i] = specific_force_m_s2[i];
  }
  return estimator->taken(estimator->odometer->push_imu(sample));
}

int epiline_push_image(epiline_estimator* estimator, int64_t ns, const uint8_t* grey, int width, int height,
                       int stride) {
  epiline::Frame image;
  image.stamp = HostStamp{ns};
  image.data = grey;
  image.width = width;
  image.height = height;
  image.stride = stride;
  return estimator->taken(estimator->odometer->push_image(image));
}

int epiline_push_tracks(epiline_estimator* estimator, int64_t ns, const epiline_point* points, size_t count) {
  const auto* const first = reinterpret_cast<const epiline::TrackPoint*>(points);
  return estimator->taken(estimator->odometer->push_tracks(HostStamp{ns}, {first, count}));
}

int epiline_push_wheel(epiline_estimator* estimator, int64_t ns, double forward_speed_m_s) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();  // the yaw rate
  return estimator->taken(estimator->odometer->push_wheel({HostStamp{ns}, forward_speed_m_s, kUnknown}));
}

int epiline_push_height(epiline_estimator* estimator, int64_t ns, epiline_height kind, double metres) {
  const auto of = kind == EPILINE_BAROMETER ? epiline::HeightKind::kBarometer : epiline::HeightKind::kRangeFinder;
  return estimator->taken(estimator->odometer->push_height({HostStamp{ns}, of, metres}));
}

void epiline_end(epiline_estimator* estimator) { estimator->odometer->end(); }

int epiline_step(epiline_estimator* estimator) {
  if (!estimator->odometer->step()) return 0;
  estimator->state = epiline::state_of(estimator->odometer->outcome());
  return 1;
}

const epiline_state* epiline_get_state(const epiline_estimator* estimator) { return &estimator->state; }

const char* epiline_explain(epiline_estimator* estimator) {
  const Odometer& odometer = *estimator->odometer;
  estimator->explanation = explanation_of(odometer.outcome().odometry.health, odometer.stats().suspicions);
  return estimator->explanation.c_str();
}

const char* epiline_error(const epiline_estimator* estimator) { return estimator->error.c_str(); }

}  // extern "C"
