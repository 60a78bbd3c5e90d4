#include "drivers/laboratory/render/trace.h"

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "drivers/laboratory/render/trace.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef EPILINE_TRACE_TABLES
#define EPILINE_TRACE_TABLES
namespace epiline {
inline constexpr float kFar = 1e30F;
inline constexpr auto kLevelOffsets = [] {
  std::array<std::int32_t, TextureAtlas::kLevels> offsets{};
  for (int l = 0; l < TextureAtlas::kLevels; ++l) offsets[l] = TextureAtlas::level_offset(l);
  return offsets;
}();
}  // namespace epiline
#endif

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kTileSize>;
using DI = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;

struct Rays {
  V x, y, z;
};

HWY_INLINE V dot(const std::array<float, 3>& a, const Rays& f) {
  const D d;
  return hn::MulAdd(hn::Set(d, a[0]), f.x, hn::MulAdd(hn::Set(d, a[1]), f.y, hn::Mul(hn::Set(d, a[2]), f.z)));
}

HWY_INLINE Rays bearings_at(const BearingRow& row, std::ptrdiff_t offset) {
  const D d;
  return {hn::LoadU(d, row.at[0] + offset), hn::LoadU(d, row.at[1] + offset), hn::LoadU(d, row.at[2] + offset)};
}

HWY_INLINE Rays half_difference(const Rays& a, const Rays& b) {
  const V half = hn::Set(D(), 0.5F);
  return {hn::Mul(half, hn::Sub(a.x, b.x)), hn::Mul(half, hn::Sub(a.y, b.y)), hn::Mul(half, hn::Sub(a.z, b.z))};
}

/// Bearings of the pixels from `x` on and how they change to the right and downwards.
struct Pencil {
  Rays centre, right, down;

  HWY_INLINE Pencil(const BearingRow& row, int x)
      : centre(bearings_at(row, x)),
        right(half_difference(bearings_at(row, x + 1), bearings_at(row, x - 1))),
        down(half_difference(bearings_at(row, x + row.stride), bearings_at(row, x - row.stride))) {}

  HWY_INLINE Rays at(float dx, float dy) const {
    const D d;
    const V x = hn::Set(d, dx), y = hn::Set(d, dy);
    return {hn::MulAdd(x, right.x, hn::MulAdd(y, down.x, centre.x)),
            hn::MulAdd(x, right.y, hn::MulAdd(y, down.y, centre.y)),
            hn::MulAdd(x, right.z, hn::MulAdd(y, down.z, centre.z))};
  }
};

struct Hits {
  V distance, u, v, slope;  ///< slope: cosine between ray and normal, negative
  VI panel;                 ///< -1: none
};

HWY_INLINE Hits nearest_hits(const TraceJob& job, const PanelInView* panels, const Rays& f) {
  const D d;
  const DI di;
  Hits h{hn::Set(d, kFar), hn::Zero(d), hn::Zero(d), hn::Set(d, -1.0F), hn::Set(di, -1)};
  for (int k = 0; k < job.panel_count; ++k) {
    if (hn::AllTrue(d, hn::Lt(h.distance, hn::Set(d, job.looks->nearest[k])))) break;
    const PanelInView& p = panels[k];
    const V slope = dot(p.normal, f);
    const V t = hn::Div(hn::Set(d, p.distance), slope);
    const V u = hn::MulAdd(t, dot(p.e_u, f), hn::Set(d, p.u0));
    const V v = hn::MulAdd(t, dot(p.e_v, f), hn::Set(d, p.v0));
    const auto in_front = hn::And(hn::Gt(t, hn::Zero(d)), hn::Lt(t, h.distance));
    const auto inside = hn::And(hn::Le(hn::Abs(u), hn::Set(d, p.half_u)), hn::Le(hn::Abs(v), hn::Set(d, p.half_v)));
    const auto hit = hn::And(in_front, inside);
    h.distance = hn::IfThenElse(hit, t, h.distance);
    h.u = hn::IfThenElse(hit, u, h.u);
    h.v = hn::IfThenElse(hit, v, h.v);
    h.slope = hn::IfThenElse(hit, slope, h.slope);
    h.panel = hn::IfThenElse(hn::RebindMask(di, hit), hn::Set(di, k), h.panel);
  }
  return h;
}

/// The bilinear value of one mip level at texel (x, y) of level 0.
HWY_INLINE V texel(const std::uint8_t* atlas, VI texture, VI level, V x, V y) {
  const D d;
  const DI di;
  const VI size = hn::Shr(hn::Set(di, TextureAtlas::size(0)), level);
  const VI mask = hn::Sub(size, hn::Set(di, 1));
  const V scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(di, 127), level)));
  const V half = hn::Set(d, 0.5F);
  const V xl = hn::MulSub(x, scale, half), yl = hn::MulSub(y, scale, half);
  const V xf = hn::Floor(xl), yf = hn::Floor(yl);
  const V wx = hn::Sub(xl, xf), wy = hn::Sub(yl, yf);
  const VI xi = hn::And(hn::ConvertTo(di, xf), mask);
  const VI y0 = hn::And(hn::ConvertTo(di, yf), mask), y1 = hn::And(hn::Add(y0, hn::Set(di, 1)), mask);
  const VI stride = hn::Add(size, hn::Set(di, TextureAtlas::kRowPadding));
  const VI base = hn::Add(hn::Add(texture, hn::GatherIndex(di, kLevelOffsets.data(), level)), xi);
  const auto row = [&](VI yi) {
    const auto* words = reinterpret_cast<const std::int32_t*>(atlas);
    const VI word = hn::GatherOffset(di, words, hn::Add(hn::Mul(yi, stride), base));
    const VI byte = hn::Set(di, 255);
    const V left = hn::ConvertTo(d, hn::And(word, byte));
    const V right = hn::ConvertTo(d, hn::And(hn::ShiftRight<8>(word), byte));
    return hn::MulAdd(wx, hn::Sub(right, left), left);
  };
  const V top = row(y0), low = row(y1);
  return hn::MulAdd(wy, hn::Sub(low, top), top);
}

/// How much of the lamp a glossy surface mirrors. Dents, taken from the texture, let the highlight break up and crawl.
HWY_INLINE V highlight(const RaySample& sample, const Rays& f, V slope, V facing, V reflectance) {
  const D d;
  constexpr float kDents = 0.35F / 128, kFlat = 100;
  const V mirrored = hn::NegMulAdd(hn::Mul(hn::Set(d, 2.0F), slope), facing, dot(sample.lamp, f));
  const V dented = hn::MulAdd(hn::Set(d, kDents), hn::Sub(reflectance, hn::Set(d, kFlat)), mirrored);
  V power = hn::Min(hn::Max(dented, hn::Zero(d)), hn::Set(d, 1.2F));
  for (int i = 0; i < 4; ++i) power = hn::Mul(power, power);  // to the 16th
  return power;
}

HWY_INLINE V radiance_of(const TraceJob& job, const RaySample& sample, const Rays& f, const Hits& h) {
  const D d;
  const DI di;
  const PanelLooks& looks = *job.looks;
  const VI panel = hn::Max(h.panel, hn::Zero(di));  // some panel where there is none
  const V scale = hn::GatherIndex(d, looks.texels_per_m.data(), panel);
  // Half of what a slanted surface is stretched by is blurred away, the rest is left to the samples.
  const V stretch = hn::Max(hn::Set(d, 1.0F), hn::Div(hn::Set(d, 0.5F), hn::Neg(h.slope)));
  const V footprint =
      hn::Max(hn::Mul(hn::Mul(h.distance, hn::Set(d, job.pixel_rad)), hn::Mul(scale, stretch)), hn::Set(d, 1.0F));
  // log2, linear between powers of two: close enough to blend levels
  const VI bits = hn::BitCast(di, footprint);
  const VI exponent = hn::Sub(hn::ShiftRight<23>(bits), hn::Set(di, 127));
  const VI level = hn::Min(exponent, hn::Set(di, TextureAtlas::kLevels - 2));
  const VI one = hn::Set(di, 0x3F800000), fraction = hn::And(bits, hn::Set(di, 0x7FFFFF));
  const V blend = hn::IfThenElse(hn::RebindMask(d, hn::Gt(exponent, level)), hn::Set(d, 1.0F),
                                 hn::Sub(hn::BitCast(d, hn::Or(fraction, one)), hn::Set(d, 1.0F)));
  const V x = hn::MulAdd(h.u, scale, hn::GatherIndex(d, looks.x0.data(), panel));
  const V y = hn::MulAdd(h.v, scale, hn::GatherIndex(d, looks.y0.data(), panel));
  const VI texture = hn::GatherIndex(di, looks.texture.data(), panel);
  const V fine = texel(job.atlas, texture, level, x, y);
  const V coarse = texel(job.atlas, texture, hn::Add(level, hn::Set(di, 1)), x, y);
  const V reflectance = hn::MulAdd(blend, hn::Sub(coarse, fine), fine);
  const V mirrored = highlight(sample, f, h.slope, hn::GatherIndex(d, looks.facing.data(), panel), reflectance);
  const V seen = hn::MulAdd(reflectance, hn::GatherIndex(d, looks.shade.data(), panel),
                            hn::Mul(mirrored, hn::GatherIndex(d, looks.gloss.data(), panel)));
  return hn::IfThenElse(hn::Lt(h.distance, hn::Set(d, kFar)), seen, hn::Set(d, job.sky));
}

void trace(const TraceJob& job, float* radiance) {
  const D d;
  const DI di;
  for (int x = 0; x < kTileSize; x += static_cast<int>(hn::Lanes(d))) {
    const Pencil pencil(job.bearings, x);
    V sum = hn::Zero(d);
    VI first = hn::Zero(di);
    bool same = true;
    int taken = 0;
    while (taken < job.inner_samples || (!same && taken < job.sample_count)) {
      const RaySample& sample = job.samples[taken];
      const Rays f = pencil.at(sample.dx, sample.dy);
      const Hits hits = nearest_hits(job, sample.panels, f);
      sum = hn::Add(sum, radiance_of(job, sample, f, hits));
      if (taken == 0) first = hn::Set(di, hn::GetLane(hits.panel));
      same = same && hn::AllTrue(di, hn::Eq(hits.panel, first));
      ++taken;
    }
    hn::StoreU(hn::Mul(sum, hn::Set(d, 1.0F / static_cast<float>(taken))), d, radiance + x);
  }
}

/// Noise of unit variance, nearly normal: the sum of four random bytes. Mixing as in MurmurHash3's last step.
HWY_INLINE V noise(hn::Vec<hn::RebindToUnsigned<D>> counter) {
  const D d;
  const DI di;
  const hn::RebindToUnsigned<D> du;
  auto h = hn::Mul(counter, hn::Set(du, 0x9E3779B9U));
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<16>(h)), hn::Set(du, 0x85EBCA6BU));
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<13>(h)), hn::Set(du, 0xC2B2AE35U));
  h = hn::Xor(h, hn::ShiftRight<16>(h));
  const auto byte = hn::Set(du, 255U);
  const auto sum = hn::Add(hn::Add(hn::And(h, byte), hn::And(hn::ShiftRight<8>(h), byte)),
                           hn::Add(hn::And(hn::ShiftRight<16>(h), byte), hn::ShiftRight<24>(h)));
  constexpr float kSigma = 147.8F;  // sqrt(4 (256^2 - 1) / 12)
  return hn::Mul(hn::Sub(hn::ConvertTo(d, hn::BitCast(di, sum)), hn::Set(d, 510.0F)), hn::Set(d, 1 / kSigma));
}

void expose(const SensorRow& row, int width, std::uint8_t* out) {
  const D d;
  const DI di;
  const hn::RebindToUnsigned<D> du;
  const hn::Rebind<std::uint8_t, D> d8;
  const V read_variance = hn::Set(d, row.read_sigma * row.read_sigma);
  for (int x = 0; x < width; x += static_cast<int>(hn::Lanes(d))) {
    const V light = hn::Mul(hn::LoadU(d, row.radiance + x), hn::LoadU(d, row.vignette + x));
    const V level = hn::Mul(light, hn::Set(d, row.gain));
    const V sigma = hn::Sqrt(hn::MulAdd(level, hn::Set(d, row.shot_factor), read_variance));
    const auto counter = hn::Add(hn::Set(du, row.seed), hn::Iota(du, static_cast<std::uint32_t>(x)));
    const V value = hn::MulAdd(sigma, noise(counter), level);
    const V limited = hn::Min(hn::Max(value, hn::Zero(d)), hn::Set(d, 255.0F));
    hn::StoreU(hn::DemoteTo(d8, hn::ConvertTo(di, hn::Add(limited, hn::Set(d, 0.5F)))), d8, out + x);
  }
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(trace);
HWY_EXPORT(expose);

void trace_row(const TraceJob& job, float* radiance) noexcept { HWY_DYNAMIC_DISPATCH(trace)(job, radiance); }

void expose_row(const SensorRow& row, int width, std::uint8_t* out) noexcept {
  HWY_DYNAMIC_DISPATCH(expose)(row, width, out);
}

}  // namespace epiline
#endif
