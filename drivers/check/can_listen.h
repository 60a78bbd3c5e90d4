#pragma once
// Who else talks on a CAN bus.
#include <cstdint>
#include <map>
#include <string>

#include "platform/error/result.h"

namespace epiline {

/// Listens from open() on; sends nothing.
class CanListener {
 public:
  CanListener() = default;
  ~CanListener();
  CanListener(const CanListener&) = delete;
  CanListener& operator=(const CanListener&) = delete;

  /// Says whether the interface is missing, down, or not for this user.
  Status open(const std::string& interface);
  /// Identifiers heard so far and how often, as far as the kernel kept them; without flags. Few milliseconds.
  std::map<std::uint32_t, std::uint64_t> heard();

 private:
  int fd_ = -1;
};

}  // namespace epiline
