#pragma once
// A socket on a CAN interface. It neither allocates nor waits, because it also reopens a lost bus during a flight.
// Page: docs/can.md.
#include <cstddef>
#include <cstdint>

#include "drivers/links/can/frames.h"
#include "platform/error/device_trouble.h"
#include "platform/linux/system_calls.h"

namespace epiline::can {

/// Events on the bus that the interface reported.
struct BusNews {
  unsigned error_frames = 0;
  bool bus_off = false, restarted = false;
  bool error_passive = false, error_active = false;  ///< the newer of the two; neither: as before
  int error = 0;                                     ///< errno: the interface went down or was removed
};

class CanSocket {
 public:
  explicit CanSocket(SystemCalls& system = SystemCalls::of_this_computer()) noexcept : system_(system) {}
  ~CanSocket() { close(); }
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  /// To send, classic frames or both kinds. It receives nothing but news of the bus.
  DeviceTrouble open_to_send(const char* interface, bool fd) noexcept;
  /// To receive the frames of one identifier, of both kinds, with the times of their arrival.
  DeviceTrouble open_to_receive(const char* interface, std::uint32_t id, bool extended) noexcept;
  /// To receive all frames of both kinds, those of this computer's other sockets too.
  DeviceTrouble open_to_listen(const char* interface) noexcept;
  void close() noexcept;
  bool is_open() const noexcept { return fd_ >= 0; }
  int fd() const noexcept { return fd_; }

  /// 0, or errno. EAGAIN, ENOBUFS: the queue is full, now.
  int send(const Frame& frame) noexcept;
  /// Takes a bounded number of the error frames that wait.
  BusNews news() noexcept;

 private:
  DeviceTrouble open(const char* interface, bool fd, int& index) noexcept;
  DeviceTrouble bind(int index) noexcept;
  /// Closes it, and tells why.
  DeviceTrouble fail(const DeviceTrouble& trouble) noexcept;
  DeviceTrouble refused(const char* step) noexcept;
  template <class T>
  bool set(int level, int option, const T& value) noexcept;

  SystemCalls& system_;
  int fd_ = -1;
};

}  // namespace epiline::can
