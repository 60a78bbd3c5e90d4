#pragma once
// A V4L2 camera on a FakeKernel: formats, controls, buffers, images at a steady rate, and what goes wrong.
#include <linux/dma-buf.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/drivers/fake_kernel.h"

namespace epiline::test {

/// A buffer of a camera as a file: counts the announcements of reading. `refusals`: what each announcement meets first.
class FakeDmaBuffer final : public FakeFile {
 public:
  FakeDmaBuffer(int& begun, const std::vector<int>& refusals) : begun_(begun), refusals_(refusals) {}
  int ioctl(unsigned long request, void* argument) override {
    if (request != DMA_BUF_IOCTL_SYNC) return refuse(ENOTTY);
    if (refused_ < refusals_.size()) return refuse(refusals_[refused_++]);
    refused_ = 0;
    const bool begins = (static_cast<dma_buf_sync*>(argument)->flags & DMA_BUF_SYNC_END) == 0;
    if (begins == is_read_) return refuse(EINVAL);
    is_read_ = begins;
    begun_ += begins ? 1 : 0;
    return 0;
  }

 private:
  int& begun_;
  const std::vector<int>& refusals_;
  std::size_t refused_ = 0;
  bool is_read_ = false;
};

class FakeCamera final : public FakeFile {
 public:
  struct Size {
    unsigned width = 0, height = 0;
    std::vector<unsigned> rates_hz;
  };
  struct Format {
    std::uint32_t fourcc = 0;
    std::vector<Size> sizes;
  };
  struct Control {
    std::uint32_t id = 0;
    std::string name;
    std::int64_t value = 0, most = 255;
  };
  struct Image {
    std::uint32_t sequence = 0;
    std::int64_t stamp_ns = 0;
    std::uint32_t flags = 0;
    std::uint32_t missing_bytes = 0;
  };

  explicit FakeCamera(FakeKernel& in) : kernel(in) {}

  FakeKernel& kernel;
  std::string card = "Made-up Cam", bus = "usb-0000:00:14.0-1", driver = "uvcvideo", serial;
  std::vector<Format> formats{{V4L2_PIX_FMT_GREY, {{320, 180, {30, 60}}, {640, 480, {30}}}}};
  std::vector<Control> controls{{1, "Brightness", 128}, {2, "Exposure Time, Absolute", 40}};
  std::uint32_t stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::function<void(Image&)> change_image;  ///< before it is handed out
  std::int64_t control_ns = 0;               ///< that a transfer to the camera takes
  bool is_gone = false;                      ///< unplugged
  bool gives_images = true;
  bool keeps_image = false;  ///< as v4l2loopback: one of before comes first, with the time of VIDIOC_REQBUFS
  int dequeue_error = 0, queue_error = 0;  ///< of the next call
  bool is_broken = false;                  ///< poll() reports an error, no call does; until the stream is stopped
  unsigned long refused_request = 0;       ///< always refused, with EINVAL
  std::vector<unsigned long> asked;        ///< in the order of the calls
  bool takes_any_size = false;             ///< a board's receiver, which the sensor before it tells what comes
  bool has_rate = true;                    ///< VIDIOC_G_PARM is there
  bool exports = true;                     ///< VIDIOC_EXPBUF is there
  int readings = 0;                        ///< of buffers, announced by DMA_BUF_IOCTL_SYNC
  std::vector<int> sync_refusals;          ///< errno of the first attempts at each announcement
  std::vector<std::uint8_t> jpeg;          ///< of each image of MJPEG

  /// Of one of its buffers.
  bool owns(const void* memory) const {
    return std::any_of(ever_.begin(), ever_.end(), [&](const auto& buffer) { return buffer->data() == memory; });
  }
  bool has_buffers() const { return !memory_.empty(); }
  std::int64_t period_ns() const { return kSecond_ns / rate_hz_; }
  Control& control(const std::string& name) {
    return *std::find_if(controls.begin(), controls.end(), [&](const Control& c) { return c.name == name; });
  }

  std::uint64_t device_number = 0x5100;  // 81:0
  std::uint64_t number() override { return device_number; }
  int opened() override { return is_gone ? ENODEV : 0; }
  short ready(std::int64_t now_ns) override {
    if (is_gone) return POLLERR | POLLHUP;
    if (!is_streaming_ || is_broken) return POLLERR;
    take_images(now_ns);
    return dequeue_error != 0 || !done_.empty() ? POLLIN : 0;
  }
  std::int64_t next_ns(std::int64_t /*now_ns*/) override {
    return is_streaming_ && gives_images ? next_image_ns_ : kNever_ns;
  }
  void* map(std::size_t length, off_t offset) override {
    return length == image_bytes() ? memory_[static_cast<std::size_t>(offset)]->data() : MAP_FAILED;
  }

  int ioctl(unsigned long request, void* argument) override {
    asked.push_back(request);
    if (is_gone) return refuse(ENODEV);
    if (request == refused_request) return refuse(EINVAL);
    switch (request) {
      case VIDIOC_QUERYCAP:
        return describe(*static_cast<v4l2_capability*>(argument));
      case VIDIOC_ENUM_FMT:
        return name_format(*static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return name_size(*static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return name_rate(*static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_G_FMT:
        return write_format(static_cast<v4l2_format*>(argument)->fmt.pix), 0;
      case VIDIOC_S_FMT:
        return set_format(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        return has_rate ? rate(request == VIDIOC_S_PARM, static_cast<v4l2_streamparm*>(argument)->parm.capture)
                        : refuse(ENOTTY);
      case VIDIOC_QUERY_EXT_CTRL:
        return describe(*static_cast<v4l2_query_ext_ctrl*>(argument));
      case VIDIOC_G_EXT_CTRLS:
      case VIDIOC_S_EXT_CTRLS:
        return transfer(request == VIDIOC_S_EXT_CTRLS, *static_cast<v4l2_ext_controls*>(argument));
      case VIDIOC_REQBUFS:
        return give_buffers(*static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF:
        return describe(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_EXPBUF:
        if (!exports) return refuse(ENOTTY);
        static_cast<v4l2_exportbuffer*>(argument)->fd =
            kernel.give(std::make_shared<FakeDmaBuffer>(readings, sync_refusals));
        return 0;
      case VIDIOC_QBUF:
        if (queue_error != 0) return refuse(std::exchange(queue_error, 0));
        take_images(kernel.clock_ns);  // those of before did not have this one
        return queued_.push_back(static_cast<v4l2_buffer*>(argument)->index), 0;
      case VIDIOC_DQBUF:
        return dequeue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        is_streaming_ = true;
        sequence_ = 0;
        next_image_ns_ = kernel.clock_ns + period_ns();
        if (keeps_image) hand_out({0, prepared_ns_, stamp_flags, 0});
        return 0;
      case VIDIOC_STREAMOFF:
        is_streaming_ = is_broken = false;
        queued_.clear();
        done_.clear();
        return 0;
      default:
        return refuse(ENOTTY);
    }
  }

 private:
  struct Done {
    unsigned index = 0;
    Image image;
  };

  std::size_t image_bytes() const { return std::size_t{width_} * height_ * (fourcc_ == V4L2_PIX_FMT_YUYV ? 2 : 1); }
  template <class Text>
  static void write_text(Text& text, const std::string& from) {
    std::snprintf(reinterpret_cast<char*>(text), sizeof text, "%s", from.c_str());
  }

  int describe(v4l2_capability& c) const {
    write_text(c.card, card);
    write_text(c.bus_info, bus);
    write_text(c.driver, driver);
    c.capabilities = V4L2_CAP_DEVICE_CAPS;
    c.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    return 0;
  }

  // ---- formats ----

  const Format* format_of(std::uint32_t fourcc) const {
    for (const Format& f : formats)
      if (f.fourcc == fourcc) return &f;
    return nullptr;
  }
  int name_format(v4l2_fmtdesc& asked_for) const {
    if (asked_for.index >= formats.size()) return refuse(EINVAL);
    asked_for.pixelformat = formats[asked_for.index].fourcc;
    return 0;
  }
  int name_size(v4l2_frmsizeenum& asked_for) const {
    const Format* const format = format_of(asked_for.pixel_format);
    if (format == nullptr || asked_for.index >= (takes_any_size ? 1 : format->sizes.size())) return refuse(EINVAL);
    if (takes_any_size) {
      asked_for.type = V4L2_FRMSIZE_TYPE_STEPWISE;
      asked_for.stepwise = {16, 16384, 2, 16, 16384, 1};
      return 0;
    }
    asked_for.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    asked_for.discrete = {format->sizes[asked_for.index].width, format->sizes[asked_for.index].height};
    return 0;
  }
  int name_rate(v4l2_frmivalenum& asked_for) const {
    const Format* const format = format_of(asked_for.pixel_format);
    for (std::size_t i = 0; !takes_any_size && format != nullptr && i < format->sizes.size(); ++i) {
      const Size& size = format->sizes[i];
      if (size.width != asked_for.width || size.height != asked_for.height) continue;
      if (asked_for.index >= size.rates_hz.size()) break;
      asked_for.type = V4L2_FRMIVAL_TYPE_DISCRETE;
      asked_for.discrete = {1, size.rates_hz[asked_for.index]};
      return 0;
    }
    return refuse(EINVAL);
  }
  /// As drivers do: the nearest that there is.
  int set_format(v4l2_pix_format& pix) {
    const Format* format = format_of(pix.pixelformat);
    if (format == nullptr) format = &formats[0];
    const auto off = [&](const Size& s) {
      return std::abs(static_cast<int>(s.width) - static_cast<int>(pix.width)) +
             std::abs(static_cast<int>(s.height) - static_cast<int>(pix.height));
    };
    const Size& size = *std::min_element(format->sizes.begin(), format->sizes.end(),
                                         [&](const Size& a, const Size& b) { return off(a) < off(b); });
    fourcc_ = format->fourcc;
    if (takes_any_size) {
      width_ = pix.width, height_ = pix.height;
      return write_format(pix), 0;
    }
    width_ = size.width;
    height_ = size.height;
    rates_hz_ = size.rates_hz;
    write_format(pix);
    return 0;
  }
  void write_format(v4l2_pix_format& pix) const {
    pix.pixelformat = fourcc_;
    pix.width = width_;
    pix.height = height_;
    pix.bytesperline = static_cast<std::uint32_t>(image_bytes() / height_);
    pix.sizeimage = static_cast<std::uint32_t>(image_bytes());
  }
  int rate(bool sets, v4l2_captureparm& parameters) {
    parameters.capability = V4L2_CAP_TIMEPERFRAME;
    if (sets) {
      const auto wanted = static_cast<int>(parameters.timeperframe.denominator / parameters.timeperframe.numerator);
      rate_hz_ = static_cast<int>(*std::min_element(rates_hz_.begin(), rates_hz_.end(), [&](unsigned a, unsigned b) {
        return std::abs(static_cast<int>(a) - wanted) < std::abs(static_cast<int>(b) - wanted);
      }));
    }
    parameters.timeperframe = {1, static_cast<std::uint32_t>(rate_hz_)};
    return 0;
  }

  // ---- controls ----

  int describe(v4l2_query_ext_ctrl& asked_for) const {
    const std::uint32_t after = asked_for.id & V4L2_CTRL_ID_MASK;
    const auto next = std::find_if(controls.begin(), controls.end(), [&](const Control& c) { return c.id > after; });
    if (next == controls.end()) return refuse(EINVAL);
    asked_for = {};
    asked_for.id = next->id;
    asked_for.type = V4L2_CTRL_TYPE_INTEGER;
    asked_for.maximum = next->most;
    write_text(asked_for.name, next->name);
    return 0;
  }
  int transfer(bool sets, v4l2_ext_controls& given) {
    if (!kernel.is_beside) kernel.clock_ns += control_ns;
    if (on_transfer) on_transfer();
    for (std::uint32_t i = 0; i < given.count; ++i) {
      const auto known = std::find_if(controls.begin(), controls.end(),
                                      [&](const Control& c) { return c.id == given.controls[i].id; });
      if (known == controls.end()) return refuse(EINVAL);
      if (sets) known->value = std::min<std::int64_t>(given.controls[i].value, known->most);
      given.controls[i].value = static_cast<std::int32_t>(known->value);
    }
    return 0;
  }

  // ---- buffers ----

  int give_buffers(v4l2_requestbuffers& request) {
    prepared_ns_ = kernel.clock_ns;
    memory_.clear();
    for (unsigned i = 0; i < request.count; ++i) {
      ever_.push_back(std::make_shared<std::vector<std::uint8_t>>(image_bytes(), std::uint8_t{77}));
      if (fourcc_ == V4L2_PIX_FMT_MJPEG) std::copy(jpeg.begin(), jpeg.end(), ever_.back()->begin());
      memory_.push_back(ever_.back());
    }
    return 0;
  }
  int describe(v4l2_buffer& buffer) const {
    if (buffer.index >= memory_.size()) return refuse(EINVAL);
    buffer.length = static_cast<std::uint32_t>(image_bytes());
    buffer.m.offset = buffer.index;
    buffer.flags = stamp_flags;
    return 0;
  }
  void take_images(std::int64_t now_ns) {
    for (; is_streaming_ && gives_images && next_image_ns_ <= now_ns; next_image_ns_ += period_ns()) {
      Image image{sequence_++, next_image_ns_, stamp_flags, 0};
      if (queued_.empty()) continue;  // nowhere to put it
      if (change_image) change_image(image);
      hand_out(image);
    }
  }
  void hand_out(const Image& image) {
    done_.push_back({queued_.front(), image});
    queued_.pop_front();
  }
  int dequeue(v4l2_buffer& buffer) {
    if (dequeue_error != 0) return refuse(std::exchange(dequeue_error, 0));
    take_images(kernel.clock_ns);
    if (!is_streaming_) return refuse(EINVAL);
    if (done_.empty()) return refuse(EAGAIN);
    const Done done = done_.front();
    done_.pop_front();
    buffer.index = done.index;
    const std::size_t whole = fourcc_ == V4L2_PIX_FMT_MJPEG ? jpeg.size() : image_bytes();
    buffer.bytesused = static_cast<std::uint32_t>(whole) - done.image.missing_bytes;
    buffer.sequence = done.image.sequence;
    buffer.flags = done.image.flags;
    buffer.timestamp = {done.image.stamp_ns / kSecond_ns, done.image.stamp_ns % kSecond_ns / 1000};
    return 0;
  }

 public:
  std::function<void()> on_transfer;  ///< a control is read or written

 private:
  std::uint32_t fourcc_ = V4L2_PIX_FMT_GREY;
  unsigned width_ = 320, height_ = 180;
  std::vector<unsigned> rates_hz_{30, 60};
  int rate_hz_ = 30;
  std::vector<std::shared_ptr<std::vector<std::uint8_t>>> memory_;
  std::deque<std::shared_ptr<std::vector<std::uint8_t>>> ever_;  ///< mappings outlive the stream
  std::deque<unsigned> queued_;
  std::deque<Done> done_;
  bool is_streaming_ = false;
  std::uint32_t sequence_ = 0;
  std::int64_t next_image_ns_ = 0, prepared_ns_ = 0;
};

}  // namespace epiline::test
