#pragma once
// Which identifiers other nodes send on a CAN bus.
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "drivers/links/can/can_socket.h"
#include "drivers/program/check/watcher.h"

namespace epiline {

/// Listens from open() on and sends nothing. It has its own thread, because the kernel keeps only some hundred frames.
class CanListener {
 public:
  using Counts = std::map<std::uint32_t, std::uint64_t>;

  /// The error tells a missing interface, one that is down and one without permission apart.
  Status open(const std::string& interface);
  /// Number of frames for each identifier heard; 29-bit identifiers have CAN_EFF_FLAG set.
  Counts heard_so_far();

 private:
  bool listen();

  can::CanSocket socket_;
  std::mutex mutex_;
  Counts counts_;
  std::optional<Watcher> thread_;  // last: it uses the others
};

}  // namespace epiline
