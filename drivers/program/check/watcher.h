#pragma once
// A thread that examines one device; several devices are examined at the same time.
#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "platform/ports/ports.h"

namespace epiline {

/// Calls `look` repeatedly until it returns false or stop() is called. The data that `look` collects may be read after
/// stop().
class Watcher {
 public:
  template <class Look>
  explicit Watcher(Look look)
      : thread_([this, look = std::move(look)]() mutable {
          while (!stop_ && look()) {
          }
          ended_ = true;
        }) {}
  ~Watcher() { stop(); }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// True once `look` will not be called again.
  bool has_ended() const { return ended_; }
  /// What `look` returns after a read without a sample; after a failed one a moment later.
  static bool goes_on(ReadOutcome outcome) {
    if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return outcome != ReadOutcome::kEnd;
  }

 private:
  std::atomic<bool> stop_{false}, ended_{false};
  std::thread thread_;  // last: it uses the others
};

}  // namespace epiline
