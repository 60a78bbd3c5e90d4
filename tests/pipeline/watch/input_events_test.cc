#include "pipeline/watch/input_events.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "platform/memory/allocation_count.h"
#include "tests/pipeline/stages/stage_support.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

using test::Lines;
using test::told_by;

/// Readings at 200 Hz, no two alike, for `ms`.
class ImuStream {
 public:
  template <class Change>
  void flow(int ms, Change change) {
    for (int end = at_ms_ + ms; at_ms_ < end; at_ms_ += 5) {
      ImuSample r;
      r.stamp = r.arrival = HostStamp{kStart_ns + at_ms_ * kMs};
      for (std::size_t i = 0; i < 3; ++i) {
        r.angular_velocity_rad_s[i] = 0.1 * std::sin(0.37 * at_ms_ + static_cast<double>(i));
        r.specific_force_m_s2[i] = 9 * std::cos(0.29 * at_ms_ + static_cast<double>(i));
      }
      change(r);
      const HeapCallScope heap;
      const bool taken = gate_.step(r);
      events_.after(taken, r, gate_);
      EXPECT_EQ(heap.calls(), 0);
    }
  }
  void flow(int ms) {
    flow(ms, [](ImuSample&) {});
  }
  Lines told() { return told_by(*ring_); }

 private:
  std::unique_ptr<EventRing> ring_ = std::make_unique<EventRing>();
  ImuGate gate_{{100, 100}};
  ImuEvents events_{*ring_};
  int at_ms_ = 0;
};

TEST(ImuEvents, OfGoodReadingsThereIsNothingToTell) {
  ImuStream imu;
  imu.flow(5000);
  EXPECT_EQ(imu.told(), Lines{});
}

TEST(ImuEvents, AVibrationThatReachesTheLimitIsOneEpisode) {
  ImuStream imu;
  imu.flow(1000);
  int count = 0;
  imu.flow(400, [&](ImuSample& r) {
    if (count++ % 2 == 0) r.specific_force_m_s2[2] = 150;
  });
  EXPECT_EQ(imu.told(), Lines{"1000 imu_saturated on=1 readings=1"});
  imu.flow(1000);
  EXPECT_EQ(imu.told(), Lines{"1890 imu_saturated on=0 readings=40"}) << "half a second after 1390, the last one";
  imu.flow(5, [](ImuSample& r) { r.angular_velocity_rad_s[0] = -100; });
  EXPECT_EQ(imu.told(), Lines{"2400 imu_saturated on=1 readings=1"});
}

TEST(ImuEvents, AStepOfTheClockIsToldWithItsCorrectionThereAndBack) {
  ImuStream imu;
  imu.flow(1000);
  imu.flow(1000, [](ImuSample& r) { r.stamp = r.stamp + Span{70 * kMs}; });
  EXPECT_EQ(imu.told(), (Lines{"995 imu_refused on=1 readings=1 reason=other_time",
                               "1005 clock_jump source=imu correction_ns=-70000000",
                               "1495 imu_refused on=0 readings=1 reason=other_time"}));
  imu.flow(400);
  EXPECT_EQ(imu.told(), (Lines{"1995 imu_refused on=1 readings=1 reason=other_time",
                               "2005 clock_jump source=imu correction_ns=0"}));
}

TEST(ImuEvents, ReadingsInBurstsAreToldOnce) {
  ImuStream imu;
  int i = 0;
  imu.flow(5000, [&](ImuSample& r) { r.stamp = r.stamp + Span{(3 - i++ % 4) * 4 * kMs}; });
  EXPECT_EQ(imu.told(), Lines{"315 imu_in_bursts readings=4"});
}

TEST(ImuEvents, EachReasonOfRefusalIsAnEpisodeAtTheTimeOfTheReadingBefore) {
  ImuStream imu;
  imu.flow(1000);
  imu.flow(50, [](ImuSample& r) { r.specific_force_m_s2[0] = std::numeric_limits<double>::quiet_NaN(); });
  imu.flow(5, [](ImuSample& r) { r.stamp = HostStamp{kStart_ns + 995 * kMs}; });
  imu.flow(50);
  imu.flow(5, [](ImuSample& r) { r.stamp = HostStamp{kStart_ns + 1100 * kMs}; });
  EXPECT_EQ(imu.told(), (Lines{"995 imu_refused on=1 readings=1 reason=not_finite",
                               "995 imu_refused on=1 readings=1 reason=other_time",
                               "1100 imu_refused on=1 readings=1 reason=duplicate"}));
  imu.flow(1000);
  EXPECT_EQ(imu.told(), (Lines{"1495 imu_refused on=0 readings=10 reason=not_finite",
                               "1495 imu_refused on=0 readings=1 reason=other_time",
                               "1600 imu_refused on=0 readings=1 reason=duplicate"}));
}

/// Images at 20 Hz: a texture that moves, or the same, or none.
class ImageStream {
 public:
  enum class Shows : std::uint8_t { kWorld, kSame, kNothing };
  void flow(int ms, Shows shows, Span clock = {}) {
    for (int end = at_ms_ + ms; at_ms_ < end; at_ms_ += 50) {
      if (shows != Shows::kSame) ++picture_;
      for (std::size_t i = 0; i < pixels_.size(); ++i)
        pixels_[i] = shows == Shows::kNothing ? 3 : static_cast<std::uint8_t>((i * 7919 + picture_ * 131) % 211);
      Frame f;
      f.arrival = HostStamp{kStart_ns + at_ms_ * kMs};
      f.stamp = f.arrival + clock;
      f.sequence = sequence_++;
      f.data = pixels_.data();
      f.width = f.stride = kWidth;
      f.height = kHeight;
      const bool taken = gate_.step(f);
      events_.after(taken, f, gate_);
    }
  }
  Lines told() { return told_by(*ring_); }

 private:
  static constexpr int kWidth = 160, kHeight = 120;
  std::unique_ptr<EventRing> ring_ = std::make_unique<EventRing>();
  ImageGate gate_;
  ImageEvents events_{*ring_};
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(kWidth * kHeight);
  std::size_t picture_ = 0;
  std::uint64_t sequence_ = 0;
  int at_ms_ = 0;
};
using Shows = ImageStream::Shows;

TEST(ImageEvents, FrozenAndCoveredBeginAndEnd) {
  ImageStream camera;
  camera.flow(2000, Shows::kWorld);
  EXPECT_EQ(camera.told(), Lines{});
  camera.flow(1000, Shows::kSame);
  EXPECT_EQ(camera.told(), (Lines{"1950 images_repeated on=1 images=1", "2150 images_frozen on=1 images=1",
                                  "2450 images_repeated on=0 images=3"}));
  camera.flow(1000, Shows::kNothing);
  EXPECT_EQ(camera.told(), (Lines{"3000 lens_covered on=1 images=1", "3450 images_frozen on=0 images=17"}));
  camera.flow(1000, Shows::kWorld);
  EXPECT_EQ(camera.told(), Lines{"4450 lens_covered on=0 images=20"});
}

TEST(ImageEvents, AStepOfTheClockAndTheImageItCost) {
  ImageStream camera;
  camera.flow(2000, Shows::kWorld);
  camera.flow(1000, Shows::kWorld, {-300 * kMs});
  EXPECT_EQ(camera.told(), (Lines{"1950 image_dropped sequence=40 reason=refused images=1",
                                  "2050 clock_jump source=camera correction_ns=300000000"}));
}

}  // namespace
}  // namespace epiline
