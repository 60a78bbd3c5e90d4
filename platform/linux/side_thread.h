#pragma once
// A thread beside another, for calls that may block for seconds while that one must go on.
#include <memory>

namespace epiline {

class SideThread {
 public:
  virtual ~SideThread() = default;  ///< waits until work that is under way is done
  /// Any thread, never waits: `work` runs once more, after now.
  virtual void wake() noexcept = 0;
};

/// A thread of the ordinary scheduler that calls `work(context)` after each wake(), or once after several. Null: the
/// system cannot start a thread. `name`: at most 15 characters.
std::unique_ptr<SideThread> start_side_thread(const char* name, void (*work)(void* context), void* context);

}  // namespace epiline
