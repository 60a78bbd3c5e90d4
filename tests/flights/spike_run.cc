#include "tests/flights/spike_run.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "drivers/study/evaluate/errors.h"
#include "drivers/study/report/stats_json.h"

namespace epiline::test {

namespace {
/// Far below any sensor's noise.
void stir(std::vector<ImuSample>& readings, std::uint64_t seed) {
  if (seed == 0) return;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1e-5);
  for (ImuSample& r : readings)
    for (double& w : r.angular_velocity_rad_s) w += noise(random);
}
}  // namespace

void corrupt(std::vector<ImuSample>& readings, HostStamp first_image, const std::vector<Spike>& spikes,
             std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (const Spike& spike : spikes) {
    const HostStamp at = first_image + Span::from_seconds(spike.at_s);
    const auto hit = std::find_if(readings.begin(), readings.end(), [&](const ImuSample& r) { return r.stamp >= at; });
    const std::size_t axis = random() % 3;
    const double size = random() % 2 == 0 ? spike.size : -spike.size;
    if (hit == readings.end()) continue;
    switch (spike.kind) {
      case SpikeKind::kRate:
        hit->angular_velocity_rad_s[axis] += size;
        break;
      case SpikeKind::kForce:
        hit->specific_force_m_s2[axis] += size;
        break;
      case SpikeKind::kZeros:
        hit->angular_velocity_rad_s = hit->specific_force_m_s2 = {};
        break;
      case SpikeKind::kStuck:
        for (auto r = hit; r != readings.end() && (r->stamp - hit->stamp).seconds() < spike.stuck_s; ++r) {
          r->angular_velocity_rad_s = hit->angular_velocity_rad_s;
          r->specific_force_m_s2 = hit->specific_force_m_s2;
        }
        break;
    }
  }
}

SpikeVerdict fly_with_spikes(ReplayOptions options, const std::vector<Spike>& spikes, std::uint64_t seed) {
  SpikeVerdict v;
  const auto dataset = open_asl_dataset(options.dataset, options.camera, {}, {});
  if (!dataset || dataset->instants_count() == 0) return v;
  const HostStamp first = dataset->instant(0) + Span::from_seconds(options.start_s);
  options.alter = [&](AslDataset& altered) {
    stir(altered.imu_samples, seed);
    corrupt(altered.imu_samples, first, spikes, seed);
  };
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result || !result->record.truth) return v;
  const FlightRecord& record = result->record;
  v.ran = true;
  v.resets = record.estimator.resets;
  v.suspects = record.estimator.imu_suspect;
  v.bridged = record.estimator.imu_bridged;
  v.gaps = record.estimator.imu_gaps;
  v.first_pose_s = start_seconds(record).value_or(-1);
  const Overlay o = overlay(trajectory_of(record), *record.truth);
  if (o.pairs.size() < 3) return v;
  std::vector<const ImageRecord*> with_pose;
  for (const ImageRecord& image : record.images)
    if (image.has_pose) with_pose.push_back(&image);
  double sum = 0, tracking_sum = 0;
  std::size_t tracking = 0;
  for (const PosePair& pair : o.pairs) {
    const double square = (o.T(pair.estimate.p_WB) - pair.reference.p_WB).squaredNorm();
    sum += square;
    if (with_pose[pair.index]->health.state != HealthState::kTracking) continue;
    tracking_sum += square;
    ++tracking;
  }
  v.ate_m = std::sqrt(sum / static_cast<double>(o.pairs.size()));
  v.tracking_ate_m = std::sqrt(tracking_sum / static_cast<double>(std::max<std::size_t>(1, tracking)));
  v.tracking_share = static_cast<double>(tracking) / static_cast<double>(o.pairs.size());
  return v;
}

}  // namespace epiline::test
