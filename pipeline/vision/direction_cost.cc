#include "pipeline/vision/direction_cost.h"

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/direction_cost.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using DF = hn::CappedTag<float, 16>;
using VF = hn::Vec<DF>;

HWY_INLINE VF sum3(VF a, VF b, VF c) { return hn::Add(hn::Add(a, b), c); }
HWY_INLINE VF minor(VF a, VF b, VF c, VF d) { return hn::Sub(hn::Mul(a, b), hn::Mul(c, d)); }

// e = now . (t x before). Its gradient with respect to a bearing, in that bearing's tangent plane, has the squared
// length |t x other|^2 - e^2.
float cost_of(const BearingPairs& pairs, const float* t, float limit2, float* distance2) {
  const DF d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const VF tx = hn::Set(d, t[0]), ty = hn::Set(d, t[1]), tz = hn::Set(d, t[2]), limit = hn::Set(d, limit2);
  const VF tiny = hn::Set(d, 1e-12f);
  VF total = hn::Zero(d);
  for (int i = 0; i < pairs.size; i += lanes) {
    const VF ax = hn::Load(d, pairs.before_x + i), ay = hn::Load(d, pairs.before_y + i),
             az = hn::Load(d, pairs.before_z + i);
    const VF bx = hn::Load(d, pairs.now_x + i), by = hn::Load(d, pairs.now_y + i), bz = hn::Load(d, pairs.now_z + i);
    const VF lx = minor(ty, az, tz, ay), ly = minor(tz, ax, tx, az), lz = minor(tx, ay, ty, ax);
    const VF mx = minor(ty, bz, tz, by), my = minor(tz, bx, tx, bz), mz = minor(tx, by, ty, bx);
    const VF e = sum3(hn::Mul(lx, bx), hn::Mul(ly, by), hn::Mul(lz, bz));
    const VF e2 = hn::Mul(e, e);
    const VF l2 = sum3(hn::Mul(lx, lx), hn::Mul(ly, ly), hn::Mul(lz, lz));
    const VF m2 = sum3(hn::Mul(mx, mx), hn::Mul(my, my), hn::Mul(mz, mz));
    const VF weight = hn::Max(hn::Sub(hn::Add(l2, m2), hn::Add(e2, e2)), tiny);
    const VF distance = hn::Div(e2, weight);
    hn::Store(distance, d, distance2 + i);
    VF cut = hn::Min(distance, limit);
    if (i + lanes > pairs.size) {
      cut = hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(pairs.size - i)), cut);
    }
    total = hn::Add(total, cut);
  }
  return hn::GetLane(hn::SumOfLanes(d, total));
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(cost_of);

float direction_cost(const BearingPairs& pairs, const float direction[3], float limit2, float* distance2) noexcept {
  return HWY_DYNAMIC_DISPATCH(cost_of)(pairs, direction, limit2, distance2);
}

}  // namespace epiline
#endif
