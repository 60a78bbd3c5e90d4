#include "pipeline/vision/line_scan.h"

#include "pipeline/vision/klt.h"
#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/line_scan.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/vision/patch-inl.h"

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {

bool scan_all(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places, int count) {
  constexpr float kLeastEigenvalue = 1e-3f;  // (grey/px)^2: anything but a blank patch
  for (int i = 0; i < count; ++i) places[i].correlation = -1;
  const Place from = quantise(x, y);
  if (!fits(image, from)) return false;
  Template patch;
  build_template(image, from, x, y, patch);
  if (!(patch.eigenvalue >= kLeastEigenvalue)) return false;
  for (int i = 0; i < count; ++i) {
    const Place at = quantise(places[i].x + patch.offset_x, places[i].y + patch.offset_y);
    if (fits(other, at)) places[i].correlation = correlate_roughly(other, at, patch);
  }
  return true;
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(scan_all);

bool scan_places(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places,
                 int count) noexcept {
  return HWY_DYNAMIC_DISPATCH(scan_all)(image, x, y, other, places, count);
}

}  // namespace epiline
#endif
