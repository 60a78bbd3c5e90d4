// What of an image's edges does not need a line of the kernel. tests/hardware has one.
#include "drivers/sensors/camera/stamp_line.h"

#include <gtest/gtest.h>

#include <span>

namespace epiline {
namespace {

/// An input without a pull-up, say: whenever it is read there are new edges.
struct FloatingLine {
  bool is_open() const { return true; }
  ReadOutcome read(std::span<HostStamp> edges, std::size_t& count, Span /*timeout*/) {
    if (++reads > 10'000) return ReadOutcome::kTimeout;  // the test ends, whatever happens
    count = edges.size();
    for (HostStamp& edge : edges) edge = {1'000 * ++given};
    return ReadOutcome::kSample;
  }
  std::int64_t reads = 0, given = 0;
};

TEST(StampLine, ALineThatFloatsDoesNotHoldTheImage) {
  FloatingLine line;
  EdgeStamps stamps;
  for (std::uint64_t image = 1; image <= 10; ++image) {
    take_edges(line, stamps);
    EXPECT_EQ(stamps.counts().edges, kEdgesOfImage * image);
  }
}

}  // namespace
}  // namespace epiline
