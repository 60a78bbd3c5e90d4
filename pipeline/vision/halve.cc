#include "pipeline/vision/halve.h"

#include <algorithm>

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/halve.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::CappedTag<std::uint16_t, kMinHalvedWidth>;
using D8 = hn::Repartition<std::uint8_t, D16>;

// Sums of horizontal neighbours, as 16-bit lanes.
HWY_INLINE hn::Vec<D16> pair_sums(const std::uint8_t* p) {
  const D16 d16;
  const auto pairs = hn::BitCast(d16, hn::LoadU(D8(), p));
  return hn::Add(hn::And(pairs, hn::Set(d16, 0xFF)), hn::ShiftRight<8>(pairs));
}

void halve_row(const std::uint8_t* top, const std::uint8_t* bottom, int width, std::uint8_t* out) {
  const D16 d16;
  const hn::RebindToSigned<D16> di16;
  const hn::Rebind<std::uint8_t, D16> d8_half;
  const int lanes = static_cast<int>(hn::Lanes(d16));
  for (int i = 0; i < width; i += lanes) {
    const int x = std::min(i, width - lanes);
    const auto sum = hn::Add(pair_sums(top + 2 * x), pair_sums(bottom + 2 * x));
    const auto mean = hn::ShiftRight<2>(hn::Add(sum, hn::Set(d16, 2)));
    hn::StoreU(hn::DemoteTo(d8_half, hn::BitCast(di16, mean)), d8_half, out + x);
  }
}

void halve_rows(const ImageView& in, std::uint8_t* out, int out_stride) {
  for (int y = 0; y < in.height / 2; ++y) {
    halve_row(in.row(2 * y), in.row(2 * y + 1), in.width / 2, out + static_cast<std::ptrdiff_t>(y) * out_stride);
  }
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(halve_rows);

void halve(const ImageView& in, std::uint8_t* out, int out_stride) noexcept {
  HWY_DYNAMIC_DISPATCH(halve_rows)(in, out, out_stride);
}

}  // namespace epiline
#endif
