// stats.json of made-up flights. What real flights write is looked at in tests/drivers/program.
#include "drivers/study/report/stats_json.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(StatsJson, NamesEachWrongNumberWithAWordAndASentence) {
  FlightRecord record;
  EXPECT_EQ(stats_json(record, std::nullopt, {})["numbers_wrong"], Json::array());
  Suspicions& suspicions = record.estimator.suspicions;
  suspicions[static_cast<std::size_t>(Suspect::kTimeOffset)] = {Severity::kGross, -0.048, {}};
  suspicions[static_cast<std::size_t>(Suspect::kGyroscopeNoise)] = {Severity::kNote, 40, {}};
  const Json numbers = stats_json(record, std::nullopt, {})["numbers_wrong"];
  ASSERT_EQ(numbers.size(), 2u);
  EXPECT_EQ(numbers[0]["what"], "time_offset");
  EXPECT_EQ(numbers[0]["severity"], "gross");
  EXPECT_EQ(numbers[0]["figure"], -0.048);
  EXPECT_NE(numbers[0]["text"].get<std::string>().find("late by 48 ms"), std::string::npos);
  EXPECT_EQ(numbers[1]["what"], "gyroscope_noise");
  EXPECT_EQ(numbers[1]["severity"], "corrected");
}

TEST(StatsJson, CountsTheHeightsOfSensorsThatSentAny) {
  FlightRecord record;
  EXPECT_EQ(stats_json(record, std::nullopt, {})["heights"], Json::object());
  record.estimator.height_samples[1] = 7;
  record.estimator.height_refused[1] = 1;
  record.estimator.height_frames[1] = 5;
  record.estimator.height_jumps[1] = 2;
  EXPECT_EQ(stats_json(record, std::nullopt, {})["heights"].dump(),
            R"({"range_finder":{"samples":7,"refused":1,"frames":5,"jumps":2}})");
}

}  // namespace
}  // namespace epiline
