#pragma once
// What a V4L2 device lists of itself. No heap, unless `use` takes it.
#include <linux/videodev2.h>

#include "drivers/sensors/camera/v4l2_device.h"

namespace epiline {

inline constexpr unsigned kMostListed = 64;  ///< of each kind: a driver that never says "no more" must not hold us

inline double rate_hz_of(const v4l2_fract& interval) noexcept {
  return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

template <class Use>
void each_format(const V4l2Device& device, Use use) {
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; format.index < kMostListed && device.call(VIDIOC_ENUM_FMT, &format) == 0; ++format.index) use(format);
}

/// One range, or each size.
template <class Use>
void each_size(const V4l2Device& device, std::uint32_t fourcc, Use use) {
  v4l2_frmsizeenum size{};
  size.pixel_format = fourcc;
  for (; size.index < kMostListed && device.call(VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
    use(size);
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) return;
  }
}

/// One range, or each rate.
template <class Use>
void each_rate(const V4l2Device& device, std::uint32_t fourcc, unsigned width, unsigned height, Use use) {
  v4l2_frmivalenum rate{};
  rate.pixel_format = fourcc;
  rate.width = width;
  rate.height = height;
  for (; rate.index < kMostListed && device.call(VIDIOC_ENUM_FRAMEINTERVALS, &rate) == 0; ++rate.index) {
    use(rate);
    if (rate.type != V4L2_FRMIVAL_TYPE_DISCRETE) return;
  }
}

/// With the number of the file that has the control; until `use` returns false.
template <class Use>
void each_control(const V4l2Controls& controls, Use use) {
  constexpr std::uint32_t kNext = V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND;
  bool goes_on = true;
  for (std::size_t i = 0; goes_on && i < controls.control_files(); ++i) {
    const int fd = controls.control_file(i);
    v4l2_query_ext_ctrl query{};
    query.id = kNext;
    while (goes_on && controls.call(fd, VIDIOC_QUERY_EXT_CTRL, &query) == 0) {
      goes_on = use(query, i);
      query.id |= kNext;
    }
  }
}

}  // namespace epiline
