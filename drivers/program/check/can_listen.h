#pragma once
// Who else talks on a CAN bus.
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "drivers/links/can/can_socket.h"
#include "drivers/program/check/watcher.h"

namespace epiline {

/// Listens from open() on, in a thread of its own: the kernel keeps only some hundred frames. Sends nothing.
class CanListener {
 public:
  using Counts = std::map<std::uint32_t, std::uint64_t>;

  /// Says whether the interface is missing, down, or not for this user.
  Status open(const std::string& interface);
  /// Identifiers heard and how often; those of 29 bits with CAN_EFF_FLAG.
  Counts heard_so_far();

 private:
  bool listen();

  can::CanSocket socket_;
  std::mutex mutex_;
  Counts counts_;
  std::optional<Watcher> thread_;  // last: it uses the others
};

}  // namespace epiline
