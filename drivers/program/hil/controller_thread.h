#pragma once
// Runs the controller model on a line: a thread that reads, timestamps and answers packets.
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
  /// Above the priority of everything under test: arrivals must not be stamped late because this thread had to wait.
  static constexpr int kPriority = 85, kLook_ms = 2;

  /// `model` and `line` must outlive this object; only the thread may use the model until stop() returns. With a key it
  /// signs its packets and ignores packets that are not signed with it.
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
