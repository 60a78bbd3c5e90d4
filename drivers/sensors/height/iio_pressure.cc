#include "drivers/sensors/height/iio_pressure.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <vector>

#include "platform/math/atmosphere.h"
#include "platform/time/monotonic.h"
#include "platform/time/sleep.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

constexpr double kHpaPerKpa = 10;                        // IIO tells pressures in kPa
constexpr Span kSlow = Span::from_milliseconds(200);     // at 5 m/s of climb half a metre
constexpr Span kRetry = Span::from_milliseconds(1'000);  // after the chip did not answer

std::string line_of(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::optional<double> number_of(const fs::path& file) {
  const std::string line = line_of(file);
  char* end = nullptr;
  const double value = std::strtod(line.c_str(), &end);
  return end != line.c_str() && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

bool is_barometer(const fs::path& device) {
  std::error_code ignored;
  return fs::exists(device / "in_pressure_input", ignored) || fs::exists(device / "in_pressure_raw", ignored);
}

bool is_called(const fs::path& device, const std::string& wanted) {
  const std::string name = device.filename().string();
  return wanted == name || wanted == line_of(device / "name") || wanted == line_of(device / "label") ||
         fs::path(wanted).filename() == name;
}

std::vector<fs::path> barometers(const fs::path& devices) {
  std::vector<fs::path> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(devices, ignored))
    if (is_barometer(entry.path())) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

std::string names_of(const std::vector<fs::path>& devices) {
  std::string names;
  for (const fs::path& device : devices)
    names += (names.empty() ? "" : ", ") + device.filename().string() + " (" + line_of(device / "name") + ")";
  return names.empty() ? "none" : names;
}

}  // namespace

Status IioPressure::open() {
  close();
  due_ns_ = 0;
  const std::vector<fs::path> all = barometers(settings_.devices);
  std::vector<fs::path> wanted = all;
  if (!settings_.device.empty())
    std::erase_if(wanted, [&](const fs::path& device) { return !is_called(device, settings_.device); });
  if (wanted.size() != 1) {
    const std::string found =
        settings_.device.empty() ? "height.device is not set" : "height.device = \"" + settings_.device + "\"";
    return Error{
        ErrorKind::kRun, settings_.devices.string(), 0, found,
        wanted.empty() ? "a barometer with an IIO driver; present: " + names_of(all) : "one of " + names_of(wanted)};
  }
  const fs::path& device = wanted.front();
  std::error_code ignored;
  const bool is_raw = !fs::exists(device / "in_pressure_input", ignored);
  file_ = device / (is_raw ? "in_pressure_raw" : "in_pressure_input");
  hpa_per_unit_ = kHpaPerKpa * (is_raw ? number_of(device / "in_pressure_scale").value_or(1) : 1);
  offset_ = is_raw ? number_of(device / "in_pressure_offset").value_or(0) : 0;
  double hpa = 0;
  if (open_file() == 0 && read_hpa(hpa)) return Done{};
  const Error error{ErrorKind::kRun, file_, 0, std::strerror(errno),
                    "a chip that answers: its wiring, its supply, its driver"};
  close();
  return error;
}

void IioPressure::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

int IioPressure::open_file() noexcept {
  fd_ = ::open(file_.c_str(), O_RDONLY | O_CLOEXEC);
  return fd_ >= 0 ? 0 : errno;
}

bool IioPressure::read_hpa(double& hpa) noexcept {
  std::array<char, 64> text{};
  const ssize_t length = ::pread(fd_, text.data(), text.size() - 1, 0);  // the kernel asks the chip each time
  if (length < 0) return false;
  char* end = nullptr;
  const double value = std::strtod(text.data(), &end);
  hpa = end != text.data() ? (value + offset_) * hpa_per_unit_ : 0;
  return true;
}

ReadOutcome IioPressure::read(HeightSample& sample, Span timeout) noexcept {
  const ReadOutcome outcome = read_until(monotonic_ns() + timeout.ns, sample);
  shown_counts_.write(counts_);
  return outcome;
}

ReadOutcome IioPressure::read_until(std::int64_t deadline_ns, HeightSample& sample) noexcept {
  sleep_until(std::min(due_ns_, deadline_ns));
  if (due_ns_ > deadline_ns) return ReadOutcome::kTimeout;
  double hpa = 0;
  const std::int64_t before_ns = monotonic_ns();
  const auto period_ns = static_cast<std::int64_t>(1e9 / settings_.rate_hz);
  due_ns_ = due_ns_ == 0 ? before_ns + period_ns : std::max(due_ns_ + period_ns, before_ns);
  if ((fd_ < 0 && open_file() != 0) || !read_hpa(hpa)) {
    ++counts_.failed;
    close();
    due_ns_ = before_ns + kRetry.ns;
    return ReadOutcome::kFailed;
  }
  const std::int64_t after_ns = monotonic_ns();
  if (!is_air_pressure(hpa)) return ++counts_.refused_values, ReadOutcome::kTimeout;
  if (after_ns - before_ns > kSlow.ns) return ++counts_.slow, ReadOutcome::kTimeout;
  sample = {HostStamp{before_ns + (after_ns - before_ns) / 2}, HeightKind::kBarometer,
            height_between(kStandardPressure_hpa, hpa, settings_.air_deg)};
  ++counts_.heights;
  return ReadOutcome::kSample;
}

}  // namespace epiline
