// Without libgpiod there are no lines; GpioLine::open() returns an error with this reason.
#include <cerrno>

#include "drivers/sensors/gpio/gpio_request.h"

namespace epiline {

const bool kGpioBuiltIn = false;

struct GpioLine::Request::Handles {};

GpioLine::Request::Request() = default;
GpioLine::Request::~Request() = default;
bool GpioLine::Request::read_chip(const std::string& /*path*/, GpioChipFacts& /*facts*/) {
  return errno = ENOSYS, false;
}
bool GpioLine::Request::open(const std::string& /*path*/, unsigned /*offset*/, Edge /*edge*/) {
  return errno = ENOSYS, false;
}
int GpioLine::Request::fd() const noexcept { return -1; }
int GpioLine::Request::read(std::span<HostStamp> /*edges*/, std::uint64_t& /*lost*/) noexcept {
  return errno = ENOSYS, -1;
}

}  // namespace epiline
