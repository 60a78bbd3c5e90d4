#include "drivers/program/hil/loopback_writer.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>

namespace epiline {

namespace {

v4l2_buffer numbered(unsigned index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

}  // namespace

Status LoopbackWriter::fail(const std::string& device, const char* step) {
  const std::string why = std::generic_category().message(errno);
  close();
  return Error{ErrorKind::kUsage, device, 0, std::string(step) + ": " + why,
               "a device of v4l2loopback (modprobe v4l2loopback video_nr=42) that no other program writes to"};
}

/// Readers see this rate; a reader that is configured for another one refuses the device. False: errno.
bool LoopbackWriter::set_rate(double rate_hz) noexcept {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  parameters.parm.output.timeperframe = {1000, static_cast<std::uint32_t>(std::lround(rate_hz * 1000))};
  return ::ioctl(fd_, VIDIOC_S_PARM, &parameters) == 0;
}

Status LoopbackWriter::open(const std::string& device, int width, int height, double rate_hz) {
  close();
  width_ = width;
  height_ = height;
  fd_ = ::open(device.c_str(), O_RDWR | O_CLOEXEC);
  if (fd_ < 0) return fail(device, "cannot open it");
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  format.fmt.pix.width = static_cast<std::uint32_t>(width);
  format.fmt.pix.height = static_cast<std::uint32_t>(height);
  format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  format.fmt.pix.bytesperline = format.fmt.pix.width;
  format.fmt.pix.sizeimage = format.fmt.pix.width * format.fmt.pix.height;
  if (::ioctl(fd_, VIDIOC_S_FMT, &format) != 0) return fail(device, "VIDIOC_S_FMT");
  if (rate_hz > 0 && !set_rate(rate_hz)) return fail(device, "VIDIOC_S_PARM");
  stride_ = std::max<std::size_t>(format.fmt.pix.bytesperline, static_cast<std::size_t>(width));
  v4l2_requestbuffers request{};
  request.count = kMostBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  request.memory = V4L2_MEMORY_MMAP;
  if (::ioctl(fd_, VIDIOC_REQBUFS, &request) != 0) return fail(device, "VIDIOC_REQBUFS");
  const unsigned count = std::min(request.count, kMostBuffers);  // the driver has 2 unless told otherwise
  for (count_ = 0; count_ < count; ++count_) {
    v4l2_buffer buffer = numbered(count_);
    if (::ioctl(fd_, VIDIOC_QUERYBUF, &buffer) != 0) return fail(device, "VIDIOC_QUERYBUF");
    length_ = buffer.length;
    void* const memory = ::mmap(nullptr, length_, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, buffer.m.offset);
    if (memory == MAP_FAILED) return fail(device, "mmap");
    memory_[count_] = memory;
  }
  if (length_ < stride_ * static_cast<std::size_t>(height)) {
    errno = ENOMEM;
    return fail(device, "its buffers are smaller than an image");
  }
  int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  if (::ioctl(fd_, VIDIOC_STREAMON, &type) != 0) return fail(device, "VIDIOC_STREAMON");
  return Done{};
}

void LoopbackWriter::close() noexcept {
  for (unsigned i = 0; i < count_; ++i) ::munmap(memory_[i], length_);
  count_ = next_ = 0;
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

bool LoopbackWriter::write(const Frame& frame, const Frame& second) noexcept {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  if ((frame.width != width_ && 2 * frame.width != width_) || frame.height != height_) {
    errno = EINVAL;
    return false;
  }
  auto* const to = static_cast<std::uint8_t*>(memory_[next_]);
  const auto left = static_cast<std::size_t>(frame.width), right = static_cast<std::size_t>(width_ - frame.width);
  for (int y = 0; y < height_; ++y) {
    std::uint8_t* const row = to + static_cast<std::size_t>(y) * stride_;
    std::memcpy(row, frame.data + static_cast<std::ptrdiff_t>(y) * frame.stride, left);
    if (second.data != nullptr) {
      std::memcpy(row + left, second.data + static_cast<std::ptrdiff_t>(y) * second.stride, right);
    } else {
      std::memset(row + left, 0, right);
    }
  }
  v4l2_buffer buffer = numbered(next_);
  buffer.bytesused = static_cast<std::uint32_t>(stride_ * static_cast<std::size_t>(height_));
  buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_COPY;
  buffer.timestamp.tv_sec = frame.stamp.ns / kSecond_ns;
  buffer.timestamp.tv_usec = frame.stamp.ns % kSecond_ns / 1'000;
  if (::ioctl(fd_, VIDIOC_QBUF, &buffer) != 0 || ::ioctl(fd_, VIDIOC_DQBUF, &buffer) != 0) return false;
  if (buffer.index >= count_) {
    errno = EPROTO;
    return false;
  }
  next_ = buffer.index;
  return true;
}

}  // namespace epiline
