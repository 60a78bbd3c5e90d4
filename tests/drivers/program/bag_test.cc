// Bags as data sets: the same flight as a folder and as a bag of every format gives the same trajectory; a damaged bag
// is one line, and an interrupted one is read up to its end.
#include <algorithm>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "drivers/flights/recordings/bag_content.h"
#include "pipeline/text/table.h"
#include "tests/drivers/program/bag_writers.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

RawMessage image_message(std::int64_t ns, const cv::Mat& pixels, const std::string& encoding, bool is_cdr = false) {
  RawMessage m{"sensor_msgs/Image", is_cdr};
  const std::size_t step = pixels.step;
  m.header(ns).u32(static_cast<std::size_t>(pixels.rows)).u32(static_cast<std::size_t>(pixels.cols)).text(encoding);
  return m.u8(0).u32(step).block(pixels.data, step * static_cast<std::size_t>(pixels.rows));
}

RawMessage imu_message(std::int64_t ns, const double* rates_and_forces, bool is_cdr = false) {
  RawMessage m{"sensor_msgs/Imu", is_cdr};
  m.header(ns);
  for (int i = 0; i < 4 + 9; ++i) m.f64(9);
  for (int i = 0; i < 3; ++i) m.f64(rates_and_forces[i]);
  for (int i = 0; i < 9; ++i) m.f64(9);
  for (int i = 3; i < 6; ++i) m.f64(rates_and_forces[i]);
  for (int i = 0; i < 9; ++i) m.f64(9);
  return m;
}

constexpr double kStill[6] = {0, 0, 1e-3, 0, 0, 9.81};

/// A rendered flight as a folder, and what a bag is written from.
class Bag : public CommandTest {
 protected:
  static void SetUpTestSuite() {
    folder() = fs::path(testing::TempDir()) / ("epiline_bag_flight_" + std::to_string(getpid()));
    fs::remove_all(folder());
    const std::string simulate = std::string(EPILINE_STUDY) + " simulate --flight agile --duration 2.5 --out ";
    ASSERT_EQ(std::system((simulate + folder().string()).c_str()), 0);
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
  void SetUp() override {
    CommandTest::SetUp();
    write(config, calibrated_by(folder()));
  }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }

  static std::vector<std::pair<std::int64_t, fs::path>> images() {
    std::vector<std::pair<std::int64_t, fs::path>> list;
    const std::string text = read(folder() / "mav0/cam0/data.csv");
    LineReader lines(text);
    for (std::string_view line, time, name; lines.next(line);) {
      std::int64_t ns = 0;
      take_field(line, time);
      take_field(line, name);
      parse_number(time, ns);
      list.emplace_back(ns, folder() / "mav0/cam0/data" / std::string(name));
    }
    return list;
  }

  // What goes into a bag: each writes a part of the flight.
  using Part = std::function<void(BagWriter& to)>;

  /// Stamps in the headers are those of the flight, or 0.
  static Part images_as(const std::string& encoding, const std::string& topic = "/cam0/image_raw",
                        bool has_stamps = true) {
    return [=](BagWriter& to) {
      for (const auto& [ns, path] : images()) {
        const std::int64_t stamp = has_stamps ? ns : 0, recorded = has_stamps ? ns + 3'000'000 : ns;
        if (encoding == "compressed") {
          const std::string file = read(path);
          RawMessage m = to.message("sensor_msgs/CompressedImage");
          m.header(stamp).text("png").block(file.data(), file.size());
          to.write(topic, recorded, m);
        } else {
          const cv::Mat grey = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
          to.write(topic, recorded, image_message(stamp, as_encoded(grey, encoding), encoding, to.is_cdr()));
        }
      }
    };
  }
  static cv::Mat as_encoded(const cv::Mat& grey, const std::string& encoding) {
    cv::Mat pixels = grey;
    const cv::Mat other(grey.size(), CV_8U, cv::Scalar(77)), planes[] = {grey, grey, grey, other};
    if (encoding == "mono16" || encoding == "16UC1")
      grey.convertTo(pixels, CV_16U, 256, 77);  // the lower bits must not matter
    if (encoding == "bgr8" || encoding == "rgb8" || encoding == "8UC3") cv::merge(planes, 3, pixels);
    if (encoding == "bgra8" || encoding == "rgba8") cv::merge(planes, 4, pixels);
    const cv::Mat brightness_last[] = {other, grey}, brightness_first[] = {grey, other};
    if (encoding == "yuv422") cv::merge(brightness_last, 2, pixels);
    if (encoding == "yuv422_yuy2") cv::merge(brightness_first, 2, pixels);
    return pixels;
  }

  static NumberTable table(const std::string& name, std::size_t width) {
    return *parse_table(read(folder() / "mav0" / name), name, TimeColumn::kNanoseconds, {width}, "row");
  }
  static void write_imu(BagWriter& to) {
    const NumberTable imu = table("imu0/data.csv", 7);
    for (std::size_t i = 0; i < imu.rows(); ++i)
      to.write("/imu0", imu.time_ns[i], imu_message(imu.time_ns[i], imu.row(i), to.is_cdr()));
  }
  static Part truth_as(const std::string& type) {
    return [=](BagWriter& to) {
      const auto path = folder() / "mav0/state_groundtruth_estimate0/data.csv";
      const auto truth = parse_table(read(path), "truth", TimeColumn::kNanoseconds, {8, 11, 17}, "pose");
      ASSERT_TRUE(truth);
      for (std::size_t i = 0; i < truth->rows(); ++i) {
        const double* row = truth->row(i);
        RawMessage m = to.message(type);
        m.header(truth->time_ns[i]);
        if (type != "geometry_msgs/PoseStamped") m.text("body");
        for (int k = 0; k < 3; ++k) m.f64(row[k]);
        for (const int k : {4, 5, 6, 3}) m.f64(row[k]);  // w comes first in the file, last in the message
        to.write("/truth", truth->time_ns[i], m);
      }
    };
  }
  static void write_images(BagWriter& to) { images_as("mono8")(to); }
  static void write_truth(BagWriter& to) { truth_as("geometry_msgs/PoseStamped")(to); }
  /// Writes a bag; it is whole afterwards.
  static void record(BagWriter&& to, const std::vector<Part>& parts = {write_images, write_imu, write_truth}) {
    for (const Part& part : parts) part(to);
  }
  void write_flight(const std::string& encoding = "mono8") {
    record(Ros1Writer(bag), {images_as(encoding), write_imu, write_truth});
  }

  static std::string replay_of(const fs::path& recording, const fs::path& config, const fs::path& out) {
    return "replay " + in_quotes(recording) + " --config " + in_quotes(config) + " --out " + in_quotes(out) + " ";
  }
  Outcome replay(const std::string& more = "") { return run(replay_of(bag, config, out) + more); }
  std::string trajectory() const { return read(out / "trajectory.tum"); }
  /// Of the folder; the same settings.
  std::string expected() {
    const fs::path to = scratch() / "folder_out";
    EXPECT_EQ(run(replay_of(folder(), config, to)).exit_code, 0);
    return read(to / "trajectory.tum");
  }

  fs::path bag = scratch() / "flight.bag", config = scratch() / "config.toml", out = scratch() / "out";
};

/// Truth in a bag has no velocity, so nothing judges the estimated one.
Json without_velocity(Json error) {
  error.erase("nees_velocity");
  error["calibration_curve"].erase("velocity");
  return error;
}

TEST_F(Bag, GivesTheTrajectoryOfTheFolderToTheLastByte) {
  const std::string wanted = expected();
  EXPECT_GT(std::count(wanted.begin(), wanted.end(), '\n'), 30);
  write_flight();
  const Outcome r = replay();
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(trajectory(), wanted);
  const Json a = Json::parse(read(out / "stats.json")), b = Json::parse(read(scratch() / "folder_out/stats.json"));
  EXPECT_EQ(without_velocity(a["error"]), without_velocity(b["error"]));
  EXPECT_EQ(a["imu"], b["imu"]);
}

TEST_F(Bag, OfEveryFormatGivesTheSameTrajectory) {
  const std::string wanted = expected();
  const auto expect_same = [&](const fs::path& name) {
    bag = name;
    const Outcome r = replay();
    ASSERT_EQ(r.exit_code, 0) << name << r.err;
    EXPECT_EQ(trajectory(), wanted) << name;
    fs::remove_all(name);
  };
  for (const char* packing : {"bz2", "lz4"}) {
    record(Ros1Writer(scratch() / "packed.bag", packing));
    expect_same(scratch() / "packed.bag");
  }
  for (const char* packing : {"", "lz4", "zstd", "open", "message"}) {
    record(McapWriter(scratch() / "ros2.mcap", packing));
    expect_same(scratch() / "ros2.mcap");
  }
  record(McapWriter(scratch() / "ros1.mcap", "lz4", false));
  expect_same(scratch() / "ros1.mcap");
  for (const bool packs : {false, true}) {
    record(Db3Writer(scratch() / "a.db3", packs));
    expect_same(scratch() / "a.db3");
  }
  const fs::path whole = scratch() / "whole", parts = scratch() / "parts";
  record(Db3Writer(whole / "whole_0.db3"));  // packed as a file, listed
  write(whole / "whole_0.db3.zstd", zstd_of(read(whole / "whole_0.db3")));
  fs::remove(whole / "whole_0.db3");
  write(whole / "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [whole_0.db3.zstd]\n");
  expect_same(whole);
  record(McapWriter(parts / "parts_1.mcap", "zstd"), {write_imu});  // split, and without a list after an interruption
  record(McapWriter(parts / "parts_0.mcap", "zstd"), {write_images, write_truth});
  expect_same(parts);
  for (const char* ending : {".db3", ".mcap"}) {
    const auto all = images();
    record(SplitWriter(scratch() / "split", ending, all[all.size() / 2].first));
    expect_same(scratch() / "split");
  }
}

TEST_F(Bag, EncodingsDoNotMatter) {
  const std::string wanted = expected();
  for (const char* encoding :
       {"8UC1", "mono16", "16UC1", "bgr8", "rgb8", "8UC3", "bgra8", "rgba8", "yuv422", "yuv422_yuy2", "compressed"}) {
    write_flight(encoding);
    const Outcome r = replay();
    ASSERT_EQ(r.exit_code, 0) << encoding << ": " << r.err;
    EXPECT_EQ(trajectory(), wanted) << encoding;
  }
  write_flight("bayer_rggb8");  // neighbours are mixed, so not the same
  EXPECT_EQ(replay("--start 0.5").exit_code, 0);
}

// As RealSense cameras are recorded: two rates, and the other sensor's numbers zero.
TEST_F(Bag, GyroscopeAndAccelerometerOfTwoTopicsAreOneImu) {
  const NumberTable imu = table("imu0/data.csv", 7);
  const auto write_halves = [&](BagWriter& to) {
    for (std::size_t i = 0; i < imu.rows(); ++i) {
      const double* r = imu.row(i);
      const double rates[6] = {r[0], r[1], r[2], 0, 0, 0}, forces[6] = {0, 0, 0, r[3], r[4], r[5]};
      to.write("/camera/gyro/sample", imu.time_ns[i], imu_message(imu.time_ns[i], rates, to.is_cdr()));
      to.write("/camera/accel/sample", imu.time_ns[i], imu_message(imu.time_ns[i], forces, to.is_cdr()));
    }
  };
  const std::string wanted = expected();
  record(Ros1Writer(bag), {write_images, write_halves});
  for (const char* topic : {"", "--imu-topic /camera/gyro/sample", "--imu-topic /camera/accel/sample"}) {
    const Outcome r = replay(topic);
    ASSERT_EQ(r.exit_code, 0) << r.err;
    EXPECT_NE(r.out.find("joined to one IMU"), std::string::npos) << r.out;
    EXPECT_EQ(trajectory(), wanted);
  }
  const double rates[6] = {1, 2, 3, 0, 0, 0};
  record(Ros1Writer(bag),
         {write_images, [&](BagWriter& to) { to.write("/gyro", imu.time_ns[0], imu_message(imu.time_ns[0], rates)); }});
  expect_one_line(replay(), 2, {"/gyro holds rates, but no acceleration"});
}

TEST_F(Bag, DistancesAreNoImage) {
  const std::string wanted = expected();
  const Part depth = images_as("16UC1", "/camera/depth/image_raw");
  record(Ros1Writer(bag), {depth, images_as("rgb8", "/camera/color/image_raw"), write_imu});
  ASSERT_EQ(replay().exit_code, 0);
  EXPECT_EQ(trajectory(), wanted);
  record(Ros1Writer(bag), {depth, write_imu});
  expect_one_line(replay(), 2, {"no image but /camera/depth/image_raw"});
}

TEST_F(Bag, StampsOfTheRecordingServeWhereHeadersHaveNone) {
  const std::string wanted = expected();
  record(Ros1Writer(bag), {images_as("mono8", "/cam0/image_raw", false), write_imu});
  const Outcome r = replay();
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("/cam0/image_raw: no stamps in the headers"), std::string::npos) << r.out;
  EXPECT_EQ(trajectory(), wanted);
}

TEST_F(Bag, TruthOfEveryKindIsComparedWith) {
  expected();
  const Json wanted = without_velocity(Json::parse(read(scratch() / "folder_out/stats.json"))["error"]);
  ASSERT_TRUE(wanted["ate_4dof_m"]["rmse"].is_number());
  for (const char* type : {"geometry_msgs/TransformStamped", "nav_msgs/Odometry"}) {
    record(Ros1Writer(bag), {write_images, write_imu, truth_as(type)});
    ASSERT_EQ(replay().exit_code, 0);
    EXPECT_EQ(without_velocity(Json::parse(read(out / "stats.json"))["error"]), wanted) << type;
  }
}

TEST_F(Bag, TopicsAreFoundOrChosen) {
  record(Ros1Writer(bag), {write_images, images_as("mono8", "/cam1/image_raw"), write_imu, [](BagWriter& to) {
                             RawMessage position = to.message("geometry_msgs/PointStamped");
                             to.write("/leica/position", 100'000'000'000, position.header(1).f64(1).f64(2).f64(3));
                           }});
  const Outcome r = replay();
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("/cam0/image_raw is used; the bag also has /cam1/image_raw"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("/leica/position has positions only"), std::string::npos) << r.out;
  EXPECT_FALSE(Json::parse(read(out / "stats.json"))["dataset"]["has_ground_truth"]);
  EXPECT_EQ(replay("--image-topic /cam1/image_raw --imu-topic /imu0").exit_code, 0);
  expect_one_line(replay("--image-topic /cam7"), 2, {"no topic /cam7", "/cam0/image_raw, /cam1/image_raw"});
  expect_one_line(replay("--imu-topic /cam0/image_raw"), 2, {"has the type sensor_msgs/Image", "sensor_msgs/Imu"});
  expect_one_line(replay("--truth-topic /leica/position"), 2, {"geometry_msgs/PointStamped", "nav_msgs/Odometry"});
}

TEST_F(Bag, WithoutCalibrationItSaysWhatToDo) {
  write_flight();
  expect_one_line(run("replay " + in_quotes(bag) + " --out " + in_quotes(out)), 2,
                  {"holds no calibration", "[camera] calibration"});
  write(config, "[camera]\ncalibration = \"" + (folder() / "mav0/cam0/sensor.yaml").string() + "\"\n");
  expect_one_line(replay(), 2, {"holds no calibration", "[imu] calibration"});
}

TEST_F(Bag, IsBenchmarkedAsAFolderIs) {
  write_flight();
  const Outcome r = run(in_quotes(bag) + " --factors track --config " + in_quotes(config) + " --out " + in_quotes(out),
                        EPILINE_SOURCE "/tests/flights/benchmark --program ");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_TRUE(Json::parse(read(out / "benchmark.json"))["datasets"][0]["has_ground_truth"]);
}

TEST_F(Bag, DamageIsOneClearLine) {
  expect_one_line(replay(), 2, {"does not exist"});
  write(bag, "no bag at all");
  expect_one_line(replay(), 2, {"cannot be read as a bag"});
  write(bag, "");
  expect_one_line(replay(), 2, {"cannot be read as a bag"});
  write_flight();
  const std::string whole = read(bag);
  for (const double share : {0.001, 0.3}) {
    write(bag, whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    expect_one_line(replay(), 2, {"flight.bag: has no "});
  }
  std::string codec = whole;
  for (std::size_t found = 0; (found = codec.find("compression=none", found)) != std::string::npos;)
    codec.replace(found, 16, "compression=rar!");
  write(bag, codec);
  expect_one_line(replay(), 2, {"cannot be read as a bag", "rar!"});
}

// The difference of two times is a number of 64 bits, whatever the file says.
TEST_F(Bag, TimesThatNoClockShowsAreTheLastThatOneDoes) {
  bag = scratch() / "a.mcap";
  record(McapWriter(bag, ""), {[](BagWriter& to) {
           for (const std::int64_t ns : {INT64_MIN, INT64_MAX}) to.write("/imu", ns, imu_message(0, kStill, true));
         }});
  const auto content = read_bag(bag);
  ASSERT_TRUE(content);
  const auto& entries = content->topics[0].entries;
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[1].recorded_ns, (std::int64_t{1} << 62) - 1);
  EXPECT_EQ(entries[0].recorded_ns, -entries[1].recorded_ns);
}

// Of each format, with the sensors interleaved as a recorder writes them: what came before the end is flown.
TEST_F(Bag, OfAnInterruptedRecordingIsReadUpToItsEnd) {
  const NumberTable imu = table("imu0/data.csv", 7);
  const auto write_interleaved = [&](BagWriter& to) {
    std::size_t i = 0;
    for (const auto& [ns, path] : images()) {
      for (; i < imu.rows() && imu.time_ns[i] <= ns; ++i)
        to.write("/imu0", imu.time_ns[i], imu_message(imu.time_ns[i], imu.row(i), to.is_cdr()));
      to.write("/cam0", ns, image_message(ns, cv::imread(path.string(), cv::IMREAD_GRAYSCALE), "mono8", to.is_cdr()));
    }
  };
  const fs::path names[] = {scratch() / "a.bag", scratch() / "a.mcap", scratch() / "a.db3"};
  record(Ros1Writer(names[0], "lz4"), {write_interleaved});
  record(McapWriter(names[1], "zstd"), {write_interleaved});
  record(Db3Writer(names[2]), {write_interleaved});
  for (const fs::path& name : names) {
    const std::string whole = read(name);
    write(name, whole.substr(0, whole.size() * 8 / 10));
    bag = name;
    const Outcome r = replay();
    ASSERT_EQ(r.exit_code, 0) << name << r.err;
    EXPECT_NE(r.out.find("ends early, as after an interruption"), std::string::npos) << name << r.out;
  }
}

TEST_F(Bag, MessagesCutShortAreOneClearLine) {
  constexpr std::size_t kShortest = 0;
  const auto only = [&](const RawMessage& image, const RawMessage& imu) {
    Ros1Writer to(bag);
    to.write("/image", 100'000'000'000, image);
    to.write("/imu", 100'000'000'000, imu);
  };
  const RawMessage imu = imu_message(100'000'000'000, kStill);
  const cv::Mat pixels(480, 752, CV_8U, cv::Scalar(128));
  const RawMessage image = image_message(100'000'000'000, pixels, "mono8");
  for (const std::size_t left : {kShortest, std::size_t{3}, std::size_t{20}, imu.p.bytes.size() - 1}) {
    RawMessage cut = imu;
    cut.p.bytes.resize(left);
    only(image, cut);
    expect_one_line(replay(), 2, {"message 1 of /imu ends after " + std::to_string(left) + " bytes"});
  }
  for (const std::size_t left : {kShortest, std::size_t{10}, std::size_t{30}, image.p.bytes.size() - 1}) {
    RawMessage cut = image;
    cut.p.bytes.resize(left);
    only(cut, imu);
    expect_one_line(replay(), 2, {"message 1 of /image ends after " + std::to_string(left) + " bytes"});
  }
  RawMessage liar = image;  // 2^32 - 1 rows in the same data
  const std::size_t rows = 4 + 4 + 4 + 4 + 5;
  for (std::size_t i = 0; i < 4; ++i) liar.p.bytes[rows + i] = static_cast<char>(0xff);
  only(liar, imu);
  expect_one_line(replay(), 2, {"/image ends"});
  only(image_message(100'000'000'000, pixels, "32SC1"), imu);
  expect_one_line(replay(), 2, {"32SC1", "mono8"});
  only(image_message(100'000'000'000, cv::Mat(48, 75, CV_8U, cv::Scalar(1)), "mono8"), imu);
  expect_one_line(replay(), 2, {"image 1 of /image has 75x48 pixels", "as in the calibration"});
}

}  // namespace
}  // namespace epiline
