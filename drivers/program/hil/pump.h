#pragma once
// A thread that carries samples from a played sensor into the kernel.
#include <atomic>
#include <functional>
#include <thread>

#include "platform/ports/ports.h"

namespace epiline::hil {

/// Ends when its source ends, or at stop().
class Pump {
 public:
  Pump() = default;
  ~Pump() { stop(); }
  Pump(const Pump&) = delete;
  Pump& operator=(const Pump&) = delete;

  /// Starts the thread. The source must be open and outlive it. `deliver` returns false if it could not deliver a
  /// sample.
  void start(CameraSource& camera, std::function<bool(const Frame&)> deliver);
  void start(ImuSource& imu, std::function<bool(const ImuSample&)> deliver);
  void stop();

  bool is_running() const noexcept { return running_.load(std::memory_order_acquire); }
  std::uint64_t failed() const noexcept { return failed_.load(std::memory_order_relaxed); }

 private:
  void count(bool delivered) noexcept {
    if (!delivered) failed_.fetch_add(1, std::memory_order_relaxed);
  }

  std::atomic<bool> stop_{false}, running_{false};
  std::atomic<std::uint64_t> failed_{0};
  std::thread thread_;
};

}  // namespace epiline::hil
