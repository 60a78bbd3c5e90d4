// With a thread of its own, against a camera that answers when the test lets it.
#include "drivers/sensors/camera/control_transfers.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <thread>

namespace epiline {
namespace {

/// One control, number 7 of a file that this process does not have.
class HeldCamera final : public SystemCalls {
 public:
  static constexpr int kFile = 1'000'000;
  std::atomic<bool> answers{true};
  std::atomic<int> open_files{0};

  int duplicate(int /*fd*/) noexcept override {
    open_files.fetch_add(1);
    return kFile;
  }
  int close(int /*fd*/) noexcept override {
    open_files.fetch_sub(1);
    return 0;
  }
  int ioctl(int fd, unsigned long request, void* argument) noexcept override {
    while (!answers.load()) std::this_thread::yield();
    EXPECT_EQ(fd, kFile);
    if (request == VIDIOC_QUERY_EXT_CTRL) {
      auto& query = *static_cast<v4l2_query_ext_ctrl*>(argument);
      if ((query.id & V4L2_CTRL_ID_MASK) >= 7) return errno = EINVAL, -1;
      query = {};
      query.id = 7;
      query.type = V4L2_CTRL_TYPE_INTEGER;
      std::snprintf(query.name, sizeof(query.name), "Brightness");
      return 0;
    }
    v4l2_ext_control& control = *static_cast<v4l2_ext_controls*>(argument)->controls;
    if (request == VIDIOC_S_EXT_CTRLS) value_ = control.value;
    control.value = value_;
    return 0;
  }

 private:
  int value_ = 0;
};

ControlJob job_of(const char* name, std::int64_t wanted) {
  ControlJob job;
  std::snprintf(job.entries[0].name.data(), job.entries[0].name.size(), "%s", name);
  job.entries[0].wanted = wanted;
  job.count = 1;
  return job;
}

struct Rig {
  Rig() { controls.add_file(3); }
  ControlJob finish() {
    ControlJob job;
    while (!transfers.take(job)) std::this_thread::yield();
    return job;
  }

  HeldCamera camera;
  V4l2Controls controls{camera};
  ControlTransfers transfers{camera};
};

TEST(ControlTransfers, ACameraThatDoesNotAnswerHoldsNobody) {
  Rig rig;
  ASSERT_TRUE(rig.transfers.start());
  rig.camera.answers = false;
  ASSERT_TRUE(rig.transfers.begin(rig.controls, job_of("brightness", 5)));
  ControlJob job;
  EXPECT_FALSE(rig.transfers.take(job));
  EXPECT_FALSE(rig.transfers.begin(rig.controls, job_of("brightness", 6))) << "one at a time";
  rig.camera.answers = true;
  job = rig.finish();
  EXPECT_TRUE(job.is_set);
  EXPECT_EQ(job.entries[0].value, 5);
  EXPECT_FALSE(rig.transfers.take(job)) << "told once";
  EXPECT_EQ(rig.camera.open_files, 0);
}

TEST(ControlTransfers, EachJobIsDoneOnceAndWhole) {
  Rig rig;
  ASSERT_TRUE(rig.transfers.start());
  for (int i = 1; i <= 500; ++i) {
    ASSERT_TRUE(rig.transfers.begin(rig.controls, job_of(i % 7 == 0 ? "contrast" : "brightness", i)));
    const ControlJob job = rig.finish();
    ASSERT_EQ(job.is_set, i % 7 != 0) << "a camera without the control";
    if (job.is_set) {
      ASSERT_EQ(job.entries[0].value, i);
    }
    ASSERT_EQ(job.entries[0].wanted, i);
  }
  EXPECT_EQ(rig.camera.open_files, 0);
}

TEST(ControlTransfers, StoppedInTheMiddleLeavesNothingOpen) {
  for (int i = 0; i < 50; ++i) {
    Rig rig;
    ASSERT_TRUE(rig.transfers.start());
    ASSERT_TRUE(rig.transfers.begin(rig.controls, job_of("brightness", 1)));
    rig.transfers.stop();
    EXPECT_EQ(rig.camera.open_files, 0);
    EXPECT_FALSE(rig.transfers.begin(rig.controls, job_of("brightness", 1))) << "not started";
  }
}

}  // namespace
}  // namespace epiline
