#pragma once
// Sets a camera's controls beside the thread that takes its images: a transfer to a USB camera takes milliseconds, and
// seconds if the camera does not answer.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "drivers/sensors/camera/v4l2_controls.h"
#include "platform/time/clock.h"

namespace epiline {

/// Controls to be set together, and what became of them.
struct ControlJob {
  struct Entry {
    std::array<char, 48> name{};
    ControlFacts facts;  ///< id 0: to be found by name
    std::int64_t wanted = 0;
    std::int64_t value = 0;  ///< what the device made of it, as read back
  };
  static constexpr std::size_t kMost = 2;
  std::array<Entry, kMost> entries{};
  std::size_t count = 0;
  bool is_request = false;   ///< of V4l2Camera::request_control(); else of the exposure controller
  std::uint64_t stream = 0;  ///< the stream it was meant for
  bool is_set = false;
  HostStamp at;  ///< when they were set
};

/// One job at a time. One thread calls; start() takes memory and a thread, the others neither heap nor lock.
class ControlTransfers {
 public:
  explicit ControlTransfers(SystemCalls& system) noexcept : system_(system) {}
  ~ControlTransfers() { stop(); }

  /// False: the system cannot start a thread.
  bool start();
  /// Waits for the transfer that is under way.
  void stop() noexcept;

  bool is_idle() const noexcept { return state_.load(std::memory_order_relaxed) == State::kIdle; }
  /// If idle. The files may be closed from then on: the job has its own. False: it was not begun.
  bool begin(const V4l2Controls& controls, const ControlJob& job) noexcept;
  /// The job that has ended; once. False: none.
  bool take(ControlJob& job) noexcept;

 private:
  enum class State : std::uint8_t { kIdle, kBegun, kEnded };

  static void work(void* self) noexcept;
  void carry_out() noexcept;

  SystemCalls& system_;
  V4l2Controls controls_{system_};
  ControlJob job_;  ///< belongs to the side thread in kBegun, else to the caller
  std::atomic<State> state_{State::kIdle};
  std::unique_ptr<SideThread> thread_;
};

}  // namespace epiline
