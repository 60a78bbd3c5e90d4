#pragma once
// The records of an MCAP file: a kind, a length and content.
#include <cstdint>
#include <string_view>

namespace epiline {

inline constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";

enum McapRecord : std::uint8_t {
  kMcapHeader = 1,
  kMcapFooter = 2,
  kMcapSchema = 3,
  kMcapChannel = 4,
  kMcapMessage = 5,
  kMcapChunk = 6,
  kMcapMessageIndex = 7,
  kMcapChunkIndex = 8,
  kMcapStatistics = 11,
  kMcapSummaryOffset = 14,
  kMcapDataEnd = 15
};

}  // namespace epiline
