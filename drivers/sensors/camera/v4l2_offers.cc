// What a device has to offer, for a user who asked for something else.
#include <cstdarg>
#include <cstdio>

#include "drivers/sensors/camera/v4l2_lists.h"

namespace epiline {

namespace {

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

}  // namespace

void V4l2Device::list_rates(std::uint32_t fourcc, unsigned width, unsigned height, std::span<char> text) noexcept {
  Text list(text);
  each_rate(*this, fourcc, width, height, [&](const v4l2_frmivalenum& rate) {
    if (rate.type != V4L2_FRMIVAL_TYPE_DISCRETE)
      list.add("%.4g to %.4g", rate_hz_of(rate.stepwise.max), rate_hz_of(rate.stepwise.min));
    else
      list.add("%s%.4g", list.is_empty() ? "" : ", ", rate_hz_of(rate.discrete));
  });
}

void V4l2Device::list_sizes(std::uint32_t fourcc, std::span<char> text) noexcept {
  Text list(text);
  const unsigned parts = is_mosaic(fourcc) ? 2 : 1;
  each_size(*this, fourcc, [&](const v4l2_frmsizeenum& size) {
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      const v4l2_frmsize_stepwise& range = size.stepwise;
      list.add("%ux%u to %ux%u", range.min_width / parts, range.min_height / parts, range.max_width / parts,
               range.max_height / parts);
      return;
    }
    list.add("%s%ux%u", list.is_empty() ? "" : ", ", size.discrete.width / parts, size.discrete.height / parts);
    char rates[96];
    list_rates(fourcc, size.discrete.width, size.discrete.height, rates);
    if (rates[0] != '\0') list.add(" (%s Hz)", rates);
  });
}

void V4l2Device::list_offers(std::span<char> text) noexcept {
  Text list(text);
  char not_read[64];
  Text others(not_read);
  each_format(*this, [&](const v4l2_fmtdesc& format) {
    char name[5];
    write_fourcc(format.pixelformat, name);
    if (!is_read(format.pixelformat)) {
      others.add("%s%s", others.is_empty() ? "" : ", ", name);
      return;
    }
    char sizes[280];
    list_sizes(format.pixelformat, sizes);
    list.add("%s%s%s %s", list.is_empty() ? "" : "; ", name, is_mosaic(format.pixelformat) ? ", halved:" : "", sizes);
  });
  if (!others.is_empty()) list.add("%snot read: %s", list.is_empty() ? "" : "; ", not_read);
}

}  // namespace epiline
