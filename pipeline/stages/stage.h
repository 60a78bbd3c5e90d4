#pragma once
// What all stages of the pipeline share. A stage knows its inputs, its outputs and its own state, and nothing of
// threads: in real time a thread carries it (pipeline/realtime/stage_thread.h), in a replay a loop calls it.
#include <atomic>
#include <cstdint>

#include "platform/concurrency/counter.h"
#include "platform/time/clock.h"

namespace epiline {

/// The result of one call of Stage::step().
struct Step {
  enum class Did : std::uint8_t {
    kNothing,  ///< it lacks an input: call it again when ready() is true, or at `sleep_until_ns`
    kWork,     ///< call it again at once
    kEnd       ///< nothing will come any more, and everything that came is done
  };
  Did did = Did::kNothing;
  std::int64_t sleep_until_ns = 0;  ///< of the stage's clock

  static constexpr Step nothing_until(std::int64_t ns) noexcept { return {Did::kNothing, ns}; }
  static constexpr Step work() noexcept { return {Did::kWork, 0}; }
  static constexpr Step end() noexcept { return {Did::kEnd, 0}; }
};

class Stage {
 public:
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  virtual ~Stage() = default;

  /// Does a bounded piece of work with the inputs that are here, one image or one batch of samples. It never waits for
  /// another stage; a stage that reads a device waits for it, kIdle at most.
  virtual Step step() noexcept = 0;
  /// After a step that did nothing: whether another one would do something, whatever the time. False for a stage that
  /// reads a device.
  virtual bool ready() noexcept = 0;

  static constexpr Span kIdle = Span::from_milliseconds(100);  ///< an idle stage is called again so soon
};

/// The end of a stage's output. The thread or loop that runs the stage sets it once.
class EndMark {
 public:
  // release, pairs with the acquire in is_set(): a reader that sees the end finds every element in the ring
  void set() noexcept { set_.store(true, std::memory_order_release); }
  bool is_set() const noexcept { return set_.load(std::memory_order_acquire); }

 private:
  std::atomic<bool> set_{false};
};

/// A counter with one writer; any thread may read a recent value.
class StageCount {
 public:
  void bump() noexcept { epiline::bump(count_); }
  std::uint64_t get() const noexcept { return count_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> count_{0};
};

}  // namespace epiline
