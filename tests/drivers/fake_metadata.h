#pragma once
// The metadata node of a FakeCamera: what a test gives it, image by image.
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "tests/drivers/fake_camera.h"

namespace epiline::test {

/// A payload header as the kernel hands it out: time of arrival, USB frame, then the camera's bytes.
inline std::vector<std::uint8_t> uvc_header(std::int64_t arrival_ns, std::uint32_t image_time, std::uint32_t clock) {
  std::vector<std::uint8_t> bytes;
  const auto put = [&bytes](std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  };
  put(static_cast<std::uint64_t>(arrival_ns), 8);
  put(1000, 2);
  put(12, 1);
  put(0x8c, 1);  // both times are there
  put(image_time, 4);
  put(clock, 4);
  put(1001, 2);
  return bytes;
}

class FakeMetadata final : public FakeFile {
 public:
  explicit FakeMetadata(FakeCamera& of) : camera(of) {}

  FakeCamera& camera;
  std::uint32_t format = V4L2_META_FMT_UVC;
  std::size_t given = 0;  ///< images whose metadata were handed out

  /// Of an image; nothing without a free buffer, as from the kernel.
  void give(std::uint32_t sequence, const std::vector<std::uint8_t>& bytes) {
    if (!is_streaming_ || queued_.empty()) return;
    const unsigned index = queued_.front();
    queued_.pop_front();
    std::copy_n(bytes.begin(), std::min(bytes.size(), kBytes), memory_[index]->begin());
    done_.push_back({index, sequence, static_cast<std::uint32_t>(std::min(bytes.size(), kBytes))});
  }

  std::uint64_t number() override { return camera.number() + 1; }
  int opened() override { return camera.is_gone ? ENODEV : 0; }
  void* map(std::size_t length, off_t offset) override {
    return length == kBytes ? memory_[static_cast<std::size_t>(offset)]->data() : MAP_FAILED;
  }
  int ioctl(unsigned long request, void* argument) override {
    if (camera.is_gone) return refuse(ENODEV);
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& c = *static_cast<v4l2_capability*>(argument);
        std::snprintf(reinterpret_cast<char*>(c.card), sizeof(c.card), "%s", camera.card.c_str());
        std::snprintf(reinterpret_cast<char*>(c.bus_info), sizeof(c.bus_info), "%s", camera.bus.c_str());
        c.capabilities = V4L2_CAP_DEVICE_CAPS;
        c.device_caps = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
      }
      case VIDIOC_S_FMT:
        if (camera.has_buffers()) return refuse(EBUSY);  // as uvcvideo does
        static_cast<v4l2_format*>(argument)->fmt.meta.dataformat = format;
        return 0;
      case VIDIOC_REQBUFS:
        for (unsigned i = 0; i < static_cast<v4l2_requestbuffers*>(argument)->count; ++i)
          memory_.push_back(std::make_shared<std::vector<std::uint8_t>>(kBytes));
        return 0;
      case VIDIOC_QUERYBUF:
        static_cast<v4l2_buffer*>(argument)->length = kBytes;
        static_cast<v4l2_buffer*>(argument)->m.offset = static_cast<v4l2_buffer*>(argument)->index;
        return 0;
      case VIDIOC_QBUF:
        return queued_.push_back(static_cast<v4l2_buffer*>(argument)->index), 0;
      case VIDIOC_DQBUF: {
        if (done_.empty()) return refuse(EAGAIN);
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.index = done_.front().index;
        buffer.sequence = done_.front().sequence;
        buffer.bytesused = done_.front().bytes;
        done_.pop_front();
        ++given;
        return 0;
      }
      case VIDIOC_STREAMON:
        return is_streaming_ = true, 0;
      case VIDIOC_STREAMOFF:
        is_streaming_ = false;
        queued_.clear();
        done_.clear();
        return 0;
      default:
        return refuse(ENOTTY);
    }
  }

 private:
  static constexpr std::size_t kBytes = 1024;
  struct Done {
    unsigned index = 0;
    std::uint32_t sequence = 0, bytes = 0;
  };
  std::vector<std::shared_ptr<std::vector<std::uint8_t>>> memory_;
  std::deque<unsigned> queued_;
  std::deque<Done> done_;
  bool is_streaming_ = false;
};

}  // namespace epiline::test
