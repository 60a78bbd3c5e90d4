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
  dataset.second = std::make_shared<AslDataset>();
  for (const std::int64_t us : second_us) dataset.second->images.push_back({HostStamp{us * kUs}, "", 0});
  return dataset;
}

std::vector<int> partners(const AslDataset& dataset, const FlightPart& part = {}) {
  std::vector<int> list;
  for (const PlannedImage& image : plan_flight(dataset, part).images)
    list.push_back(image.second ? static_cast<int>(*image.second) : -1);
  return list;
}

TEST(FlightPlan, PairsImagesOfOneTime) {
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {0, 50'000, 100'000})), (std::vector{0, 1, 2}));
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {100'900, 600, 49'100})), (std::vector{1, 2, 0})) << "in any order";
}

TEST(FlightPlan, AnImageWithoutAPartnerIsAlone) {
  EXPECT_EQ(partners(pair_of({0, 50'000, 100'000}, {0, 100'000})), (std::vector{0, -1, 1}));
  EXPECT_EQ(partners(pair_of({0, 50'000}, {1'100, 48'900})), (std::vector{-1, -1})) << "more than a millisecond";
  EXPECT_EQ(partners(pair_of({0, 50'000}, {})), (std::vector{-1, -1}));
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
