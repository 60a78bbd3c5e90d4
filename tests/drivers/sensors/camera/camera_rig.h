#pragma once
// A V4l2Camera on a made-up device, and its reader.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/sensors/camera/v4l2_camera.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/fake_camera.h"

namespace epiline::test {

struct CameraRig {
  CameraRig() {
    settings.device = "/dev/video0";
    settings.width = 320;
    settings.height = 180;
    settings.rate_hz = 30;
    settings.formats = {PixelFormat::kGrey};
    plug_in();
  }
  /// Whatever happened to it, a closed camera leaves nothing behind, and reading needs no heap.
  ~CameraRig() {
    camera.reset();
    EXPECT_EQ(kernel.open_files(), 0u);
    EXPECT_EQ(kernel.mappings, 0);
    EXPECT_EQ(heap_calls, 0u);
  }
  std::string error() {
    make();
    const Status status = camera->open();
    return status ? "opened" : status.error().text();
  }
  /// And reads for so many seconds.
  void open(double seconds = 0) {
    make();
    const Status status = camera->open();
    ASSERT_TRUE(status) << status.error().text();
    run(seconds);
  }
  void make() { camera.emplace(settings, kernel); }
  void plug_in(const std::string& path = "/dev/video0") {
    device->is_gone = false;
    kernel.devices[path] = device;
  }
  /// Reading an image in the driver's memory, and in ours.
  void reading_takes(Span in_place, Span ordinary) {
    kernel.read_time_of = [=, this](const void* memory) { return device->owns(memory) ? in_place : ordinary; };
  }
  void unplug(const std::string& path = "/dev/video0") {
    device->is_gone = true;
    kernel.devices.erase(path);
  }

  /// Reads and gives back at once, for so long; how many images came. The heap of a read is watched.
  std::size_t run(
      double seconds, const std::function<void(const Frame&)>& each = [](const Frame&) {}) {
    std::size_t count = 0;
    const std::int64_t end_ns = kernel.clock_ns + static_cast<std::int64_t>(1e9 * seconds);
    while (kernel.clock_ns < end_ns) {
      Frame frame;
      const std::uint64_t kernels = kernel.heap_calls;
      const HeapCallScope heap;
      const ReadOutcome outcome = camera->read(frame, Span{std::min(end_ns - kernel.clock_ns, 100 * kMs)});
      heap_calls += heap.calls() - (kernel.heap_calls - kernels);
      if (outcome == ReadOutcome::kFailed) ++failures;
      if (outcome != ReadOutcome::kSample) continue;
      if (count++ == 0) first = frame;
      last = frame;
      each(frame);
      camera->give_back(frame);
    }
    return count;
  }

  FakeKernel kernel;
  std::shared_ptr<FakeCamera> device = std::make_shared<FakeCamera>(kernel);
  V4l2Settings settings;
  std::optional<V4l2Camera> camera;
  Frame first, last;
  std::size_t failures = 0;
  std::uint64_t heap_calls = 0;
};

}  // namespace epiline::test
