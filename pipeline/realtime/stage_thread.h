#pragma once
// A thread that carries a stage.
#include <atomic>
#include <vector>

#include "pipeline/stages/stage.h"
#include "platform/concurrency/parking.h"
#include "platform/linux/realtime.h"

namespace epiline {

/// Starts and stops the threads of a flight together.
class FlightSwitch {
 public:
  /// Call before any thread is started.
  void add(Parking& parking) { parkings_.push_back(&parking); }

  // Any thread.

  void arm() noexcept { set(armed_); }
  void stop() noexcept { set(stopped_); }
  bool armed() const noexcept { return armed_.load(std::memory_order_acquire); }
  bool stopped() const noexcept { return stopped_.load(std::memory_order_acquire); }
  void notify_all() noexcept {
    for (Parking* parking : parkings_) parking->notify();
  }

 private:
  void set(std::atomic<bool>& flag) noexcept {
    flag.store(true, std::memory_order_release);  // pairs with the acquire in armed() and stopped()
    notify_all();
  }

  std::vector<Parking*> parkings_;
  std::atomic<bool> armed_{false}, stopped_{false};
};

/// Waits until the flight is armed; then steps, and waits where a step did nothing, until the stage ends.
class StageThread {
 public:
  enum class AtStop : std::uint8_t {
    kEnd,  ///< a stopped flight ends the thread after the step at hand
    kGoOn  ///< the thread ends with its stage, which ends when those before it have
  };

  /// `flight` must outlive the thread.
  StageThread(const ThreadSettings& settings, FlightSwitch& flight, AtStop at_stop = AtStop::kEnd);
  StageThread(const StageThread&) = delete;
  StageThread& operator=(const StageThread&) = delete;

  /// False: the system cannot start a thread. `stage` must outlive the thread.
  bool start(Stage& stage);
  void join() noexcept { thread_.join(); }

  /// The thread waits here. Producers of the stage's input notify it.
  Parking& parking() noexcept { return parking_; }
  /// Set when the stage has passed on its last element.
  const EndMark& ended() const noexcept { return ended_; }

  // After join().

  const ThreadSettings& settings() const noexcept { return settings_; }
  const ThreadCosts& costs() const noexcept { return costs_; }  ///< since the flight was armed
  const RealtimeThread& thread() const noexcept { return thread_; }

 private:
  static void run(void* self) noexcept;
  void carry() noexcept;
  bool over() const noexcept { return at_stop_ == AtStop::kEnd && flight_.stopped(); }

  ThreadSettings settings_;
  FlightSwitch& flight_;
  AtStop at_stop_;
  Stage* stage_ = nullptr;
  Parking parking_;
  EndMark ended_;
  ThreadCosts costs_;
  RealtimeThread thread_;
};

}  // namespace epiline
