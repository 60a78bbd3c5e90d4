#pragma once
// A thread that repeats a step.
#include <atomic>
#include <functional>
#include <utility>

#include "platform/linux/realtime.h"

namespace epiline {

/// Repeats a step on a thread of its own until the step returns false or stop() is called.
class StepThread {
 public:
  ~StepThread() { stop(); }
  /// Call once. False if and only if the system cannot start a thread.
  bool start(const ThreadSettings& settings, std::function<bool()> step) {
    step_ = std::move(step);
    runs_ = true;
    const auto body = [](void* self) {
      auto& thread = *static_cast<StepThread*>(self);
      while (!thread.stops_.load(std::memory_order_relaxed) && thread.step_()) {
      }
      thread.runs_.store(false, std::memory_order_relaxed);
    };
    if (thread_.start(settings, body, this)) return true;
    runs_ = false;
    return false;
  }
  /// Returns when the step has ended.
  void stop() noexcept {
    stops_.store(true, std::memory_order_relaxed);
    thread_.join();
  }
  /// True from start() until the step will not be called again.
  bool is_running() const noexcept { return runs_.load(std::memory_order_relaxed); }

 private:
  std::function<bool()> step_;
  std::atomic<bool> stops_{false}, runs_{false};
  RealtimeThread thread_;
};

}  // namespace epiline
