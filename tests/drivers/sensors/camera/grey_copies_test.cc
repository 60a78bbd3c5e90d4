#include "drivers/sensors/camera/grey_copies.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "tests/drivers/fake_kernel.h"

namespace epiline {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Row by row through memory of our own, or at once from the driver's: the same image, and nothing beyond a row's
/// pixels is read.
RC_GTEST_PROP(GreyCopies, AreTheConversionOfTheDriversMemory, ()) {
  DeviceFormat format;
  format.format = static_cast<PixelFormat>(*rc::gen::inRange(0, static_cast<int>(PixelFormat::kMjpeg)));
  format.width = *rc::gen::inRange(2, 70);
  format.height = *rc::gen::inRange(2, 9);
  const std::size_t row = row_bytes(format.format, format.width);
  format.stride = static_cast<int>(row) + *rc::gen::inRange(0, 20);
  const std::size_t bytes = static_cast<std::size_t>(format.stride) * static_cast<std::size_t>(format.height - 1) + row;
  Bytes from = *rc::gen::container<Bytes>(bytes, rc::gen::arbitrary<std::uint8_t>());
  const int stride = format.grey_width() + 3;
  Bytes expected(static_cast<std::size_t>(stride * format.grey_height()), 0xa5), copied = expected;
  to_grey(format.format, from.data(), format.stride, format.width, format.height, expected.data(), stride);
  test::FakeKernel kernel;
  GreyCopies copies(kernel);
  copies.set_format(format);
  RC_ASSERT(copies.can_copy(format));
  RC_ASSERT(copies.copy(format, {from.data(), from.size(), -1}, from.size(), copied.data(), stride));
  RC_ASSERT(copied == expected);
}

}  // namespace
}  // namespace epiline
