#pragma once
// All receivers of a live flight's odometry, each opened when it can be. A flight controller that is not there, or a
// cable that broke, holds back neither the camera nor the estimate nor the page.
#include <array>
#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "drivers/program/live/devices.h"
#include "platform/concurrency/latest_value.h"
#include "platform/concurrency/parking.h"

namespace epiline {

/// Passes the odometry to the receivers that are open, and keeps the newest for the display.
class Receivers final : public OdometrySink {
 public:
  explicit Receivers(const std::vector<LiveOutput>& outputs) : outputs_(outputs), states_(outputs.size()) {}
  ~Receivers() override { Receivers::close(); }
  Receivers(const Receivers&) = delete;
  Receivers& operator=(const Receivers&) = delete;

  Status open() override { return Done{}; }  // see open_each()
  /// Tries each once, in order. `waits`: a thread tries those that could not be opened again, each half second; only a
  /// wrong setting (ErrorKind::kUsage) is an error. Otherwise the first that cannot be opened is. One thread, once.
  Status open_each(bool waits);
  void close() noexcept override;
  bool publish(const Odometry& odometry) noexcept override;
  bool publish_image(const Odometry& odometry) noexcept override;

  // The thread that shows the flight.
  const Odometry* newest() noexcept { return newest_.read(); }
  std::string names_of_lost() const;  ///< those not open among them
  std::string refusals() const;
  /// What receivers said of their settings and of what they use, a sentence each.
  std::vector<std::string> notes() const;
  /// As in "mavlink /dev/ttyAMA0: No such file or directory [open]"; empty: all are open.
  std::string waiting_for() const;

 private:
  struct State {
    std::atomic<bool> is_open{false};  ///< released by the opening thread, acquired by the publishing one
    std::string trouble;               ///< under mutex_
  };
  Status try_one(std::size_t i);
  void keep_trying();

  const std::vector<LiveOutput>& outputs_;
  std::vector<State> states_;
  mutable std::mutex mutex_;
  LatestValue<Odometry> newest_;
  std::atomic<bool> stops_{false};
  Parking pause_;
  std::thread trying_;
};

}  // namespace epiline
