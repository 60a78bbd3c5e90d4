#pragma once
// A flight some of whose IMU readings are corrupt: how good is what it calls tracking?
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/study/replay/replay.h"

namespace epiline::test {

enum class SpikeKind : std::uint8_t { kRate, kForce, kZeros, kStuck };
inline constexpr std::array kSpikeKindNames = {"rate", "force", "zeros", "stuck"};

struct Spike {
  SpikeKind kind = SpikeKind::kRate;
  double size = 0;        ///< added to one axis, rad/s or m/s^2; of zeros and stuck readings: none
  double at_s = 0;        ///< after the first image
  double stuck_s = 0.02;  ///< how long the values stay
};

/// Writes the spikes into the readings. Axis and sign are random, the same for the same `seed`.
void corrupt(std::vector<ImuSample>& readings, HostStamp first_image, const std::vector<Spike>& spikes,
             std::uint64_t seed);

struct SpikeVerdict {
  bool ran = false;
  double ate_m = 0;           ///< rms over all poses, aligned in yaw and translation
  double tracking_ate_m = 0;  ///< of that alignment, over the poses called tracking; 0 without any
  double tracking_share = 0;  ///< of the poses
  std::uint64_t resets = 0, suspects = 0, bridged = 0, gaps = 0;
  double first_pose_s = -1;  ///< after the first image; negative: never
};

/// Replays `options` with these spikes, and with noise of 1e-5 rad/s on the gyroscope that differs by seed; none for
/// seed 0. How much flights differ that differ by the seed only shows how much of an error is chance.
SpikeVerdict fly_with_spikes(ReplayOptions options, const std::vector<Spike>& spikes, std::uint64_t seed);

}  // namespace epiline::test
