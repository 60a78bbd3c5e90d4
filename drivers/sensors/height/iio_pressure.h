#pragma once
// A barometer with a driver in the kernel (IIO), as most chips on I2C and SPI have: BMP280, BMP388, MS5611, DPS310,
// LPS22 and others. Page: docs/height.md.
#include <cstdint>
#include <filesystem>
#include <string>

#include "platform/concurrency/snapshot.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"

namespace epiline {

struct PressureCounts {
  std::uint64_t heights = 0;         ///< delivered
  std::uint64_t refused_values = 0;  ///< no pressure of air
  std::uint64_t slow = 0;            ///< readings that took so long that nobody knows of when they are
  std::uint64_t failed = 0;          ///< the kernel refused: the chip does not answer
};
inline constexpr auto kPressureCounters = std::to_array<Counter<PressureCounts>>({
    {"heights", &PressureCounts::heights},
    {"refused_values", &PressureCounts::refused_values, true},
    {"slow", &PressureCounts::slow, true},
    {"failed", &PressureCounts::failed, true},
});

/// Asks the chip at a fixed rate; a height has the time of the middle of its reading. One thread uses it, any may call
/// counts(). No heap after open().
class IioPressure final : public HeightSource {
 public:
  struct Settings {
    std::string device;   ///< its name or label, iio:deviceN, or a path of it; empty: the only barometer there is
    double rate_hz = 20;  ///< how often it is asked
    double air_deg = 15;  ///< temperature of the air at the ground
    std::filesystem::path devices = "/sys/bus/iio/devices";  ///< tests have a folder of their own
  };
  explicit IioPressure(Settings settings) : settings_(std::move(settings)) {}
  ~IioPressure() override { close(); }

  /// Fails if there is no such barometer, or several and none is named, or it does not answer.
  Status open() override;
  void close() noexcept override;
  ReadOutcome read(HeightSample& sample, Span timeout) noexcept override;

  PressureCounts counts() const noexcept { return shown_counts_.read(); }

 private:
  /// By the first file of the chip that tells pressures. Returns errno.
  int open_file() noexcept;
  ReadOutcome read_until(std::int64_t deadline_ns, HeightSample& sample) noexcept;
  /// False: errno tells why.
  bool read_hpa(double& hpa) noexcept;

  Settings settings_;
  std::string file_;
  double hpa_per_unit_ = 10, offset_ = 0;  ///< (what the file says + offset) x hpa_per_unit
  int fd_ = -1;
  std::int64_t due_ns_ = 0;
  PressureCounts counts_;
  Snapshot<PressureCounts> shown_counts_;
};

}  // namespace epiline
