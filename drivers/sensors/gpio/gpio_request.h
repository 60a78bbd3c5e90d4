#pragma once
// What GpioLine needs of libgpiod: gpiod_1.cc and gpiod_2.cc have it of that version, gpiod_none.cc of none.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/sensors/gpio/gpio_line.h"

namespace epiline {

struct GpioLineFacts {
  std::string name;      ///< may be empty
  std::string consumer;  ///< who uses it; may be empty
};

struct GpioChipFacts {
  std::string path, name, label;
  std::vector<GpioLineFacts> lines;
};

struct GpioLine::Request {
  struct Handles;  ///< libgpiod's objects

  Request();
  ~Request();
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;

  /// False: errno says why not.
  static bool read_chip(const std::string& path, GpioChipFacts& facts);
  /// False: errno says why not. `offset` is one of read_chip().
  bool open(const std::string& path, unsigned offset, Edge edge);
  int fd() const noexcept;
  /// The edges that are there; waits if there is none. < 0: errno says why. Adds to `lost`.
  int read(std::span<HostStamp> edges, std::uint64_t& lost) noexcept;

  static constexpr std::size_t kMostEdges = 64;  ///< that one read() gives
  std::unique_ptr<Handles> handles;
};

/// False where libgpiod was not there at configure time.
extern const bool kGpioBuiltIn;

/// The line meant by `wanted`, see GpioLine.
struct GpioChoice {
  const GpioChipFacts* chip = nullptr;
  unsigned offset = 0;
};
Result<GpioChoice> choose_line(std::span<const GpioChipFacts> chips, const std::string& wanted);

}  // namespace epiline
