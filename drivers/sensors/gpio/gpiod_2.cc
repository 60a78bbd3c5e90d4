// libgpiod 2 (Debian 13).
#include <gpiod.h>

#include "drivers/sensors/gpio/gpio_request.h"

namespace epiline {

const bool kGpioBuiltIn = true;

namespace {

constexpr std::size_t kKernelEvents = 256;  // that wait to be read: a quarter of a second at 1 kHz

std::string text(const char* s) { return s == nullptr ? "" : s; }

template <auto kFree>
struct Freed {
  template <class T>
  void operator()(T* object) const noexcept {
    kFree(object);
  }
};
using Chip = std::unique_ptr<gpiod_chip, Freed<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Freed<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Freed<gpiod_line_info_free>>;
using LineSettings = std::unique_ptr<gpiod_line_settings, Freed<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Freed<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Freed<gpiod_request_config_free>>;
using Buffer = std::unique_ptr<gpiod_edge_event_buffer, Freed<gpiod_edge_event_buffer_free>>;
using LineRequest = std::unique_ptr<gpiod_line_request, Freed<gpiod_line_request_release>>;

}  // namespace

struct GpioLine::Request::Handles {
  Buffer buffer;
  LineRequest request;
  unsigned long newest = 0;  ///< number of the last event; 0: none yet
};

GpioLine::Request::Request() : handles(std::make_unique<Handles>()) {}
GpioLine::Request::~Request() = default;

bool GpioLine::Request::read_chip(const std::string& path, GpioChipFacts& facts) {
  const Chip chip(gpiod_chip_open(path.c_str()));
  if (!chip) return false;
  const ChipInfo info(gpiod_chip_get_info(chip.get()));
  if (!info) return false;
  facts.path = path;
  facts.name = text(gpiod_chip_info_get_name(info.get()));
  facts.label = text(gpiod_chip_info_get_label(info.get()));
  const std::size_t count = gpiod_chip_info_get_num_lines(info.get());
  for (unsigned offset = 0; offset < count; ++offset) {
    GpioLineFacts line;
    if (const LineInfo of_line{gpiod_chip_get_line_info(chip.get(), offset)})
      line = {text(gpiod_line_info_get_name(of_line.get())), text(gpiod_line_info_get_consumer(of_line.get()))};
    facts.lines.push_back(line);
  }
  return true;
}

bool GpioLine::Request::open(const std::string& path, unsigned offset, Edge edge) {
  const Chip chip(gpiod_chip_open(path.c_str()));
  if (!chip) return false;
  const LineSettings settings(gpiod_line_settings_new());
  const LineConfig lines(gpiod_line_config_new());
  const RequestConfig config(gpiod_request_config_new());
  handles->buffer.reset(gpiod_edge_event_buffer_new(kMostEdges));
  if (!settings || !lines || !config || !handles->buffer) return false;
  if (gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT) != 0 ||
      gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC) != 0 ||
      gpiod_line_settings_set_edge_detection(
          settings.get(), edge == Edge::kRising ? GPIOD_LINE_EDGE_RISING : GPIOD_LINE_EDGE_FALLING) != 0 ||
      gpiod_line_config_add_line_settings(lines.get(), &offset, 1, settings.get()) != 0)
    return false;
  gpiod_request_config_set_consumer(config.get(), "epiline");
  gpiod_request_config_set_event_buffer_size(config.get(), kKernelEvents);
  handles->request.reset(gpiod_chip_request_lines(chip.get(), config.get(), lines.get()));
  return handles->request != nullptr;
}

int GpioLine::Request::fd() const noexcept { return gpiod_line_request_get_fd(handles->request.get()); }

int GpioLine::Request::read(std::span<HostStamp> edges, std::uint64_t& lost) noexcept {
  const int count = gpiod_line_request_read_edge_events(handles->request.get(), handles->buffer.get(), edges.size());
  for (int i = 0; i < count; ++i) {
    gpiod_edge_event* const event =
        gpiod_edge_event_buffer_get_event(handles->buffer.get(), static_cast<unsigned long>(i));
    edges[static_cast<std::size_t>(i)] = {static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event))};
    const unsigned long number = gpiod_edge_event_get_line_seqno(event);
    if (number > handles->newest + 1) lost += number - handles->newest - 1;
    handles->newest = number;
  }
  return count;
}

}  // namespace epiline
