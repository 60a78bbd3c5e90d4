#pragma once
// The CAN buses that are configured, and what is heard on them.
#include <memory>
#include <string>
#include <vector>

#include "drivers/program/check/can_listen.h"
#include "drivers/program/check/finding.h"
#include "pipeline/config/devices.h"

namespace epiline {

class BusCheck {
 public:
  /// Listens from now on, but not where `out` has an error already; what cannot be opened is said there. `config`
  /// outlives this.
  BusCheck(const DevicesConfig& config, Findings& out);
  void tell(Findings& out);

 private:
  struct Listener {
    const char* device;
    std::string interface;
    std::unique_ptr<CanListener> listener;
  };
  void add(const char* device, const std::string& interface, Findings& out);
  bool is_ours(const std::string& interface, std::uint32_t id) const;

  const DevicesConfig& config_;
  std::vector<Listener> listeners_;
};

}  // namespace epiline
