// libgpiod 1.6 (Debian 12). It uses the kernel's older interface, whose events are not numbered.
#include <gpiod.h>

#include <array>

#include "drivers/sensors/gpio/gpio_request.h"

namespace epiline {

const bool kGpioBuiltIn = true;

namespace {

std::string text(const char* s) { return s == nullptr ? "" : s; }

}  // namespace

struct GpioLine::Request::Handles {
  gpiod_chip* chip = nullptr;
  gpiod_line* line = nullptr;
  std::array<gpiod_line_event, kMostEdges> events{};
};

GpioLine::Request::Request() : handles(std::make_unique<Handles>()) {}
GpioLine::Request::~Request() {
  if (handles->line != nullptr) gpiod_line_release(handles->line);
  if (handles->chip != nullptr) gpiod_chip_close(handles->chip);
}

bool GpioLine::Request::read_chip(const std::string& path, GpioChipFacts& facts) {
  gpiod_chip* const chip = gpiod_chip_open(path.c_str());
  if (chip == nullptr) return false;
  facts.path = path;
  facts.name = text(gpiod_chip_name(chip));
  facts.label = text(gpiod_chip_label(chip));
  const unsigned count = gpiod_chip_num_lines(chip);
  for (unsigned offset = 0; offset < count; ++offset) {
    GpioLineFacts line;
    if (gpiod_line* const handle = gpiod_chip_get_line(chip, offset))
      line = {text(gpiod_line_name(handle)), text(gpiod_line_consumer(handle))};
    facts.lines.push_back(line);
  }
  gpiod_chip_close(chip);
  return true;
}

bool GpioLine::Request::open(const std::string& path, unsigned offset, Edge edge) {
  handles->chip = gpiod_chip_open(path.c_str());
  if (handles->chip == nullptr) return false;
  gpiod_line* const line = gpiod_chip_get_line(handles->chip, offset);
  if (line == nullptr) return false;
  const int error = edge == Edge::kRising ? gpiod_line_request_rising_edge_events(line, "epiline")
                                          : gpiod_line_request_falling_edge_events(line, "epiline");
  if (error != 0) return false;
  handles->line = line;
  return true;
}

int GpioLine::Request::fd() const noexcept { return gpiod_line_event_get_fd(handles->line); }

int GpioLine::Request::read(std::span<HostStamp> edges, std::uint64_t& /*lost*/) noexcept {
  const int count =
      gpiod_line_event_read_fd_multiple(fd(), handles->events.data(), static_cast<unsigned>(edges.size()));
  for (int i = 0; i < count; ++i) {
    const timespec& at = handles->events[static_cast<std::size_t>(i)].ts;
    edges[static_cast<std::size_t>(i)] = {static_cast<std::int64_t>(at.tv_sec) * 1'000'000'000 + at.tv_nsec};
  }
  return count;
}

}  // namespace epiline
