#include "drivers/flights/recordings/flight_plan.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline {
namespace {

constexpr std::int64_t kUs = 1000;

/// Two cameras with images at these times.
AslDataset pair_of(const std::vector<std::int64_t>& first_us, const std::vector<std::int64_t>& second_us) {
  AslDataset dataset;
  for (const std::int64_t us : first_us) dataset.images.push_back({HostStamp{us * kUs}, "", 0});
  dataset.others = {std::make_shared<AslDataset>()};
  for (const std::int64_t us : second_us) dataset.others[0]->images.push_back({HostStamp{us * kUs}, "", 0});
  return dataset;
}

std::vector<int> partners(const AslDataset& dataset, const FlightPart& part = {}) {
  std::vector<int> list;
  for (const PlannedImage& image : plan_flight(dataset, part).images)
    list.push_back(image.others[0] ? static_cast<int>(*image.others[0]) : -1);
  return list;
}

TEST(FlightPlan, PairsImagesOfOneTime) {
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {0, 50'000, 100'000})), (std::vector{0, 1, 2}));
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {100'900, 600, 49'100})), (std::vector{1, 2, 0})) << "in any order";
}

TEST(FlightPlan, AnImageWithoutAPartnerIsAlone) {
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {0, 100'000})), (std::vector{0, -1, 1}));
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {0, 51'100, 100'000})), (std::vector{0, 1, 2}))
      << "one of three is off by more than a millisecond: nothing triggers them together";
  EXPECT_EQ(partners(pair_of({0, 50'000}, {})), (std::vector{-1, -1}));
}

/// Nearly all of one time: those that are not belong to none.
TEST(FlightPlan, TriggeredCamerasHaveNoTimesOfTheirOwn) {
  std::vector<std::int64_t> first_us, second_us;
  for (int i = 0; i < 20; ++i) {
    first_us.push_back(50'000 * i);
    second_us.push_back(50'000 * i + (i == 7 ? 1'100 : 400));
  }
  const AslDataset dataset = pair_of(first_us, second_us);
  const FlightPlan plan = plan_flight(dataset, {});
  EXPECT_EQ(plan.apart[0], Span{});
  for (std::size_t i = 0; i < plan.images.size(); ++i) {
    EXPECT_EQ(plan.images[i].others[0].has_value(), i != 7) << i;
    EXPECT_EQ(plan.images[i].later[0], Span{});
  }
}

TEST(FlightPlan, FreeRunningCamerasGiveTheNearestImageWithItsTime) {
  AslDataset dataset = pair_of({0, 50'000, 100'000, 150'000, 200'000}, {-13'000, 37'000, 87'000, 137'000, 187'000});
  FlightPlan plan = plan_flight(dataset, {});
  EXPECT_EQ(partners(dataset), (std::vector{0, 1, 2, 3, 4}));
  EXPECT_EQ(plan.apart[0], Span::from_milliseconds(13));
  EXPECT_EQ(plan.images[3].later[0], Span::from_milliseconds(-13));
  dataset.others[0]->camera.time_offset_s = 0.002;  // its stamps are early
  plan = plan_flight(dataset, {});
  EXPECT_EQ(plan.images[3].later[0], Span::from_milliseconds(-11));
  // slower than the first one, and each image of it belongs to one of the first
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000, 150'000, 200'000}, {20'000, 125'000, 230'000})),
            (std::vector{0, -1, 1, -1, -1}));
}

TEST(FlightPlan, TakesTheNearestOfSeveral) {
  EXPECT_EQ(partners(pair_of({50'000}, {49'200, 49'900, 50'300})), (std::vector{1}));
}

// A simulated time offset moves the images of both cameras.
TEST(FlightPlan, PairsBeforeTheShift) {
  FlightPart part;
  part.shift_images_ms = 30;
  EXPECT_EQ(partners(pair_of({0, 50'000}, {0, 50'000}), part), (std::vector{0, 1}));
}

}  // namespace
}  // namespace epiline
