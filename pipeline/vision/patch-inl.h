// Sampling, templates and single steps of the KLT kernel. Compiled once per instruction set: no classic include guard.
#if defined(EPILINE_PATCH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef EPILINE_PATCH_INL_H
#undef EPILINE_PATCH_INL_H
#else
#define EPILINE_PATCH_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "pipeline/vision/klt.h"

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A patch is 16x16 samples around a sub-pixel centre, at -7.5 .. +7.5. A vector of 16-bit lanes holds one row, two rows
// half a patch apart on 32-lane machines, or half a row ("block" of columns) on 8-lane machines.
constexpr int kSide = kPatchSide;
constexpr int kPixels = kPatchPixels;
constexpr float kHalf = 0.5f * (kSide - 1);

using D = hn::CappedTag<std::int16_t, 2 * kSide>;
using V = hn::Vec<D>;
using D8 = hn::Rebind<std::uint8_t, D>;
using D32 = hn::Repartition<std::int32_t, D>;
using DF = hn::CappedTag<float, kSide / 2>;

constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
constexpr int kColumns = std::min(kLanes, kSide);  // of a block
constexpr int kStacked = kLanes / kColumns;        // rows in a vector
constexpr int kApart = kSide / kStacked;           // rows between them; vectors from top to bottom of a block
constexpr int kNextVector = kSide * kStacked;      // in a template, from a vector to the one below

HWY_INLINE V grey_at(const std::uint8_t* p, int stride) {
  if constexpr (kStacked == 1) return hn::PromoteTo(D(), hn::LoadU(D8(), p));
  const hn::Half<D8> half;
  return hn::PromoteTo(D(), hn::Combine(D8(), hn::LoadU(half, p + kApart * stride), hn::LoadU(half, p)));
}
HWY_INLINE V broadcast(int value) { return hn::Set(D(), static_cast<std::int16_t>(value)); }

// A centre, quantised to 1/128 px: the sample at the top left is at (x + fx / 128, y + fy / 128).
struct Place {
  int x, y, fx, fy;
  float cx, cy;  // the quantised centre
};

HWY_INLINE Place quantise(float cx, float cy) {
  const int ux = static_cast<int>(std::floor((cx - kHalf) * 128.f + 0.5f));
  const int uy = static_cast<int>(std::floor((cy - kHalf) * 128.f + 0.5f));
  return {ux >> 7,
          uy >> 7,
          ux & 127,
          uy & 127,
          static_cast<float>(ux) * (1.f / 128.f) + kHalf,
          static_cast<float>(uy) * (1.f / 128.f) + kHalf};
}

// Patch and the pixel round it that gradients and interpolation need.
HWY_INLINE bool fits(const ImageView& image, const Place& at) {
  return at.x >= 1 && at.y >= 1 && at.x + kSide + 1 < image.width && at.y + kSide + 1 < image.height;
}

// Interpolation in 16 bits. Across: 255 * 128 = 32640 at most. Down: MulFixedPoint15 with weights that leave grey x 32,
// at most 8161, and gradients x 32, at most 4081.
struct Bilinear {
  V left, right, upper, lower, upper_slope, lower_slope;

  explicit HWY_INLINE Bilinear(const Place& at)
      : left(broadcast(128 - at.fx)),
        right(broadcast(at.fx)),
        upper(broadcast((128 - at.fy) << 6)),
        lower(broadcast(at.fy << 6)),
        upper_slope(broadcast((128 - at.fy) << 5)),
        lower_slope(broadcast(at.fy << 5)) {}

  HWY_INLINE V across(V a, V b) const { return hn::Add(hn::Mul(a, left), hn::Mul(b, right)); }
  HWY_INLINE V across(const std::uint8_t* p, int stride) const {
    return across(grey_at(p, stride), grey_at(p + 1, stride));
  }
  HWY_INLINE V down(V above, V below) const {
    return hn::Add(hn::MulFixedPoint15(above, upper), hn::MulFixedPoint15(below, lower));
  }
  HWY_INLINE V down_slope(V above, V below) const {
    return hn::Add(hn::MulFixedPoint15(above, upper_slope), hn::MulFixedPoint15(below, lower_slope));
  }
};

// Sums of the lanes of stacked rows.
template <class Wide>
HWY_INLINE hn::Vec<hn::RebindToSigned<DF>> unstack(Wide lanes) {
  if constexpr (kStacked == 1) {
    return lanes;
  } else {
    const hn::RebindToSigned<DF> d;
    return hn::Add(hn::LowerHalf(d, lanes), hn::UpperHalf(d, lanes));
  }
}

// Sum of products of 16-bit lanes. A lane of one block adds 32 products of at most 8161 * 8191 and stays below 2^31;
// the whole patch would not, so blocks are added in float.
struct DotSum {
  hn::Vec<D32> sum, other;
  hn::Vec<DF> blocks;

  // Written out: gcc compiles an implicit constructor without the instruction set.
  HWY_INLINE DotSum() : sum(hn::Zero(D32())), other(hn::Zero(D32())), blocks(hn::Zero(DF())) {}
  HWY_INLINE void add(V a, V b) { sum = hn::ReorderWidenMulAccumulate(D32(), a, b, sum, other); }
  HWY_INLINE void end_block() {
    blocks = hn::Add(blocks, hn::ConvertTo(DF(), unstack(hn::Add(sum, other))));
    sum = other = hn::Zero(D32());
  }
  HWY_INLINE float total() const { return hn::GetLane(hn::SumOfLanes(DF(), blocks)); }
};

using Template = KltTemplate;

// Sums over the patch of grey (g), its gradients (x, y) and their products.
struct Moments {
  float g, x, y, gg, gx, gy, xx, xy, yy;
};

struct MomentSums {
  DotSum g, x, y, gg, gx, gy, xx, xy, yy;

  HWY_INLINE MomentSums() {}
  HWY_INLINE void add(V grey, V slope_x, V slope_y) {
    const V one = broadcast(1);
    g.add(grey, one);
    x.add(slope_x, one);
    y.add(slope_y, one);
    gg.add(grey, grey);
    gx.add(grey, slope_x);
    gy.add(grey, slope_y);
    xx.add(slope_x, slope_x);
    xy.add(slope_x, slope_y);
    yy.add(slope_y, slope_y);
  }
  HWY_INLINE void end_block() {
    for (DotSum* s : {&g, &x, &y, &gg, &gx, &gy, &xx, &xy, &yy}) s->end_block();
  }
  HWY_INLINE Moments totals() const {
    return {g.total(), x.total(), y.total(), gg.total(), gx.total(), gy.total(), xx.total(), xy.total(), yy.total()};
  }
};

// Reads interpolated rows from top to bottom.
struct RowReader {
  const Bilinear& weights;
  const std::uint8_t* p;
  int stride;
  V grey_above, slope_above;

  HWY_INLINE RowReader(const Bilinear& w, const std::uint8_t* first, int stride_bytes)
      : weights(w), p(first), stride(stride_bytes), grey_above(hn::Zero(D())), slope_above(hn::Zero(D())) {
    V grey = hn::Zero(D()), slope = hn::Zero(D());
    next(grey, slope);
  }
  HWY_INLINE void next(V& grey, V& slope) {
    const V before = grey_at(p - 1, stride), a = grey_at(p, stride);
    const V b = grey_at(p + 1, stride), after = grey_at(p + 2, stride);
    const V grey_below = weights.across(a, b);
    const V slope_below = weights.across(hn::Sub(b, before), hn::Sub(after, a));
    grey = weights.down(grey_above, grey_below);
    slope = weights.down_slope(slope_above, slope_below);
    grey_above = grey_below;
    slope_above = slope_below;
    p += stride;
  }
};

// Fills grey and plain gradients, and sums their moments in the same pass.
HWY_INLINE Moments sample(const ImageView& image, const Place& at, Template& t) {
  const D d;
  const Bilinear weights(at);
  t.origin = static_cast<std::int16_t>(32 * image.row(at.y + kSide / 2)[at.x + kSide / 2]);
  const V origin = broadcast(t.origin);
  MomentSums sums;
  for (int c = 0; c < kSide; c += kColumns) {
    RowReader rows(weights, image.row(at.y - 1) + at.x + c, image.stride);
    V above, here, below, slope, slope_below;
    rows.next(above, slope_below);
    rows.next(here, slope);
    for (int i = c; i < kPixels; i += kNextVector) {
      rows.next(below, slope_below);
      const V slope_y = hn::ShiftRight<1>(hn::Sub(below, above));
      hn::Store(here, d, t.grey + i);
      hn::Store(slope, d, t.gx + i);
      hn::Store(slope_y, d, t.gy + i);
      sums.add(hn::Sub(here, origin), slope, slope_y);
      above = here;
      here = below;
      slope = slope_below;
    }
    sums.end_block();
  }
  return sums.totals();
}

// gradients -= a + b * (grey - origin), with b as a 15-bit fraction.
HWY_INLINE void subtract_line(const Template& t, float a, float b, std::int16_t* gradients) {
  const D d;
  const V origin = broadcast(t.origin);
  const V constant = broadcast(static_cast<int>(std::lrintf(a)));
  const V factor = broadcast(static_cast<int>(std::lrintf(b * 32768.f)));
  for (int i = 0; i < kPixels; i += kLanes) {
    const V grey = hn::Sub(hn::Load(d, t.grey + i), origin);
    const V line = hn::Add(hn::MulFixedPoint15(grey, factor), constant);
    hn::Store(hn::Sub(hn::Load(d, gradients + i), line), d, gradients + i);
  }
}

// Keeps corrected gradients below 8191: 4081 + 510 (mean, telescopes along the row) + 0.44 * 8161.
constexpr float kMaxSlope = 0.44f;

// Makes the gradients blind to what gain and bias can explain, inverts their matrix.
HWY_INLINE void eliminate_gain_and_bias(const Moments& m, Template& t) {
  constexpr float n = kPixels;
  const float mean_x = m.x / n, mean_y = m.y / n;
  t.mean = m.g / n;
  t.energy = std::max(m.gg - m.g * t.mean, 1.f);
  const float cov_x = m.gx - m.g * mean_x, cov_y = m.gy - m.g * mean_y;
  const float bx = std::clamp(cov_x / t.energy, -kMaxSlope, kMaxSlope);
  const float by = std::clamp(cov_y / t.energy, -kMaxSlope, kMaxSlope);
  subtract_line(t, mean_x - bx * t.mean, bx, t.gx);
  subtract_line(t, mean_y - by * t.mean, by, t.gy);
  const float xx = m.xx - m.x * mean_x - (2.f * cov_x - bx * t.energy) * bx;
  const float xy = m.xy - m.x * mean_y - cov_x * by - cov_y * bx + bx * by * t.energy;
  const float yy = m.yy - m.y * mean_y - (2.f * cov_y - by * t.energy) * by;
  const float det = xx * yy - xy * xy, half_trace = 0.5f * (xx + yy);
  t.eigenvalue = (half_trace - std::sqrt(std::max(half_trace * half_trace - det, 0.f))) / (n * 32.f * 32.f);
  const float inv = det > 0.f ? 1.f / det : 0.f;
  t.inv_xx = yy * inv;
  t.inv_xy = -xy * inv;
  t.inv_yy = xx * inv;
}

// `at` must fit, (cx, cy) is the centre it was quantised from.
inline HWY_NOINLINE void build_template(const ImageView& image, const Place& at, float cx, float cy, Template& t) {
  eliminate_gain_and_bias(sample(image, at, t), t);
  t.offset_x = at.cx - cx;
  t.offset_y = at.cy - cy;
}

struct Move {
  float x, y;  // px of the level
};

// Gauss-Newton step of the template's centre in another image, seen from `at`.
HWY_INLINE Move gauss_newton_step(const ImageView& image, const Place& at, const Template& t) {
  const D d;
  const Bilinear weights(at);
  DotSum sum_x, sum_y;
  for (int c = 0; c < kSide; c += kColumns) {
    const std::uint8_t* p = image.row(at.y) + at.x + c;
    V above = weights.across(p, image.stride);
    for (int i = c; i < kPixels; i += kNextVector) {
      p += image.stride;
      const V below = weights.across(p, image.stride);
      const V error = hn::Sub(weights.down(above, below), hn::Load(d, t.grey + i));
      sum_x.add(error, hn::Load(d, t.gx + i));
      sum_y.add(error, hn::Load(d, t.gy + i));
      above = below;
    }
    sum_x.end_block();
    sum_y.end_block();
  }
  const float x = sum_x.total(), y = sum_y.total();
  return {-(t.inv_xx * x + t.inv_xy * y), -(t.inv_xy * x + t.inv_yy * y)};
}

// Sums for the correlation of a template with another patch.
struct CorrelationSums {
  const Template& t;
  V origin, one;
  DotSum g, gg, gt;

  explicit HWY_INLINE CorrelationSums(const Template& with)
      : t(with), origin(broadcast(with.origin)), one(broadcast(1)) {}
  HWY_INLINE void add(V patch, int i) {
    const V grey = hn::Sub(patch, origin);
    g.add(grey, one);
    gg.add(grey, grey);
    gt.add(grey, hn::Sub(hn::Load(D(), t.grey + i), origin));
  }
  HWY_INLINE void end_block() {
    for (DotSum* s : {&g, &gg, &gt}) s->end_block();
  }
  HWY_INLINE float correlation() const {
    const float sum = g.total();
    const float energy = std::max(gg.total() - sum * sum / kPixels, 1.f);
    return (gt.total() - sum * t.mean) / std::sqrt(energy * t.energy);
  }
};

// Normalised correlation, -1 to 1, of the template with the patch at `at`.
HWY_INLINE float correlate(const ImageView& image, const Place& at, const Template& t) {
  const Bilinear weights(at);
  CorrelationSums sums(t);
  for (int c = 0; c < kSide; c += kColumns) {
    const std::uint8_t* p = image.row(at.y) + at.x + c;
    V above = weights.across(p, image.stride);
    for (int i = c; i < kPixels; i += kNextVector) {
      p += image.stride;
      const V below = weights.across(p, image.stride);
      sums.add(weights.down(above, below), i);
      above = below;
    }
    sums.end_block();
  }
  return sums.correlation();
}

// With the patch at the nearest whole pixel: half the work.
HWY_INLINE float correlate_roughly(const ImageView& image, const Place& at, const Template& t) {
  CorrelationSums sums(t);
  for (int c = 0; c < kSide; c += kColumns) {
    const std::uint8_t* p = image.row(at.y + (at.fy >> 6)) + at.x + (at.fx >> 6) + c;
    for (int i = c; i < kPixels; i += kNextVector, p += image.stride)
      sums.add(hn::ShiftLeft<5>(grey_at(p, image.stride)), i);
    sums.end_block();
  }
  return sums.correlation();
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // include guard
