// The camera against the kernel's test driver vivid: lost and damaged images, injected errors, a device that goes and
// comes back.
#include <atomic>
#include <cstdio>
#include <optional>
#include <thread>
#include <vector>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/vivid_support.h"

namespace epiline {
namespace {

TEST_F(Vivid, LostImagesAreGapsOfTheSequence) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"percentage_of_dropped_buffers", 40}};
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  std::optional<std::uint64_t> first, last;
  watch(camera, 40, [&](const Frame& frame) {
    if (!first) first = frame.sequence;
    if (last) {
      EXPECT_GT(frame.sequence, *last);
    }
    last = frame.sequence;
  });
  const CameraCounts counts = camera.counts();
  EXPECT_GT(counts.lost, 0u);
  EXPECT_EQ(*last - *first, 39 + counts.lost);
}

TEST_F(Vivid, AWrappingSequenceIsNoLoss) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"wrap_sequence_number", 1}};  // 128 images before it wraps
  settings.rate_hz = 60;
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  std::optional<std::uint64_t> first;
  std::uint64_t last = 0;
  watch(camera, 200, [&](const Frame& frame) {
    if (!first) first = frame.sequence;
    last = frame.sequence;
  });
  EXPECT_EQ(last - *first, 199u + camera.counts().lost);
  EXPECT_LT(camera.counts().lost, 1u << 20) << "a busy emulator loses some, not 2^32";
}

TEST_F(Vivid, AFatalErrorIsOvercomeWithoutHeapOrLocks) {
  V4l2Camera camera(small_settings());
  ASSERT_OPENS(camera);
  const int files = open_files();
  const auto mappings = device_mappings().size();
  std::uint64_t last = 0;
  for (int round = 1; round <= 3; ++round) {
    watch(camera, 3, [&](const Frame& frame) {
      EXPECT_GE(frame.sequence, last);
      last = frame.sequence;
    });
    set_controls(kDevice, {{"inject_fatal_streaming_error", 1}});
    Frame frame;
    int failures = 0;
    const std::int64_t begin_ns = monotonic_ns();
    const HeapCallScope heap;
    const std::uint64_t locks = lock_calls_of_this_thread();
    ASSERT_TRUE(read_within(camera, frame, kPatience, &failures));
    EXPECT_EQ(heap.calls(), 0u);
    EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
    std::printf("fatal error: image after %.0f ms\n", static_cast<double>(monotonic_ns() - begin_ns) * 1e-6);
    EXPECT_EQ(failures, 1) << "told once";
    EXPECT_GT(frame.sequence, last + 1) << "a gap: nobody knows how many were lost";
    camera.give_back(frame);
    EXPECT_EQ(camera.counts().disconnected, static_cast<std::uint64_t>(round));
    EXPECT_EQ(open_files(), files);
    EXPECT_EQ(device_mappings().size(), mappings);
  }
  EXPECT_EQ(camera.counts().last_error, EIO);
}

TEST_F(Vivid, LentImagesOutliveTheDevice) {
  V4l2Camera camera(small_settings());
  ASSERT_OPENS(camera);
  std::vector<Frame> lent(3);
  for (Frame& frame : lent) ASSERT_TRUE(read_within(camera, frame, kPatience));
  const auto before = pixels_of(lent[0]);
  const auto mappings = device_mappings().size();
  set_controls(kDevice, {{"inject_fatal_streaming_error", 1}});
  Frame frame;
  ASSERT_TRUE(read_within(camera, frame, kPatience));
  for (const Frame& old : lent) {
    EXPECT_TRUE(is_device_memory(old.data));
    EXPECT_NE(old.slot, frame.slot);
    EXPECT_EQ(pixels_of(old), before);
  }
  EXPECT_EQ(device_mappings().size(), mappings + 3);
  for (const Frame& old : lent) camera.give_back(old);
  camera.give_back(frame);
  watch(camera, 3, [](const Frame&) {});
  EXPECT_EQ(device_mappings().size(), mappings) << "given back, then unmapped";
}

TEST_F(Vivid, ADisconnectedDeviceComesBack) {
  V4l2Camera camera(small_settings());
  ASSERT_OPENS(camera);
  const int files = open_files();
  watch(camera, 3, [](const Frame&) {});
  {
    V4l2Device other;
    ASSERT_FALSE(other.open(kDevice, ""));
    V4l2Settings settings;
    settings.controls = {{"disconnect", 1}};  // until its last user has closed it
    EXPECT_TRUE(other.set_controls(settings)) << "it is gone before the control can be read back";
  }
  const std::int64_t begin_ns = monotonic_ns();
  Frame frame;
  int failures = 0;
  ASSERT_TRUE(read_within(camera, frame, kPatience, &failures));
  std::printf("disconnect: image after %.0f ms\n", static_cast<double>(monotonic_ns() - begin_ns) * 1e-6);
  EXPECT_GE(failures, 1);
  camera.give_back(frame);
  EXPECT_EQ(camera.counts().disconnected, 1u);
  EXPECT_EQ(open_files(), files);
}

TEST_F(Vivid, AnUnpluggedDeviceComesBackWhenPlugged) {
  V4l2Camera camera(small_settings());
  ASSERT_OPENS(camera);
  const int files = open_files();
  const auto mappings = device_mappings().size();
  watch(camera, 3, [](const Frame&) {});
  const std::int64_t begin_ns = monotonic_ns();
  std::atomic<std::int64_t> plugged_ns{0};
  std::thread hand([&] {
    write_file("/sys/bus/platform/drivers/vivid/unbind", "vivid.0");
    std::this_thread::sleep_for(std::chrono::milliseconds(2'500));
    write_file("/sys/bus/platform/drivers/vivid/bind", "vivid.0");
    plugged_ns = monotonic_ns();
  });
  Frame frame;
  int failures = 0;
  while (failures == 0) {  // what was on the way may still come
    const ReadOutcome outcome = camera.read(frame, Span::from_milliseconds(100));
    if (outcome == ReadOutcome::kSample) camera.give_back(frame);
    if (outcome == ReadOutcome::kFailed) ++failures;
  }
  EXPECT_FALSE(camera.is_streaming());
  EXPECT_TRUE(device_mappings().empty());
  const HeapCallScope heap;
  ASSERT_TRUE(read_within(camera, frame, kPatience, &failures));
  EXPECT_EQ(heap.calls(), 0u);
  hand.join();
  std::printf("plugged in: image after %.0f ms, %llu attempts before\n",
              static_cast<double>(monotonic_ns() - plugged_ns) * 1e-6,
              static_cast<unsigned long long>(camera.counts().retries));
  camera.give_back(frame);
  const auto away_s = static_cast<std::uint64_t>((monotonic_ns() - begin_ns) / kSecond.ns);
  EXPECT_GE(camera.counts().retries, 2u);
  EXPECT_LE(camera.counts().retries, 7 + away_s) << "waits longer and longer, a second in the end";
  EXPECT_EQ(open_files(), files);
  EXPECT_EQ(device_mappings().size(), mappings);
}

}  // namespace
}  // namespace epiline
