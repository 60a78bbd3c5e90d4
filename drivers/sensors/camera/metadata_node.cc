#include "drivers/sensors/camera/metadata_node.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "drivers/sensors/camera/uvc_clock.h"
#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

constexpr std::uint32_t kMetadata = V4L2_BUF_TYPE_META_CAPTURE;
constexpr int kMostNodes = 64;

/// -1: none.
ssize_t read_file(SystemCalls& system, const char* path, std::span<std::uint8_t> into) noexcept {
  const int fd = system.open(path, O_RDONLY);
  if (fd < 0) return -1;
  const ssize_t size = system.read(fd, into.data(), into.size());
  system.close(fd);
  return size;
}

}  // namespace

/// Nodes of a camera are numbered in a row: the next one of metadata after the video node. A device of two cameras has
/// two of each.
bool MetadataNode::find(const V4l2Device& camera) noexcept {
  const std::uint64_t video = system_.device_number(camera.fd());
  std::uint64_t nearest = std::numeric_limits<std::uint64_t>::max();
  for (int i = 0; i < kMostNodes; ++i) {
    char path[32];
    std::snprintf(path, sizeof(path), "/dev/video%d", i);
    const int fd = system_.open(path, O_RDWR);
    if (fd < 0) continue;
    v4l2_capability capability{};
    const std::uint64_t number = system_.device_number(fd);
    const bool is_one =
        call_device(system_, fd, VIDIOC_QUERYCAP, &capability) == 0 &&
        (capability.device_caps & V4L2_CAP_META_CAPTURE) != 0 && number > video && number < nearest &&
        std::strcmp(reinterpret_cast<const char*>(capability.card), camera.identity().card.data()) == 0 &&
        std::strcmp(reinterpret_cast<const char*>(capability.bus_info), camera.identity().bus.data()) == 0;
    if (!is_one) {
      system_.close(fd);
      continue;
    }
    if (fd_ >= 0) system_.close(fd_);
    fd_ = fd;
    nearest = number;
  }
  return fd_ >= 0;
}

DeviceTrouble MetadataNode::open(const V4l2Device& camera) noexcept {
  close();
  const DeviceTrouble trouble = find(camera)
                                    ? begin()
                                    : unexpected("camera.clock", "camera.clock = \"driver\"",
                                                 "the camera has no node of metadata, so its own clock is not known");
  if (trouble) close();
  return trouble;
}

DeviceTrouble MetadataNode::begin() noexcept {
  v4l2_format format{};
  format.type = kMetadata;
  format.fmt.meta.dataformat = V4L2_META_FMT_UVC;
  if (const int error = call(VIDIOC_S_FMT, &format); error != 0) return refused("VIDIOC_S_FMT of metadata", error);
  if (format.fmt.meta.dataformat != V4L2_META_FMT_UVC)
    return unexpected("VIDIOC_S_FMT of metadata", "camera.clock = \"driver\"",
                      "the camera's metadata are not those of USB video");
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = kMetadata;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int error = call(VIDIOC_REQBUFS, &request); error != 0) return refused("VIDIOC_REQBUFS of metadata", error);
  for (unsigned i = 0; i < std::min(request.count, kBuffers); ++i)
    if (const DeviceTrouble trouble = map(i)) return trouble;
  int type = static_cast<int>(kMetadata);
  return refused("VIDIOC_STREAMON of metadata", call(VIDIOC_STREAMON, &type));
}

DeviceTrouble MetadataNode::map(unsigned index) noexcept {
  v4l2_buffer buffer = mapped_buffer(kMetadata, index);
  if (const int error = call(VIDIOC_QUERYBUF, &buffer); error != 0)
    return refused("VIDIOC_QUERYBUF of metadata", error);
  void* const memory = system_.map(fd_, buffer.length, buffer.m.offset);
  if (memory == MAP_FAILED) return refused("mmap of metadata", errno);
  buffers_[index] = {static_cast<std::uint8_t*>(memory), buffer.length};
  count_ = index + 1;
  return refused("VIDIOC_QBUF of metadata", queue(index));
}

int MetadataNode::queue(unsigned index) noexcept {
  v4l2_buffer buffer = mapped_buffer(kMetadata, index);
  return call(VIDIOC_QBUF, &buffer);
}

void MetadataNode::close() noexcept {
  if (fd_ < 0) return;
  int type = static_cast<int>(kMetadata);
  call(VIDIOC_STREAMOFF, &type);
  for (unsigned i = 0; i < count_; ++i) system_.unmap(buffers_[i].data, buffers_[i].length);
  buffers_ = {};
  count_ = 0;
  held_ = -1;
  system_.close(fd_);
  fd_ = -1;
}

bool MetadataNode::read(std::uint32_t& sequence, std::span<const std::uint8_t>& metadata) noexcept {
  if (fd_ < 0) return false;
  if (held_ >= 0) queue(static_cast<unsigned>(held_));  // refused: the camera is lost, as its images will show
  held_ = -1;
  v4l2_buffer buffer = mapped_buffer(kMetadata, 0);
  if (call(VIDIOC_DQBUF, &buffer) != 0 || buffer.index >= count_) return false;
  held_ = static_cast<int>(buffer.index);
  sequence = buffer.sequence;
  const Memory& memory = buffers_[buffer.index];
  metadata = {memory.data, std::min<std::size_t>(buffer.bytesused, memory.length)};
  return true;
}

std::uint32_t clock_hz_of(SystemCalls& system, const V4l2Device& camera) noexcept {
  const std::uint64_t number = system.device_number(camera.fd());
  char path[96];
  const auto in_sysfs = [&](const char* file) {
    std::snprintf(path, sizeof(path), "/sys/dev/char/%u:%u/device/%s", major(number), minor(number), file);
    return path;
  };
  std::array<std::uint8_t, 8> text{};  // two digits, hexadecimal
  if (read_file(system, in_sysfs("bInterfaceNumber"), {text.data(), text.size() - 1}) <= 0) return 0;
  const long function = std::strtol(reinterpret_cast<const char*>(text.data()), nullptr, 16);
  std::array<std::uint8_t, 4096> descriptors{};
  const ssize_t size = read_file(system, in_sysfs("../descriptors"), descriptors);
  if (size <= 0) return 0;
  return clock_hz_of({descriptors.data(), static_cast<std::size_t>(size)}, static_cast<int>(function));
}

}  // namespace epiline
