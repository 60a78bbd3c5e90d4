#pragma once
// The controller model on a line: a thread that reads, answers and stamps what arrives.
#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "drivers/links/mavlink/signing.h"
#include "drivers/program/hil/controller_line.h"
#include "drivers/program/hil/controller_model.h"
#include "platform/concurrency/spsc_ring.h"
#include "platform/linux/realtime.h"

namespace epiline::hil {

class ControllerThread {
 public:
  /// Above everything that is judged: an arrival must not be stamped late because the judge had to wait.
  static constexpr int kPriority = 85, kLook_ms = 2;

  /// Both outlive it; the model belongs to the thread until stop().
  /// With a key it signs, and hears nothing that is not signed with it.
  ControllerThread(ControllerModel& model, ControllerLine& line,
                   const std::optional<mavlink::SigningKey>& key = std::nullopt)
      : model_(model), line_(line) {
    if (key) signing_.emplace(*key);
  }
  ~ControllerThread() { stop(); }
  ControllerThread(const ControllerThread&) = delete;
  ControllerThread& operator=(const ControllerThread&) = delete;

  /// False if and only if the system has no thread left.
  bool start();
  void stop() noexcept;

 private:
  static void run(void* self);
  void loop();
  void read_line();
  void answer();

  ControllerModel& model_;
  ControllerLine& line_;
  mavlink::Parser parser_;
  std::optional<mavlink::Signing> signing_;
  std::array<std::uint8_t, 4096> bytes_{};
  std::atomic<bool> stop_{false};
  RealtimeThread thread_;
};

}  // namespace epiline::hil
