// What a device has to offer, for a user who asked for something else.
#include <linux/videodev2.h>

#include <cstdarg>
#include <cstdio>

#include "drivers/sensors/camera/v4l2_device.h"

namespace epiline {

namespace {

constexpr unsigned kMost = 64;  // of each kind: a driver that never says "no more" must not hold us

/// As much as fits; what does not ends in dots.
class Text {
 public:
  explicit Text(std::span<char> into) noexcept : into_(into) { into_[0] = '\0'; }
  [[gnu::format(printf, 2, 3)]] void add(const char* format, ...) noexcept {
    if (is_full_) return;
    std::va_list values;
    va_start(values, format);
    const int count = std::vsnprintf(into_.data() + used_, into_.size() - used_, format, values);
    va_end(values);
    if (count >= 0 && used_ + static_cast<std::size_t>(count) + 4 < into_.size()) {
      used_ += static_cast<std::size_t>(count);
      return;
    }
    is_full_ = true;
    std::snprintf(into_.data() + used_, into_.size() - used_, "...");
  }
  bool is_empty() const noexcept { return used_ == 0; }

 private:
  std::span<char> into_;
  std::size_t used_ = 0;
  bool is_full_ = false;
};

double rate_of(const v4l2_fract& interval) noexcept {
  return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

}  // namespace

void V4l2Device::list_rates(std::uint32_t fourcc, unsigned width, unsigned height, std::span<char> text) noexcept {
  Text list(text);
  v4l2_frmivalenum rate{};
  rate.pixel_format = fourcc;
  rate.width = width;
  rate.height = height;
  for (; rate.index < kMost && call(VIDIOC_ENUM_FRAMEINTERVALS, &rate) == 0; ++rate.index) {
    if (rate.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
      list.add("%.4g to %.4g", rate_of(rate.stepwise.max), rate_of(rate.stepwise.min));
      return;
    }
    list.add("%s%.4g", list.is_empty() ? "" : ", ", rate_of(rate.discrete));
  }
}

void V4l2Device::list_sizes(std::uint32_t fourcc, std::span<char> text) noexcept {
  Text list(text);
  v4l2_frmsizeenum size{};
  size.pixel_format = fourcc;
  for (; size.index < kMost && call(VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      const v4l2_frmsize_stepwise& range = size.stepwise;
      list.add("%ux%u to %ux%u", range.min_width, range.min_height, range.max_width, range.max_height);
      return;
    }
    list.add("%s%ux%u", list.is_empty() ? "" : ", ", size.discrete.width, size.discrete.height);
    char rates[96];
    list_rates(fourcc, size.discrete.width, size.discrete.height, rates);
    if (rates[0] != '\0') list.add(" (%s Hz)", rates);
  }
}

void V4l2Device::list_offers(std::span<char> text) noexcept {
  Text list(text);
  char not_read[64];
  Text others(not_read);
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; format.index < kMost && call(VIDIOC_ENUM_FMT, &format) == 0; ++format.index) {
    const std::uint32_t fourcc = format.pixelformat;
    char name[5];
    write_fourcc(fourcc, name);
    bool is_read = false;
    for (int i = 0; i < static_cast<int>(PixelFormat::kCount); ++i)
      is_read = is_read || fourcc_of(static_cast<PixelFormat>(i)) == fourcc;
    if (!is_read) {
      others.add("%s%s", others.is_empty() ? "" : ", ", name);
      continue;
    }
    char sizes[280];
    list_sizes(fourcc, sizes);
    list.add("%s%s %s", list.is_empty() ? "" : "; ", name, sizes);
  }
  if (!others.is_empty()) list.add("%snot read: %s", list.is_empty() ? "" : "; ", not_read);
}

}  // namespace epiline
