#pragma once
// Runs the controller model on a line: a thread that reads, timestamps and answers packets.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/links/mavlink/signing.h"
#include "drivers/program/hil/controller_line.h"
#include "drivers/program/hil/controller_model.h"
#include "platform/linux/step_thread.h"

namespace epiline::hil {

class ControllerThread {
 public:
  /// `model` and `line` must outlive this object; only the thread may use the model until stop() returns. With a key it
  /// signs its packets and ignores packets that are not signed with it.
  ControllerThread(ControllerModel& model, ControllerLine& line,
                   const std::optional<mavlink::SigningKey>& key = std::nullopt)
      : model_(model), line_(line) {
    if (key) signing_.emplace(*key);
  }

  /// Fails if and only if the system has no thread left.
  Status start();
  void stop() noexcept { thread_.stop(); }

 private:
  void step();
  void hear(std::span<const std::uint8_t> bytes, HostStamp arrival);
  void hear_frame(std::size_t got, HostStamp arrival);
  void answer();

  ControllerModel& model_;
  ControllerLine& line_;
  mavlink::Parser parser_;
  std::optional<mavlink::Signing> signing_;
  std::array<std::uint8_t, 4096> bytes_{};
  StepThread thread_;  // last: it uses the others
};

}  // namespace epiline::hil
