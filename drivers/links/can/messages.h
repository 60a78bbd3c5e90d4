#pragma once
// Our messages on a CAN bus: the one table from which frames are packed (frames.cc) and the DBC file is written
// (dbc.cc). A change of it is a change for every reader: count kLayoutVersion on. Page: docs/can.md.
#include <algorithm>
#include <array>
#include <cstdint>
#include <tuple>

#include "drivers/links/can/signal.h"

namespace epiline::can {

inline constexpr int kLayoutVersion = 1;
inline constexpr std::array kStateNames = {"initialising", "tracking", "degraded", "lost", "silent"};

/// Every message begins with these; Crc stands in byte 0 and covers the rest.
inline constexpr Signal kCrc = {
    "Crc",
    Quantity::kCrc,
    0,
    8,
    Coding::kCounter,
    1,
    "",
    "CRC-8 SAE J1850 (polynomial 0x1D, start 0xFF, inverted at the end) over the identifier "
    "(two bytes, lower first) and bytes 1 to the last"};
inline constexpr Signal kEpoch = {
    "Epoch", Quantity::kEpoch, 8, 4, Coding::kCounter, 1, "", "The same in all frames of one instant"};
inline constexpr Signal kAlive = {
    "Alive", Quantity::kAlive, 12, 4, Coding::kCounter, 1, "", "One more with each frame of this identifier"};

inline constexpr const char* kPositionText = "of the IMU in the world: z up, zero where the flight began";
inline constexpr const char* kVelocityText = "in the vehicle's axes: x forward, y left, z up";
inline constexpr const char* kTimeText = "Instant of the estimate on the sender's monotonic clock";
inline constexpr const char* kAgeText = "From the instant of the estimate to this frame";
inline constexpr const char* kResetText =
    "One more with each jump of position or heading, and when odometry goes on after a stop";
inline constexpr const char* kAttitudeText =
    "Quaternion that turns the vehicle's axes (forward, left, up) into the world's: the three numbers beside the "
    "largest, in the order w, x, y, z; the largest is positive and follows from the norm 1";
inline constexpr const char* kQuaternionText =
    "Quaternion that turns the vehicle's axes (forward, left, up) into the world's";
inline constexpr const char* kReasonsText = "Bits: why the state is what it is";
inline constexpr const char* kSdText = "Standard deviation";

inline constexpr const char* kAttitudeSdText =
    "Standard deviation, about the axes of the world: z is that of the heading";
inline constexpr const char* kVelocitySdText = "Standard deviation, along the vehicle's axes";

/// Three in a row in a frame, of three quantities in a row.
constexpr std::array<Signal, 3> vector_of(const std::array<const char*, 3>& names, Quantity first, std::uint16_t start,
                                          std::uint8_t length, Coding coding, double scale, const char* unit,
                                          const char* comment) {
  const auto element = [&](std::uint8_t i) {
    return Signal{names[i], after(first, i), static_cast<std::uint16_t>(start + i * length), length, coding, scale,
                  unit,     comment};
  };
  return {element(0), element(1), element(2)};
}

/// One array of several.
template <class T, std::size_t N, class... Parts>
constexpr auto joined(const std::array<T, N>& first, const Parts&... parts) {
  std::array<T, N + (std::tuple_size_v<Parts> + ...)> all{};
  auto at = std::copy(first.begin(), first.end(), all.begin());
  ((at = std::copy(parts.begin(), parts.end(), at)), ...);
  return all;
}

/// The signals of a message: those that each begins with, and `parts`, which are arrays.
constexpr auto framed(const auto&... parts) { return joined(std::array{kCrc, kEpoch, kAlive}, parts...); }

inline constexpr auto kStatusSignals = framed(std::array{
    Signal{"State", Quantity::kState, 16, 4, Coding::kUnsigned, 1, "",
           "Odometry is sent while tracking or degraded; silent: the estimator says nothing"},
    Signal{"Version", Quantity::kVersion, 20, 4, Coding::kUnsigned, 1, "", "Of this layout"},
    Signal{"Quality", Quantity::kQuality, 24, 8, Coding::kUnsigned, 1, "%", ""},
    Signal{"ResetCounter", Quantity::kResetCounter, 32, 8, Coding::kCounter, 1, "", kResetText},
    Signal{"Reasons", Quantity::kReasons, 40, 24, Coding::kCounter, 1, "", kReasonsText},
});
inline constexpr auto kTimeSignals = framed(std::array{
    Signal{"Time", Quantity::kTime, 16, 48, Coding::kUnsigned, 1, "us", kTimeText},
});
inline constexpr auto kPositionXySignals = framed(std::array{
    Signal{"PositionX", Quantity::kPositionX, 16, 24, Coding::kSigned, 1e-3, "m", kPositionText},
    Signal{"PositionY", Quantity::kPositionY, 40, 24, Coding::kSigned, 1e-3, "m", kPositionText},
});
inline constexpr auto kPositionZSignals = framed(std::array{
    Signal{"PositionZ", Quantity::kPositionZ, 16, 24, Coding::kSigned, 1e-3, "m", kPositionText},
    Signal{"Age", Quantity::kAge, 40, 16, Coding::kUnsigned, 1e-5, "s", kAgeText},
    Signal{"ResetCounter", Quantity::kResetCounter, 56, 8, Coding::kCounter, 1, "", kResetText},
});
inline constexpr auto kAttitudeSignals =
    framed(std::array{Signal{"AttitudeLargest", Quantity::kSmallestThreeLargest, 16, 2, Coding::kCounter, 1, "",
                             "Which of w, x, y, z is left out: the one with the largest magnitude"}},
           vector_of({"AttitudeA", "AttitudeB", "AttitudeC"}, Quantity::kSmallestThreeA, 18, 15, Coding::kSigned, 5e-5,
                     "", kAttitudeText));
inline constexpr auto kVelocitySignals = framed(vector_of({"VelocityX", "VelocityY", "VelocityZ"}, Quantity::kVelocityX,
                                                          16, 16, Coding::kSigned, 2e-3, "m/s", kVelocityText));
inline constexpr auto kRateSignals = framed(
    vector_of({"RateX", "RateY", "RateZ"}, Quantity::kRateX, 16, 16, Coding::kSigned, 1e-3, "rad/s", kVelocityText));
inline constexpr auto kPositionSdSignals =
    framed(vector_of({"PositionSdX", "PositionSdY", "PositionSdZ"}, Quantity::kPositionSdX, 16, 16, Coding::kUnsigned,
                     1e-3, "m", kSdText));
inline constexpr auto kAttitudeSdSignals =
    framed(vector_of({"AttitudeSdX", "AttitudeSdY", "AttitudeSdZ"}, Quantity::kAttitudeSdX, 16, 16, Coding::kUnsigned,
                     1e-4, "rad", kAttitudeSdText));
inline constexpr auto kVelocitySdSignals =
    framed(vector_of({"VelocitySdX", "VelocitySdY", "VelocitySdZ"}, Quantity::kVelocitySdX, 16, 16, Coding::kUnsigned,
                     1e-3, "m/s", kVelocitySdText));
/// One frame of CAN FD in place of six classic ones.
inline constexpr auto kOdometrySignals = framed(
    std::array{Signal{"Time", Quantity::kTime, 16, 48, Coding::kUnsigned, 1, "us", kTimeText}},
    vector_of({"PositionX", "PositionY", "PositionZ"}, Quantity::kPositionX, 64, 32, Coding::kSigned, 1e-4, "m",
              kPositionText),
    std::array{Signal{"QuaternionW", Quantity::kQuaternionW, 160, 24, Coding::kSigned, 2e-7, "", kQuaternionText}},
    vector_of({"QuaternionX", "QuaternionY", "QuaternionZ"}, Quantity::kQuaternionX, 184, 24, Coding::kSigned, 2e-7, "",
              kQuaternionText),
    vector_of({"VelocityX", "VelocityY", "VelocityZ"}, Quantity::kVelocityX, 256, 24, Coding::kSigned, 1e-4, "m/s",
              kVelocityText),
    vector_of({"RateX", "RateY", "RateZ"}, Quantity::kRateX, 328, 24, Coding::kSigned, 1e-5, "rad/s", kVelocityText),
    std::array{Signal{"Age", Quantity::kAge, 400, 16, Coding::kUnsigned, 1e-5, "s", kAgeText},
               Signal{"ResetCounter", Quantity::kResetCounter, 416, 8, Coding::kCounter, 1, "", kResetText},
               Signal{"Quality", Quantity::kQuality, 424, 8, Coding::kUnsigned, 1, "%", ""},
               Signal{"State", Quantity::kState, 432, 4, Coding::kUnsigned, 1, "", "As in EpilineStatus"},
               Signal{"Reasons", Quantity::kReasons, 440, 24, Coding::kCounter, 1, "", kReasonsText}});

inline constexpr Message kStatus = {"EpilineStatus", 0, 8, "Five times a second, and when something in it changes",
                                    kStatusSignals};
inline constexpr std::array kClassicOdometry = {
    Message{"EpilineTime", 1, 8, "First frame of an epoch", kTimeSignals},
    Message{"EpilinePositionXY", 2, 8, "", kPositionXySignals},
    Message{"EpilinePositionZ", 3, 8, "", kPositionZSignals},
    Message{"EpilineAttitude", 4, 8, "", kAttitudeSignals},
    Message{"EpilineVelocity", 5, 8, "", kVelocitySignals},
    Message{"EpilineRates", 6, 8, "Last frame of an epoch, but for the deviations", kRateSignals},
};
inline constexpr std::array kDeviations = {
    Message{"EpilinePositionSd", 7, 8, "In every few epochs, about five times a second", kPositionSdSignals},
    Message{"EpilineAttitudeSd", 8, 8, "With EpilinePositionSd", kAttitudeSdSignals},
    Message{"EpilineVelocitySd", 9, 8, "With EpilinePositionSd", kVelocitySdSignals},
};
inline constexpr Message kFdOdometry = {"EpilineOdometry", 10, 64, "CAN FD: in place of the six classic frames",
                                        kOdometrySignals};

/// All, in the order of their identifiers.
inline constexpr auto kMessages = joined(std::array{kStatus}, kClassicOdometry, kDeviations, std::array{kFdOdometry});
static_assert(std::all_of(kMessages.begin(), kMessages.end(), is_sound));
static_assert([] {
  for (std::size_t i = 0; i < kMessages.size(); ++i)
    if (kMessages[i].id_offset != i) return false;
  return true;
}());
static_assert(kFdOdometry.size == kFdBytes);

}  // namespace epiline::can
