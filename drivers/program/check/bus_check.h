#pragma once
// The CAN buses that are configured, and what is heard on them.
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/links/can/can_socket.h"
#include "drivers/program/check/finding.h"
#include "drivers/program/check/watcher.h"
#include "pipeline/config/devices.h"

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

class BusCheck {
 public:
  /// Listens from now on, but not where `out` has an error already; what cannot be opened is said there. `config`
  /// outlives this.
  BusCheck(const DevicesConfig& config, Findings& out);
  void tell(Findings& out);

 private:
  struct Bus {
    std::string device, interface;
    std::unique_ptr<CanListener> listener;
  };
  void add(const char* device, const std::string& interface, Findings& out);
  bool is_ours(const std::string& interface, std::uint32_t id) const;

  const DevicesConfig& config_;
  std::vector<Bus> buses_;
};

}  // namespace epiline
