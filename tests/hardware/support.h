#pragma once
// What the tests against kernel drivers share. They run in the machine of tests/hardware/vm.
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "platform/error/result.h"
#include "platform/time/monotonic.h"

#define ASSERT_OPENS(device)                                    \
  do {                                                          \
    const epiline::Status opened_status = (device).open();      \
    ASSERT_TRUE(opened_status) << opened_status.error().text(); \
  } while (false)

namespace epiline {

template <class Device>
std::string error_of_opening(Device&& device) {
  const Status status = device.open();
  return status ? "opened" : status.error().text();
}

/// Tries until `done()` holds; false after `seconds`. An emulated machine is slow.
template <class Done>
bool within(double seconds, Done done) {
  const std::int64_t until_ns = monotonic_ns() + static_cast<std::int64_t>(seconds * 1e9);
  while (monotonic_ns() < until_ns) {
    if (done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return done();
}

inline void write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text << std::flush;
  ASSERT_TRUE(file) << path;
}
inline std::string first_line(const std::string& path) {
  std::string line;
  std::ifstream file(path);
  std::getline(file, line);
  return line;
}

/// The calibration of a camera without distortion.
inline std::string plain_camera(int width, int height) {
  const auto w = std::to_string(width), h = std::to_string(height);
  return "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [" + w + ", " + h +
         "]\ncamera_model: pinhole\nintrinsics: [250, 250, " + std::to_string(width / 2) + ", " +
         std::to_string(height / 2) + "]\ndistortion_model: none\ndistortion_coefficients: []\n";
}

/// Hardware does not wait for programs: the calling thread goes before them.
inline void go_before_programs() {
  sched_param first{};
  first.sched_priority = 60;
  ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &first);
}

/// Plays hardware: does something again and again, until destroyed; once each time that much of the clock has gone by.
class Again {
 public:
  Again(double rate_hz, std::function<void(std::int64_t)> what)
      : thread_([this, what = std::move(what), period_ns = static_cast<std::int64_t>(1e9 / rate_hz)] {
          go_before_programs();
          for (std::int64_t next_ns = monotonic_ns(); !ends_; next_ns += period_ns) {
            std::this_thread::sleep_for(std::chrono::nanoseconds(std::max<std::int64_t>(next_ns - monotonic_ns(), 0)));
            what(next_ns);
          }
        }) {}
  ~Again() {
    ends_ = true;
    thread_.join();
  }
  Again(const Again&) = delete;
  Again& operator=(const Again&) = delete;

 private:
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace epiline
