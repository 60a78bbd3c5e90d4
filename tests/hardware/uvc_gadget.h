#pragma once
// A USB camera (UVC 1.1), both its ends in this machine: its descriptors and payloads through the kernel's gadgetfs and
// virtual bus (dummy_hcd), before the kernel's own driver uvcvideo. The virtual bus moves no isochronous transfers, so
// the images come by a bulk endpoint, and the kernel's own camera gadget, which has no such endpoint, cannot be used.
#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "platform/time/clock.h"

namespace epiline {

class UvcGadget {
 public:
  static constexpr int kWidth = 160, kHeight = 120;
  static constexpr std::int64_t kPeriod_ns = 100'000'000;
  static constexpr std::uint32_t kClock_hz = 1'000'000;
  /// An image leaves so long after it was taken, by turns.
  static constexpr std::int64_t kDelays_ns[4] = {10'000'000, 40'000'000, 20'000'000, 30'000'000};

  /// gadgetfs, dummy_hcd and uvcvideo are there.
  static bool can_be_had();

  UvcGadget();
  ~UvcGadget();
  UvcGadget(const UvcGadget&) = delete;
  UvcGadget& operator=(const UvcGadget&) = delete;

  /// As the host sees it: /dev/videoN of its images; empty: it did not come.
  static std::string node();
  /// Every image says which one it is, and so when it was taken.
  HostStamp taken(const std::uint8_t* first_row) const;
  /// When its first byte was handed to the bus.
  HostStamp left(const std::uint8_t* first_row) const;

 private:
  static constexpr int kMostImages = 4096;

  void answer();
  void take_request();
  void answer_host(const std::uint8_t* request);
  bool begin_stream();
  void stream();
  void send_image(std::uint32_t number, bool is_odd);
  std::int64_t taken_ns(std::uint32_t number) const { return begin_ns_ + number * kPeriod_ns; }
  /// Of the camera's clock: 50 parts per million fast, and about to turn over.
  static std::uint32_t ticks(std::int64_t host_ns);

  const std::int64_t begin_ns_;
  int control_ = -1, images_ = -1;
  std::atomic<bool> ends_{false}, is_streaming_{false};
  std::array<std::atomic<std::int64_t>, kMostImages> left_ns_{};
  std::thread answers_, streams_;
};

}  // namespace epiline
