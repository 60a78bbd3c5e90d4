#include "drivers/program/live/live_run.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <utility>

#include "drivers/program/live/live_log.h"
#include "drivers/study/report/report.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/text/trajectory.h"
#include "tests/drivers/program/must.h"
#include "tests/drivers/program/standing_sensors.h"

namespace epiline {
namespace {

using test::must;
using test::StandingCamera;
using test::StandingImu;

class CountingSink final : public OdometrySink {
 public:
  Status open() override {
    ++opened;
    return opened > absent ? status : Error{ErrorKind::kRun, "/dev/ttyX", 0, "not there", ""};
  }
  void close() noexcept override { ++closed; }
  bool publish(const Odometry& odometry) noexcept override {
    ++published;
    last = odometry;
    return true;
  }
  Status status = Done{};
  std::uint64_t published = 0;
  int opened = 0, closed = 0;
  int absent = 0;  ///< attempts to open it that fail
  Odometry last;
};

struct CountingObserver final : FlightObserver {
  void take(const FrameOutcome& /*outcome*/) noexcept override { ++taken; }
  std::uint64_t taken = 0;
};

struct Stand {
  Stand() {
    settings.source = "stand.toml";
    settings.camera.width = StandingCamera::kWidth;
    settings.camera.height = StandingCamera::kHeight;
    settings.camera.intrinsics = {250, 250, 160, 120};
    settings.config.estimator.extrinsics.focal_px = 250;
    settings.config.realtime.lock_memory = false;
    auto c = std::make_unique<StandingCamera>();
    auto i = std::make_unique<StandingImu>();
    auto s = std::make_unique<CountingSink>();
    camera = c.get();
    imu = i.get();
    sink = s.get();
    devices.camera = std::move(c);
    devices.imu = std::move(i);
    devices.outputs.push_back({std::move(s),
                               [this] {
                                 return OutputRecord{"counter", sink->published, 0, 0, {}};
                               },
                               "counter", [this] { return !line_is_lost; }});
    options.out = std::filesystem::path(testing::TempDir()) /
                  ("live_" + std::to_string(getpid()) + testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  ~Stand() { std::filesystem::remove_all(options.out); }

  FlightRecord fly(const std::function<bool(const LiveState&)>& watch) {
    return must(epiline::fly(settings, devices, options, watch));
  }
  std::string error_of_flight(const std::function<bool(const LiveState&)>& watch = [](const LiveState&) {
    return true;
  }) {
    const auto record = epiline::fly(settings, devices, options, watch);
    return record ? "" : record.error().text();
  }
  FlightRecord fly_images(std::uint64_t count) {
    return fly([&](const LiveState& state) { return state.images < count && state.since_start.seconds() < 60; });
  }

  LiveSettings settings;
  LiveDevices devices;
  LiveOptions options;
  StandingCamera* camera;
  StandingImu* imu;
  CountingSink* sink;
  std::atomic<bool> line_is_lost{false};
};

TEST(LiveRun, FliesUntilItIsToldToEndAndLeavesFilesBehind) {
  Stand stand;
  double fastest_rad_s = 0;
  stand.devices.turns = [&](double rad_s) { fastest_rad_s = std::max(fastest_rad_s, rad_s); };
  const pthread_t flying = pthread_self();
  CountingObserver observer;
  stand.devices.outputs[0].observer = &observer;
  bool asked = false;
  std::uint64_t lines_before = 0;
  const auto record = stand.fly([&](const LiveState& state) {
    if (state.has_pose && state.images > 50 && !asked) {
      std::ifstream file(stand.options.out / "trajectory.tum");
      for (std::string line; std::getline(file, line);) ++lines_before;
      asked = true;
      pthread_kill(flying, SIGTERM);
    }
    return state.since_start.seconds() < 60;
  });
  ASSERT_TRUE(asked) << "no pose within a minute";
  EXPECT_GT(lines_before, 10u) << "the file grows while the flight goes on";
  EXPECT_LT(record.dataset_duration_s, 59) << "the signal ended it";
  const Trajectory trajectory = must(read_trajectory(stand.options.out / "trajectory.tum"));
  EXPECT_EQ(trajectory.poses.size(), trajectory_of(record).poses.size());
  for (const TimedPose& pose : trajectory.poses) EXPECT_LT(pose.p_WB.norm(), 0.05);
  EXPECT_TRUE(std::filesystem::exists(stand.options.out / "events.txt"));
  EXPECT_GE(observer.taken, trajectory.poses.size()) << "a receiver may observe what the log thread hands out";
  EXPECT_GT(stand.sink->published, 100u);
  EXPECT_LT(std::abs(stand.sink->last.p_WB_m[0]), 0.05);
  ASSERT_EQ(record.realtime->outputs.size(), 1u);
  EXPECT_EQ(record.realtime->outputs[0].sent, stand.sink->published);
  EXPECT_NEAR(fastest_rad_s, 2e-3 * 3.5, 2e-3 * 2) << "the largest norm of three times 2e-3 rad/s of noise";
  EXPECT_EQ(stand.camera->closed, 1);
  EXPECT_EQ(stand.imu->closed, 1);
  EXPECT_EQ(stand.sink->closed, 1);
  std::size_t with_latency = 0;
  for (const ImageRecord& image : record.images) with_latency += image.latency_ms.has_value();
  EXPECT_GT(with_latency, trajectory.poses.size() / 2);
}

TEST(LiveRun, SaysWhichLineIsLostWhileItIs) {
  Stand stand;
  int round = 0;
  bool told = false, told_back = false;
  stand.fly([&](const LiveState& state) {
    ++round;
    EXPECT_EQ(round < 3 ? state.lost_outputs : "", "");
    if (round == 3) stand.line_is_lost = true;
    told |= state.lost_outputs == "counter";
    if (told && round > 5) stand.line_is_lost = false;
    told_back |= told && state.lost_outputs.empty();
    return !told_back && state.since_start.seconds() < 60;
  });
  EXPECT_TRUE(told);
  EXPECT_TRUE(told_back);
}

TEST(LiveRun, FiguresAndReportTellWhatOutputsAndDevicesSay) {
  Stand stand;
  stand.devices.outputs[0].record = [] {
    OutputRecord output{"<serial>", 7, 2, 1, {}};
    output.latency.add(3'000'000);
    return output;
  };
  stand.devices.records.emplace_back([] {
    ClockState clock;
    clock.status = ClockStatus::kLocked;
    clock.skew_ppm = 12.5;
    return DeviceRecord{"imu", {{"gaps", 3}}, clock};
  });
  const auto record = stand.fly_images(3);
  const Json figures = stats_json(record, std::nullopt, program_info());
  EXPECT_EQ(figures["realtime"]["outputs"]["<serial>"]["sent"], 7);
  EXPECT_EQ(figures["realtime"]["outputs"]["<serial>"]["latency_ms"]["max"], 3.0);
  EXPECT_EQ(figures["realtime"]["devices"]["imu"]["gaps"], 3);
  EXPECT_EQ(figures["realtime"]["devices"]["imu"]["clock"]["status"], "locked");
  EXPECT_EQ(figures["realtime"]["devices"]["imu"]["clock"]["skew_ppm"], 12.5);
  const std::string page = report_html(record, std::nullopt, program_info());
  EXPECT_NE(page.find("<td>&lt;serial&gt;</td><td>7</td><td>2</td><td>1</td>"), std::string::npos);
  EXPECT_NE(page.find("gaps 3"), std::string::npos);
  EXPECT_NE(page.find("locked, +12.5 ppm"), std::string::npos);
}

TEST(LiveRun, ADeviceThatCannotBeOpenedIsAnErrorAndTheOthersAreClosed) {
  Stand stand;
  stand.sink->status = Error{ErrorKind::kRun, "/dev/ttyX", 0, "no such device", "a flight controller"};
  EXPECT_EQ(stand.error_of_flight(), "/dev/ttyX: no such device; expected a flight controller");
  EXPECT_EQ(stand.camera->opened, 0);
  EXPECT_EQ(stand.sink->closed, 1);
}

/// Not there for so many attempts to open it.
class LateImu final : public StandingImu {
 public:
  Status open() override {
    ++attempts;
    return attempts > absent ? StandingImu::open() : Error{ErrorKind::kRun, "/dev/spidevX", 0, "not there", ""};
  }
  int attempts = 0, absent = 0;
};

LateImu* make_late(Stand& stand, int absent) {
  auto imu = std::make_unique<LateImu>();
  imu->absent = absent;
  LateImu* const late = imu.get();
  stand.imu = late;
  stand.devices.imu = std::move(imu);
  return late;
}

TEST(LiveRun, WaitsForADeviceThatIsNotThereYet) {
  Stand stand;
  const LateImu* const imu = make_late(stand, 2);
  stand.options.waits_for_devices = true;
  std::vector<std::string> waited;
  const auto record = stand.fly([&](const LiveState& state) {
    if (waited.empty() || waited.back() != state.waiting_for) waited.push_back(state.waiting_for);
    return !state.waiting_for.empty() || state.images < 3;
  });
  EXPECT_EQ(waited, (std::vector<std::string>{"IMU: /dev/spidevX: not there", ""}));
  EXPECT_EQ(imu->attempts, 3);
  EXPECT_EQ(stand.camera->opened, 1);
  EXPECT_GT(record.images_read, 0U);
}

// Camera, estimate and page begin without it; it joins when it is there.
TEST(LiveRun, AReceiverThatIsNotThereHoldsNothingBack) {
  Stand stand;
  stand.sink->absent = 3;
  stand.options.waits_for_devices = true;
  bool flew_without = false;
  std::string why;
  stand.fly([&](const LiveState& state) {
    if (state.images > 0 && state.lost_outputs == "counter") {
      flew_without = true;
      why = state.refusals;
    }
    return stand.sink->opened < 4 && state.since_start.seconds() < 60;
  });
  EXPECT_TRUE(flew_without);
  EXPECT_EQ(why, "counter: /dev/ttyX: not there");
  EXPECT_EQ(stand.sink->opened, 4);
  EXPECT_EQ(stand.sink->closed, 4) << "after each failed attempt, and at the end";
}

// Each signal ends the wait; a mistake in the settings is not waited for.
TEST(LiveRun, TheWaitForADeviceEnds) {
  for (const int signal : {SIGINT, SIGTERM}) {
    Stand stand;
    make_late(stand, 1'000'000);
    stand.options.waits_for_devices = true;
    const pthread_t flying = pthread_self();
    int calls = 0;
    const std::string error = stand.error_of_flight([&](const LiveState& state) {
      EXPECT_EQ(state.waiting_for, "IMU: /dev/spidevX: not there");
      if (calls++ == 0) pthread_kill(flying, signal);
      return calls < 1000;
    });
    EXPECT_EQ(error, "/dev/spidevX: not there");
    EXPECT_LE(calls, 2);
    EXPECT_EQ(stand.camera->opened, 0);
  }
  Stand stand;
  stand.sink->status = Error{ErrorKind::kUsage, "mavlink.baud", 0, "too slow", ""};
  stand.options.waits_for_devices = true;
  EXPECT_EQ(stand.error_of_flight(), "mavlink.baud: too slow");
}

// The tests' stdout is no terminal.
TEST(LiveRun, ADroppedLineOrAClosedPipeEndsNoFlight) {
  Stand stand;
  const pthread_t flying = pthread_self();
  std::uint64_t at = 0, last = 0;
  stand.fly([&](const LiveState& state) {
    if (at == 0 && state.images > 0) {
      at = state.images;
      pthread_kill(flying, SIGHUP);
      pthread_kill(flying, SIGPIPE);
    }
    last = state.images;
    return (at == 0 || state.images < at + 10) && state.since_start.seconds() < 60;
  });
  EXPECT_GE(last, at + 10);
}

TEST(LiveRun, ALogThatCannotBeWrittenTakesNothingWithIt) {
  Stand stand;
  std::filesystem::create_directories(stand.options.out / "trajectory.tum");  // no file can be there
  stand.settings.config.recorder.folder = stand.options.out / "records";
  const auto record = stand.fly_images(3);
  ASSERT_TRUE(record.unwritten);
  EXPECT_NE(record.unwritten->text().find("trajectory.tum: cannot be written"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(stand.options.out / "events.txt"));
  ASSERT_TRUE(record.realtime->recorder);
  EXPECT_EQ(record.realtime->recorder->written.size(), 1U) << "the flight recorder's last record";
}

TEST(LiveRun, WithoutAFolderNothingIsKept) {
  Stand stand;
  stand.settings.config.recorder.folder = stand.options.out / "records";
  std::filesystem::path log = stand.options.out / "records/flight-001/trajectory.tum";
  stand.options.keeps_images = false;
  const std::filesystem::path own = std::exchange(stand.options.out, {});
  const auto record = stand.fly_images(60);
  stand.options.out = own;
  EXPECT_EQ(record.images.size(), 0U);
  EXPECT_EQ(record.images.capacity(), 0U);
  EXPECT_TRUE(std::filesystem::exists(log)) << "the recorder's folder has the log of the flight";
}

TEST(LiveLog, ItsFilesAreSyncedEachSecondWhileItGrows) {
  const auto folder = std::filesystem::path(testing::TempDir()) / ("log_" + std::to_string(getpid()));
  for (const char* expected : {"flight-001", "flight-002", "flight-003"})
    EXPECT_EQ(make_flight_folder(folder, 2).filename(), expected);
  EXPECT_FALSE(std::filesystem::exists(folder / "flight-001")) << "two are kept";
  LiveLog log(make_flight_folder(folder, 2), false);
  FlightRecord record;
  Event event{};
  log.event(event);
  log.drain(record);
  EXPECT_GT(std::filesystem::file_size(folder / "flight-004/events.txt"), 0U) << "not in the program's memory";
  for (int i = 0; i < 300 && log.syncs() < 2; ++i) usleep(10'000);
  EXPECT_GE(log.syncs(), 2U);
  EXPECT_TRUE(log.close(record));
  std::filesystem::remove_all(folder);
}

/// Opens only when it is told to give up.
class PatientImu final : public ImuSource {
 public:
  Status open() override {
    while (!gives_up) usleep(1000);
    return Error{ErrorKind::kRun, "IMU", 0, "no samples", ""};
  }
  void give_up() noexcept override { gives_up = true; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample>, std::size_t&, Span) noexcept override { return ReadOutcome::kEnd; }
  std::atomic<bool> gives_up{false};
};

TEST(LiveRun, ADeviceThatTakesLongToOpenIsToldOfAndGivesUp) {
  Stand stand;
  stand.devices.imu = std::make_unique<PatientImu>();
  std::string waited;
  EXPECT_EQ(stand.error_of_flight([&](const LiveState& state) {
    waited = state.waiting_for;
    return false;
  }),
            "IMU: no samples");
  EXPECT_EQ(waited, "IMU: no answer yet");
}

}  // namespace
}  // namespace epiline
