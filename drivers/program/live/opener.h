#pragma once
// Opens devices in a thread of its own, so that a signal can still end the wait for one.
#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "platform/concurrency/parking.h"
#include "platform/error/result.h"

namespace epiline {

class Opener {
 public:
  /// A device. After an open() that failed comes close(), then perhaps another open().
  struct Part {
    std::string name;  ///< for the user
    std::function<Status()> open;
    std::function<void()> close;
    std::function<void()> give_up = [] {};  ///< from another thread: open() returns soon
  };

  /// Opens the parts one after the other. `waits`: a part that cannot be opened is tried again every half second;
  /// otherwise its error ends it. The error of a setting (ErrorKind::kUsage) always does.
  Opener(std::vector<Part> parts, bool waits);
  ~Opener() { give_up(); }
  Opener(const Opener&) = delete;
  Opener& operator=(const Opener&) = delete;

  bool has_ended() const { return ended_.load(std::memory_order_acquire); }
  /// What it waits for and why, as in "camera: /dev/video0: No such file or directory [open]"; empty: it does not wait.
  std::string waiting_for() const;
  /// Ends it, and returns when it has ended.
  void give_up();
  /// After it has ended: all parts are open, or why one is not. Those before it are still open.
  Status result() const;

 private:
  void run();
  std::optional<Error> try_part(const Part& part);
  void note(const std::string& text);

  std::vector<Part> parts_;
  bool waits_;
  std::atomic<bool> ended_{false}, gives_up_{false};
  std::atomic<std::size_t> at_{0};  ///< the part that is being opened
  std::atomic<std::int64_t> since_ns_{0};
  Parking pause_;
  mutable std::mutex mutex_;
  std::string waiting_for_;     ///< under mutex_
  std::optional<Error> error_;  ///< under mutex_
  std::thread thread_;
};

}  // namespace epiline
