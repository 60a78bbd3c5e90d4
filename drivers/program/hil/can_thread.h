#pragma once
// The controller model on a CAN bus.
#include <atomic>
#include <string>

#include "drivers/program/hil/controller_model.h"
#include "platform/error/result.h"
#include "platform/linux/realtime.h"

namespace epiline::hil {

class CanThread {
 public:
  /// `model` must outlive this object. Only the thread may use it until stop() returns.
  explicit CanThread(ControllerModel& model) : model_(model) {}
  ~CanThread() { stop(); }
  CanThread(const CanThread&) = delete;
  CanThread& operator=(const CanThread&) = delete;

  /// Listens to all frames of the interface, classic and FD. Fails if the interface cannot be opened.
  Status start(const std::string& interface);
  void stop() noexcept;

 private:
  static void run(void* self);
  void loop();

  ControllerModel& model_;
  int fd_ = -1;
  std::atomic<bool> stop_{false};
  RealtimeThread thread_;
};

}  // namespace epiline::hil
