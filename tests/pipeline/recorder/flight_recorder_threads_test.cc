// The flight recorder with a made-up stream: what is on disk is checked with a plain reader of its own, not with the
// replay's.
#include "pipeline/recorder/flight_recorder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "platform/memory/allocation_count.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

constexpr int kPatience = 60'000;  // looks 2 ms apart: a busy machine gives the writer no processor for seconds

namespace fs = std::filesystem;

/// First column of a table, comments left out; rows of one time count once.
std::vector<std::int64_t> times(const fs::path& path) {
  std::ifstream in(path);
  std::vector<std::int64_t> found;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::int64_t t = std::stoll(line);
    if (found.empty() || found.back() != t) found.push_back(t);
  }
  return found;
}

std::string text_of(const fs::path& path) {
  std::ifstream in(path);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::string hex_of(const Frame& frame) {
  return std::string("image ") + std::to_string(static_cast<int>(frame.data[0])) + " " + std::to_string(frame.width);
}

class FlightRecorderTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("epiline_recorder_" + std::to_string(getpid()) + "_" +
                                              testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    config_.folder = folder_ / "records";
    config_.seconds = 4;
    run_.camera.parameters.width = 64;
    run_.camera.parameters.height = 48;
    run_.camera.parameters.intrinsics = {50, 50, 32, 24};
    run_.png = hex_of;
    run_.config_toml = "[estimator]\nkeyframes = 7\n";
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// One image, ten readings and as many speeds of the wheels, if there are any: 0.05 s.
  void fly(FlightRecorder& recorder, HealthState state = HealthState::kTracking) {
    for (int i = 0; i < 10; ++i) {
      recorder.imu({HostStamp{now_}, {0.1, 0.2, 0.3}, {0, 0, 9.81}});
      if (wheels_) recorder.wheel({HostStamp{now_}, 1.0 / 3, 0});
      now_ += kSecond / 200;
    }
    const HostStamp stamp{now_};
    FrameOutcome outcome;
    outcome.serial = serial_;
    outcome.stamp = outcome.odometry.stamp = stamp;
    outcome.result.has_pose = true;
    outcome.odometry.health.state = state;
    outcome.odometry.reset_counter = resets_;
    outcome.odometry.p_WB_m = {static_cast<double>(serial_), 0, 0};
    recorder.take(outcome);
    LoggedTracks tracks;
    tracks.serial = serial_;
    tracks.stamp = stamp;
    for (std::uint32_t i = 0; i < serial_ % 7; ++i)
      tracks.points.push_back({i, 0, 0.1F * static_cast<float>(i), 1e7F / 3});
    recorder.tracks(tracks);
    std::fill(pixels_.begin(), pixels_.end(), static_cast<std::uint8_t>(serial_));
    if (recorder.wants_images()) {
      Frame second;  // every third one is missing
      if (run_.others[0] && serial_ % 3 != 0) second = {stamp, serial_, second_pixels_.data(), 32, 40, 32, 0};
      recorder.image({stamp, serial_, pixels_.data(), 64, 48, 64, 0}, {second});
    }
    recorder.event({stamp, EventId::kReset, {static_cast<std::int64_t>(serial_), 0, 0}});
    ++serial_;
    recorder.pass(stamp);
  }
  void fly_seconds(FlightRecorder& recorder, double seconds, HealthState state = HealthState::kTracking) {
    for (int i = 0; i < static_cast<int>(20 * seconds); ++i) fly(recorder, state);
  }
  /// Until one more record is written or has failed, flying on for at most 5 s: the tape has no room for more while a
  /// writer without a processor holds the record.
  EventId wait_until_done(FlightRecorder& recorder) { return fly_until_done(recorder, 0); }
  EventId fly_until_done(FlightRecorder& recorder, int most = 100) {
    Event event;
    for (int i = 0; !recorder.events().pop(event); ++i) {
      if (i < most)
        fly(recorder);
      else
        recorder.pass(HostStamp{now_});
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return event.id;
  }
  std::vector<fs::path> records() const {
    std::vector<fs::path> found;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(config_.folder, none)) found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
  }
  std::size_t count() const {
    const auto all = records();
    return static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(), [](const fs::path& p) { return p.extension() != ".partial"; }));
  }

  /// All streams of the record are complete between its first and last sample, and cover the time asked for.
  void expect_whole(const fs::path& record, double seconds) const {
    const auto step = [](const std::vector<std::int64_t>& t, std::int64_t ns) {
      for (std::size_t i = 1; i < t.size(); ++i) ASSERT_EQ(t[i] - t[i - 1], ns) << i;
    };
    const auto imu = times(record / "mav0/imu0/data.csv"), tracks = times(record / "mav0/cam0/tracks.csv"),
               states = times(record / "states.csv");
    ASSERT_GT(imu.size(), 10u);
    step(imu, kSecond / 200);
    step(tracks, kSecond / 20);
    EXPECT_EQ(tracks, states);
    EXPECT_NEAR(1e-9 * static_cast<double>(imu.back() - imu.front()), seconds, 0.06);
    EXPECT_NEAR(1e-9 * static_cast<double>(tracks.back() - tracks.front()), seconds, 0.06);
    EXPECT_EQ(times(record / "mav0/wheel0/data.csv"), wheels_ ? imu : std::vector<std::int64_t>{});
    const std::string events = text_of(record / "events.txt");
    EXPECT_EQ(std::count(events.begin(), events.end(), '\n'), static_cast<std::ptrdiff_t>(tracks.size()));
    EXPECT_EQ(times(record / "trajectory.tum").size(),
              0u + (seconds > 1.1 ? static_cast<std::size_t>(seconds) + 1 : 1));
    EXPECT_EQ(text_of(record / "config.toml"), run_.config_toml);
    EXPECT_NE(text_of(record / "mav0/cam0/sensor.yaml").find("resolution: [64, 48]"), std::string::npos);
  }

  fs::path folder_;
  RecorderConfig config_;
  RecordedRun run_;
  std::int64_t now_ = 1000 * kSecond;
  std::uint64_t serial_ = 0;
  std::uint32_t resets_ = 0;
  bool wheels_ = false;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(64 * 48),
                            second_pixels_ = std::vector<std::uint8_t>(32 * 40, 9);
};

TEST_F(FlightRecorderTest, HoldsTheLastSecondsAndNoMore) {
  FlightRecorder recorder(config_, run_);
  const HeapCallScope heap;
  fly_seconds(recorder, 100);
  EXPECT_EQ(heap.calls(), 0);
  recorder.finish(true);
  ASSERT_EQ(recorder.report().written, (std::vector<std::string>{config_.folder + "/record-001-end"}));
  expect_whole(records().at(0), 4);
  EXPECT_EQ(times(records().at(0) / "mav0/imu0/data.csv").back(), now_ - kSecond / 200);
  EXPECT_EQ(recorder.report().lost, 0u);
  const std::string yaml = text_of(records().at(0) / "mav0/cam0/sensor.yaml"), said = "record 1, written at ";
  ASSERT_NE(yaml.find(said), std::string::npos) << yaml;
  EXPECT_NEAR(std::stod(yaml.substr(yaml.find(said) + said.size())), 1100, 0.1) << "s";
  Event event;
  ASSERT_TRUE(recorder.events().pop(event));
  EXPECT_EQ(event.id, EventId::kRecordWritten);
}

TEST_F(FlightRecorderTest, AFlightShorterThanThatIsThereWhole) {
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 2);
  recorder.finish(true);
  expect_whole(records().at(0), 2);
  const std::string tracks = text_of(records().at(0) / "mav0/cam0/tracks.csv");
  EXPECT_NE(tracks.find("1000050000000,0,nan,nan\n"), std::string::npos) << "an image without a track";
  EXPECT_NE(tracks.find(",3,0.3,3333333.2\n"), std::string::npos) << tracks.substr(0, 500);
}

TEST_F(FlightRecorderTest, SpeedsOfWheelsAreInItIfThereAreAny) {
  wheels_ = true;
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 100);
  recorder.finish(true);
  expect_whole(records().at(0), 4);
  EXPECT_NE(text_of(records().at(0) / "mav0/wheel0/data.csv").find(",0.3333333333333333\n"), std::string::npos);
  EXPECT_EQ(recorder.report().lost, 0u);
}

TEST_F(FlightRecorderTest, RequestsInFlightAreWrittenWhileRecordingGoesOn) {
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 10);
  for (std::size_t n = 1; n <= 5; ++n) {
    recorder.request();
    ASSERT_EQ(fly_until_done(recorder), EventId::kRecordWritten);
    ASSERT_EQ(count(), n);
    fly_seconds(recorder, 0.3 * static_cast<double>(n));
  }
  recorder.finish(false);
  EXPECT_EQ(recorder.report().written.size(), 5u);
  for (const fs::path& record : records()) expect_whole(record, 4);
  EXPECT_EQ(records().at(4).filename(), "record-005-requested");
}

TEST_F(FlightRecorderTest, NumbersGoOnInAFolderThatHasRecords) {
  fs::create_directories(fs::path(config_.folder) / "record-041-lost");
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 1);
  recorder.finish(true);
  EXPECT_EQ(records().at(1).filename(), "record-042-end");
}

// The oldest go, and only what a recorder wrote.
TEST_F(FlightRecorderTest, KeepsAsManyRecordsAsItIsTold) {
  config_.keep = 3;
  const fs::path folder = config_.folder;
  for (const char* name : {"record-007-lost", "record-008-end", "record-040-lost", "records-of-mine"})
    fs::create_directories(folder / name / "mav0");
  std::ofstream(folder / "record-001-notes") << "a file";
  fs::create_directory_symlink("/", folder / "record-002-link");
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 1);
  recorder.request();
  ASSERT_EQ(fly_until_done(recorder), EventId::kRecordWritten);
  fly_seconds(recorder, 0.3);
  recorder.finish(true);
  std::vector<std::string> names;
  for (const fs::path& path : records()) names.push_back(path.filename());
  EXPECT_EQ(names, (std::vector<std::string>{"record-001-notes", "record-002-link", "record-040-lost",
                                             "record-041-requested", "record-042-end", "records-of-mine"}));
  EXPECT_EQ(recorder.report().removed, 2U);
}

TEST_F(FlightRecorderTest, LostMakesARecordAfterAWhileAndNotTooOften) {
  config_.after_lost_s = 1;
  config_.pause_s = 20;
  config_.most = 2;
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 10);
  const std::int64_t lost_at = now_;
  fly(recorder, HealthState::kLost);
  const fs::path first = fs::path(config_.folder) / "record-001-lost-begin";
  for (int i = 0; i < kPatience && !fs::exists(first); ++i)  // flown seconds are faster than a disk
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  ASSERT_TRUE(fs::exists(first));
  fly_seconds(recorder, 1, HealthState::kLost);
  ASSERT_EQ(wait_until_done(recorder), EventId::kRecordWritten);
  ASSERT_EQ(count(), 1u);
  const auto written = times(records().at(0) / "states.csv");
  EXPECT_EQ(records().at(0).filename(), "record-001-lost");
  EXPECT_NEAR(1e-9 * static_cast<double>(written.back() - lost_at), 1, 0.15);
  const auto lose_and_fly = [&](double seconds) {
    fly(recorder, HealthState::kLost);
    fly_seconds(recorder, seconds);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  };
  lose_and_fly(5);  // too soon
  EXPECT_EQ(count(), 1u);
  fly_seconds(recorder, 20);
  lose_and_fly(5);
  ASSERT_EQ(fly_until_done(recorder), EventId::kRecordWritten);
  fly_seconds(recorder, 50);
  lose_and_fly(5);  // the third
  recorder.finish(false);
  EXPECT_EQ(count(), 2u);
}

// The battery may be gone before the seconds after the loss have passed.
TEST_F(FlightRecorderTest, WhatLedToALossIsWrittenAtOnce) {
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 10);
  const std::int64_t lost_at = now_;
  fly(recorder, HealthState::kLost);
  const fs::path first = fs::path(config_.folder) / "record-001-lost-begin";
  for (int i = 0; i < kPatience && !fs::exists(first); ++i) {
    recorder.pass(HostStamp{now_});
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ASSERT_TRUE(fs::exists(first));
  const auto before = times(first / "states.csv");
  ASSERT_FALSE(before.empty());
  EXPECT_NEAR(1e-9 * static_cast<double>(before.back() - lost_at), 0.05, 0.01) << "the first lost image";
  Event event;
  EXPECT_FALSE(recorder.events().pop(event)) << "told when it is whole";
  ASSERT_EQ(fly_until_done(recorder), EventId::kRecordWritten);
  ASSERT_EQ(count(), 1u);
  EXPECT_EQ(records().at(0).filename(), "record-001-lost") << "in the first one's place";
  recorder.finish(false);
  EXPECT_EQ(recorder.report().written.size(), 1u);
  EXPECT_EQ(recorder.report().lost, 0u);
}

TEST_F(FlightRecorderTest, LostShortlyBeforeTheEndIsWritten) {
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 5);
  fly(recorder, HealthState::kLost);
  recorder.finish(false);
  ASSERT_EQ(count(), 1u);
  EXPECT_EQ(records().at(0).filename(), "record-001-lost");
}

// The estimator may start anew at once, and is never seen lost.
TEST_F(FlightRecorderTest, AResetCountsAsLost) {
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 5);
  ++resets_;
  fly_seconds(recorder, 5, HealthState::kInitialising);
  recorder.finish(false);
  EXPECT_EQ(count(), 1u);
}

TEST_F(FlightRecorderTest, ImagesAreKeptAsFarAsTheirMemoryGoes) {
  config_.images = true;
  config_.image_memory_mib = 1;
  run_.camera.parameters.width = 640;  // 1 MiB holds three of these ...
  run_.camera.parameters.height = 480;
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 10);  // ... and more of the small ones that come
  recorder.finish(true);
  const fs::path cam = records().at(0) / "mav0/cam0";
  const auto listed = times(cam / "data.csv"), tracks = times(cam / "tracks.csv");
  ASSERT_GE(listed.size(), 3u);
  ASSERT_LE(listed.size(), tracks.size());
  EXPECT_EQ(listed.back(), tracks.back());
  for (std::size_t i = 0; i < listed.size(); ++i) {
    EXPECT_EQ(listed[i], tracks[tracks.size() - listed.size() + i]);
    const auto serial = static_cast<int>((listed[i] - 1000 * kSecond) / (kSecond / 20) - 1);
    EXPECT_EQ(text_of(cam / "data" / (std::to_string(listed[i]) + ".png")),
              "image " + std::to_string(serial % 256) + " 64");
  }
}

TEST_F(FlightRecorderTest, ImagesOfASecondCameraAreKeptBesideTheFirstOnes) {
  config_.images = true;
  run_.others[0] = run_.camera;
  run_.others[0]->parameters.width = 32;
  run_.others[0]->parameters.height = 40;
  run_.others[0]->p_BC = {0.11, 0, 0};
  {
    FlightRecorder recorder(config_, run_);
    fly_seconds(recorder, 1);
    recorder.finish(true);
  }
  const fs::path mav = records().at(0) / "mav0";
  const auto first = times(mav / "cam0/data.csv"), second = times(mav / "cam1/data.csv");
  EXPECT_EQ(first.size(), 20u);
  ASSERT_EQ(second.size(), 13u) << "every third one is missing";
  EXPECT_EQ(second[0], first[1]);
  EXPECT_EQ(second[2], first[4]);
  EXPECT_EQ(text_of(mav / "cam1/data" / (std::to_string(second[0]) + ".png")), "image 9 32");
  EXPECT_NE(text_of(mav / "cam1/sensor.yaml").find("resolution: [32, 40]"), std::string::npos);
  EXPECT_NE(text_of(mav / "cam1/sensor.yaml").find("0.11"), std::string::npos);
  config_.images = false;
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 1);
  recorder.finish(true);
  EXPECT_FALSE(fs::exists(records().at(1) / "mav0/cam1")) << "without images, the tracks of the first one only";
}

std::atomic<bool> disk_is_stuck{false}, disk_is_asked{false};

// A disk that takes forever holds up the writing thread alone: the samples go on, images are lost once their spare room
// is full, and the next record has what came meanwhile.
TEST_F(FlightRecorderTest, AStuckDiskCostsImagesAtMost) {
  config_.images = true;
  config_.image_memory_mib = 1;
  run_.png = [](const Frame&) {
    disk_is_asked = true;
    while (disk_is_stuck) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return std::string("image");
  };
  disk_is_stuck = true;
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 30);
  recorder.request();
  fly(recorder);
  while (!disk_is_asked) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  fly_seconds(recorder, 30);
  recorder.request();  // kept in mind
  fly_seconds(recorder, 1);
  EXPECT_EQ(count(), 0u);
  disk_is_stuck = false;
  for (int i = 0; i < 2; ++i) ASSERT_EQ(fly_until_done(recorder), EventId::kRecordWritten);
  recorder.finish(false);
  ASSERT_EQ(recorder.report().written.size(), 2u);
  EXPECT_GT(recorder.report().lost, 0u);
  for (const fs::path& record : records()) expect_whole(record, 4);
}

TEST_F(FlightRecorderTest, WhereItCannotWriteItSaysSoAndFliesOn) {
  fs::create_directories(folder_);
  std::ofstream(config_.folder) << "a file where a folder should be\n";
  FlightRecorder recorder(config_, run_);
  fly_seconds(recorder, 5);
  recorder.request();
  EXPECT_EQ(fly_until_done(recorder), EventId::kRecordFailed);
  fly_seconds(recorder, 5);
  fs::remove(config_.folder);  // and when it can again, it does
  recorder.finish(true);
  ASSERT_EQ(recorder.report().failed.size(), 1u);
  EXPECT_NE(recorder.report().failed[0].find(config_.folder), std::string::npos) << recorder.report().failed[0];
  EXPECT_NE(recorder.report().failed[0].find("; expected a folder to write to"), std::string::npos);
  ASSERT_EQ(count(), 1u);
  expect_whole(records().at(0), 4);
}

TEST_F(FlightRecorderTest, AFullDiskLeavesNoHalfARecord) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  {
    const rlimit small{20'000, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    FlightRecorder recorder(config_, run_);
    fly_seconds(recorder, 5);
    recorder.finish(true);
    setrlimit(RLIMIT_FSIZE, &before);
    ASSERT_EQ(recorder.report().failed.size(), 1u);
    EXPECT_NE(recorder.report().failed[0].find("imu0/data.csv: cannot be written (File too large); expected"),
              std::string::npos)
        << recorder.report().failed[0];
    Event event;
    ASSERT_TRUE(recorder.events().pop(event));
    EXPECT_EQ(event.id, EventId::kRecordFailed);
    EXPECT_EQ(event.args[2], EFBIG);
  }
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_TRUE(records().empty());
}

}  // namespace
}  // namespace epiline
