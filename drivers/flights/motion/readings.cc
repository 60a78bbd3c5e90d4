#include "drivers/flights/motion/readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace epiline {

std::string seconds_text(HostStamp stamp) {
  return fmt::format("{}.{:09} s", stamp.ns / 1'000'000'000, std::abs(stamp.ns % 1'000'000'000));
}

Status check_readings(const std::vector<ImuSample>& imu, const std::string& imu_name) {
  const auto fail = [&](HostStamp at, const std::string& found, std::string expected) {
    return Error{ErrorKind::kUsage, imu_name, 0, "at " + seconds_text(at) + " " + found, std::move(expected)};
  };
  const auto finite = [](const std::array<double, 3>& a) {
    return std::all_of(a.begin(), a.end(), [](double x) { return std::isfinite(x); });
  };
  const double period = median_period(imu);
  for (std::size_t i = 0; i < imu.size(); ++i) {
    if (!finite(imu[i].angular_velocity_rad_s) || !finite(imu[i].specific_force_m_s2))
      return fail(imu[i].stamp, "a reading that is not finite", "six numbers");
    if (i == 0) continue;
    const double step = (imu[i].stamp - imu[i - 1].stamp).seconds();
    if (step <= 0) return fail(imu[i].stamp, "a reading out of order or doubled", "rising stamps");
    if (step > 5.5 * period)
      return fail(imu[i - 1].stamp, fmt::format("no reading for {:.3f} s", step),
                  fmt::format("one every {:.3f} s", period));
  }
  return Done{};
}

}  // namespace epiline
