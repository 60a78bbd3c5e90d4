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
  /// A device. After a failed open(), close() is called, and then perhaps open() again.
  struct Part {
    std::string name;  ///< for the user
    std::function<Status()> open;
    std::function<void()> close;
    std::function<void()> give_up = [] {};  ///< called by another thread; open() must then return soon
  };

  /// Starts a thread that opens the parts one after the other. `waits`: retry a part that cannot be opened every half
  /// second; otherwise its error ends the work. The error of a setting (ErrorKind::kUsage) always ends it.
  Opener(std::vector<Part> parts, bool waits);
  ~Opener() { give_up(); }
  Opener(const Opener&) = delete;
  Opener& operator=(const Opener&) = delete;

  bool has_ended() const { return ended_.load(std::memory_order_acquire); }
  /// The device it waits for and why, as in "camera: /dev/video0: No such file or directory [open]"; empty: none.
  std::string waiting_for() const;
  /// Aborts the work and waits until the thread has ended.
  void give_up();
  /// Call once has_ended() is true. Success: all parts are open. Otherwise the error of one part; the parts before it
  /// are still open.
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
