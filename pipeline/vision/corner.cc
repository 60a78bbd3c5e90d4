#include "pipeline/vision/corner.h"

#include <algorithm>
#include <cmath>

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/corner.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::CappedTag<std::int16_t, 32>;
using D8 = hn::Rebind<std::uint8_t, D16>;
using D32 = hn::Repartition<std::int32_t, D16>;
using DF = hn::RebindToFloat<D32>;

// Blocks of 2x2 px: those of the cell, one more on either side, and what a last vector writes beyond them.
constexpr int kMaxBlocks = kMaxCellSide / 2;
constexpr int kRowLength = kMaxBlocks + 48;

// Structure tensor of a row of blocks: sums of products of differences (twice the gradient).
struct TensorRow {
  HWY_ALIGN float xx[kRowLength] = {};
  HWY_ALIGN float xy[kRowLength] = {};
  HWY_ALIGN float yy[kRowLength] = {};
};

// Sums over neighbouring lanes, whatever order the instruction set multiplies in.
struct PairSums {
  hn::Vec<D32> first, second;

  HWY_INLINE PairSums() : first(hn::Zero(D32())), second(hn::Zero(D32())) {}
  HWY_INLINE void add(hn::Vec<D16> a, hn::Vec<D16> b) {
    first = hn::ReorderWidenMulAccumulate(D32(), a, b, first, second);
  }
  HWY_INLINE void store(float* to) const {
    hn::StoreU(hn::ConvertTo(DF(), hn::RearrangeToOddPlusEven(first, second)), DF(), to);
  }
};

HWY_INLINE hn::Vec<D16> difference(const std::uint8_t* minus, const std::uint8_t* plus) {
  const D16 d;
  return hn::Sub(hn::PromoteTo(d, hn::LoadU(D8(), plus)), hn::PromoteTo(d, hn::LoadU(D8(), minus)));
}

// `first`: top left pixel of the first block. Reads up to 33 px past the last block.
HWY_INLINE void tensor_row(const std::uint8_t* first, int stride, int blocks, TensorRow& out) {
  const int step = static_cast<int>(hn::Lanes(DF()));
  for (int i = 0; i < blocks; i += step) {
    PairSums xx, xy, yy;
    for (const std::uint8_t* p : {first + 2 * i, first + 2 * i + stride}) {
      const auto gx = difference(p - 1, p + 1);
      const auto gy = difference(p - stride, p + stride);
      xx.add(gx, gx);
      xy.add(gx, gy);
      yy.add(gy, gy);
    }
    xx.store(out.xx + i);
    xy.store(out.xy + i);
    yy.store(out.yy + i);
  }
}

// Column sums of three rows of blocks.
HWY_INLINE void add_rows(const TensorRow (&rows)[3], int blocks, TensorRow& out) {
  const DF df;
  const auto add = [&](const float* a, const float* b, const float* c, float* to) {
    hn::Store(hn::Add(hn::Add(hn::Load(df, a), hn::Load(df, b)), hn::Load(df, c)), df, to);
  };
  for (int i = 0; i < blocks; i += static_cast<int>(hn::Lanes(df))) {
    add(rows[0].xx + i, rows[1].xx + i, rows[2].xx + i, out.xx + i);
    add(rows[0].xy + i, rows[1].xy + i, rows[2].xy + i, out.xy + i);
    add(rows[0].yy + i, rows[1].yy + i, rows[2].yy + i, out.yy + i);
  }
}

// Scores of blocks 1 .. blocks of `columns`.
HWY_INLINE void score_row(const TensorRow& columns, int blocks, float edge_share, float* score) {
  const DF df;
  constexpr float kToMean = 1.f / (4.f * 36.f);  // differences are twice the gradient; 36 px
  const auto across = [&](const float* p) {
    return hn::Add(hn::Add(hn::LoadU(df, p), hn::LoadU(df, p + 1)), hn::LoadU(df, p + 2));
  };
  const auto half = hn::Set(df, 0.5f);
  for (int i = 0; i < blocks; i += static_cast<int>(hn::Lanes(df))) {
    const auto xx = across(columns.xx + i), xy = across(columns.xy + i), yy = across(columns.yy + i);
    const auto middle = hn::Mul(hn::Add(xx, yy), half);
    const auto difference_half = hn::Mul(hn::Sub(xx, yy), half);
    const auto radius = hn::Sqrt(hn::Add(hn::Mul(difference_half, difference_half), hn::Mul(xy, xy)));
    const auto smaller = hn::Sub(middle, radius), larger = hn::Add(middle, radius);
    hn::StoreU(hn::Mul(hn::NegMulAdd(hn::Set(df, edge_share), larger, smaller), hn::Set(df, kToMean)), df, score + i);
  }
}

HWY_INLINE float largest(const float* score, int blocks) {
  const DF df;
  const int lanes = static_cast<int>(hn::Lanes(df));
  auto most = hn::Zero(df);
  for (int i = 0; i < blocks; i += lanes) {
    auto s = hn::LoadU(df, score + i);
    if (i + lanes > blocks) s = hn::IfThenElseZero(hn::FirstN(df, static_cast<std::size_t>(blocks - i)), s);
    most = hn::Max(most, s);
  }
  return hn::GetLane(hn::MaxOfLanes(df, most));
}

// Zeroes the blocks of a row whose centre lies in a disc.
HWY_INLINE void blank_discs(const Discs& taken, float first_x, float y, int blocks, float* score) {
  for (int i = 0; i < taken.count; ++i) {
    const float dy = y - taken.y[i];
    const float reach2 = taken.radius * taken.radius - dy * dy;
    if (reach2 <= 0.f) continue;
    const float reach = std::sqrt(reach2), centre = taken.x[i] - first_x;
    const int from = std::max(0, static_cast<int>(std::ceil((centre - reach) * 0.5f)));
    const int to = std::min(blocks - 1, static_cast<int>(std::floor((centre + reach) * 0.5f)));
    for (int c = from; c <= to; ++c) score[c] = 0.f;
  }
}

Corner best_in_cell(const ImageView& image, const Cell& cell, const Discs& taken, float edge_share) {
  TensorRow rows[3], columns;
  HWY_ALIGN float score[kRowLength];
  const int blocks = cell.width / 2;
  Corner best;
  for (int j = -1; j <= cell.height / 2; ++j) {
    tensor_row(image.row(cell.y + 2 * j) + cell.x - 2, image.stride, blocks + 2, rows[(j + 3) % 3]);
    if (j < 1) continue;
    add_rows(rows, blocks + 2, columns);
    score_row(columns, blocks, edge_share, score);
    const float x = static_cast<float>(cell.x) + 0.5f, y = static_cast<float>(cell.y + 2 * (j - 1)) + 0.5f;
    blank_discs(taken, x, y, blocks, score);
    const float top = largest(score, blocks);
    if (top <= best.score) continue;
    const auto column = std::find(score, score + blocks, top) - score;
    best = {x + 2.f * static_cast<float>(column), y, top};
  }
  return best;
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(best_in_cell);

Corner best_corner(const ImageView& image, const Cell& cell, const Discs& taken, float edge_share) noexcept {
  return HWY_DYNAMIC_DISPATCH(best_in_cell)(image, cell, taken, edge_share);
}

}  // namespace epiline
#endif
