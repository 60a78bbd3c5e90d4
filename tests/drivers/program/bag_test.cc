// ROS 1 bags as data sets: the same flight as a folder and as a bag gives the same trajectory; a damaged bag is one
// line. The bags are written by rosbag itself.
#ifdef EPILINE_ROSBAG
#include <console_bridge/console.h>
#include <rosbag/bag.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/text/table.h"
#include "tests/drivers/program/program.h"

namespace epiline {

/// A message as its bytes; tells rosbag what it is.
struct RawMessage {
  std::string type;
  std::vector<std::uint8_t> bytes;
  RawMessage& u8(std::uint8_t v) {
    bytes.push_back(v);
    return *this;
  }
  RawMessage& u32(std::size_t v) {
    for (int i = 0; i < 4; ++i) u8(static_cast<std::uint8_t>(v >> (8 * i)));
    return *this;
  }
  RawMessage& f64(double v) {
    std::uint8_t raw[8];
    std::memcpy(raw, &v, 8);
    bytes.insert(bytes.end(), raw, raw + 8);
    return *this;
  }
  RawMessage& text(const std::string& v) { return block(v.data(), v.size()); }
  RawMessage& block(const void* data, std::size_t size) {
    u32(size);
    const auto* first = static_cast<const std::uint8_t*>(data);
    bytes.insert(bytes.end(), first, first + size);
    return *this;
  }
  RawMessage& header(std::int64_t ns) {
    return u32(7)
        .u32(static_cast<std::size_t>(ns / 1'000'000'000))
        .u32(static_cast<std::size_t>(ns % 1'000'000'000))
        .text("frame");
  }
};

}  // namespace epiline

namespace ros::message_traits {
template <>
struct MD5Sum<epiline::RawMessage> {
  static const char* value(const epiline::RawMessage&) { return "0123456789abcdef0123456789abcdef"; }
};
template <>
struct DataType<epiline::RawMessage> {
  static const char* value(const epiline::RawMessage& m) { return m.type.c_str(); }
};
template <>
struct Definition<epiline::RawMessage> {
  static const char* value(const epiline::RawMessage&) { return "made up"; }
};
}  // namespace ros::message_traits
namespace ros::serialization {
template <>
struct Serializer<epiline::RawMessage> {
  template <class Stream>
  static void write(Stream& stream, const epiline::RawMessage& m) {
    std::uint8_t* const out = stream.advance(static_cast<std::uint32_t>(m.bytes.size()));
    std::copy(m.bytes.begin(), m.bytes.end(), out);
  }
  static std::uint32_t serializedLength(const epiline::RawMessage& m) {
    return static_cast<std::uint32_t>(m.bytes.size());
  }
};
}  // namespace ros::serialization

namespace epiline {
namespace {

ros::Time ros_time(std::int64_t ns) {
  return {static_cast<std::uint32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000)};
}

RawMessage image_message(std::int64_t ns, const cv::Mat& pixels, const std::string& encoding) {
  RawMessage m{"sensor_msgs/Image", {}};
  const std::size_t step = pixels.step;
  m.header(ns).u32(static_cast<std::size_t>(pixels.rows)).u32(static_cast<std::size_t>(pixels.cols)).text(encoding);
  return m.u8(0).u32(step).block(pixels.data, step * static_cast<std::size_t>(pixels.rows));
}

RawMessage imu_message(std::int64_t ns, const double* rates_and_forces) {
  RawMessage m{"sensor_msgs/Imu", {}};
  m.header(ns);
  for (int i = 0; i < 4 + 9; ++i) m.f64(9);
  for (int i = 0; i < 3; ++i) m.f64(rates_and_forces[i]);
  for (int i = 0; i < 9; ++i) m.f64(9);
  for (int i = 3; i < 6; ++i) m.f64(rates_and_forces[i]);
  for (int i = 0; i < 9; ++i) m.f64(9);
  return m;
}

/// A rendered flight as a folder, and what a bag is written from.
class Bag : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    console_bridge::noOutputHandler();
    folder() = fs::path(testing::TempDir()) / ("epiline_bag_flight_" + std::to_string(getpid()));
    fs::remove_all(folder());
    const std::string simulate = std::string(EPILINE_PROGRAM) + " simulate --flight agile --duration 2.5 --out ";
    ASSERT_EQ(std::system((simulate + folder().string()).c_str()), 0);
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
  void SetUp() override {
    fs::remove_all(scratch());
    fs::create_directories(scratch());
    write(config, "[camera]\ncalibration = \"" + (folder() / "mav0/cam0/sensor.yaml").string() +
                      "\"\n[imu]\ncalibration = \"" + (folder() / "mav0/imu0/sensor.yaml").string() + "\"\n");
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

  static void write_images(rosbag::Bag& to, const std::string& encoding = "mono8",
                           const std::string& topic = "/cam0/image_raw") {
    for (const auto& [ns, path] : images()) {
      const cv::Mat grey = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
      cv::Mat pixels = grey;
      if (encoding == "mono16") {  // what is below the upper eight bits must not matter
        grey.convertTo(pixels, CV_16U, 256, 77);
      } else if (encoding == "bgr8" || encoding == "rgb8") {
        const cv::Mat planes[] = {grey, grey, grey};
        cv::merge(planes, 3, pixels);
      }
      if (encoding == "compressed") {
        const std::string file = read(path);
        RawMessage m{"sensor_msgs/CompressedImage", {}};
        m.header(ns).text("png").block(file.data(), file.size());
        to.write(topic, ros_time(ns + 3'000'000), m);
      } else {
        to.write(topic, ros_time(ns + 3'000'000), image_message(ns, pixels, encoding));  // recorded later than taken
      }
    }
  }

  static NumberTable table(const std::string& name, std::size_t width) {
    return *parse_table(read(folder() / "mav0" / name), name, TimeColumn::kNanoseconds, {width}, "row");
  }
  static void write_imu(rosbag::Bag& to) {
    const NumberTable imu = table("imu0/data.csv", 7);
    for (std::size_t i = 0; i < imu.rows(); ++i)
      to.write("/imu0", ros_time(imu.time_ns[i]), imu_message(imu.time_ns[i], imu.row(i)));
  }
  static void write_truth(rosbag::Bag& to, const std::string& type) {
    const auto path = folder() / "mav0/state_groundtruth_estimate0/data.csv";
    const auto truth = parse_table(read(path), "truth", TimeColumn::kNanoseconds, {8, 11, 17}, "pose");
    ASSERT_TRUE(truth);
    for (std::size_t i = 0; i < truth->rows(); ++i) {
      const double* row = truth->row(i);
      RawMessage m{type, {}};
      m.header(truth->time_ns[i]);
      if (type != "geometry_msgs/PoseStamped") m.text("body");
      for (int k = 0; k < 3; ++k) m.f64(row[k]);
      for (const int k : {4, 5, 6, 3}) m.f64(row[k]);  // w comes first in the file, last in the message
      to.write("/truth", ros_time(truth->time_ns[i]), m);
    }
  }
  void write_flight(const std::string& encoding = "mono8",
                    rosbag::CompressionType compression = rosbag::compression::Uncompressed) {
    rosbag::Bag to(bag.string(), rosbag::bagmode::Write);
    to.setCompression(compression);
    to.setChunkThreshold(100'000);
    write_images(to, encoding);
    write_imu(to);
    write_truth(to, "geometry_msgs/PoseStamped");
  }

  Outcome replay(const std::string& more = "") {
    return run("replay '" + bag.string() + "' --config '" + config.string() + "' --out '" + out.string() + "' " + more);
  }
  std::string trajectory() const { return read(out / "trajectory.tum"); }
  /// Of the folder; the same settings.
  std::string expected() {
    const fs::path to = scratch() / "folder_out";
    EXPECT_EQ(run("replay '" + folder().string() + "' --config '" + config.string() + "' --out '" + to.string() + "'")
                  .exit_code,
              0);
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

TEST_F(Bag, EncodingsAndCompressionsDoNotMatter) {
  const std::string wanted = expected();
  for (const char* encoding : {"8UC1", "mono16", "bgr8", "rgb8", "compressed"}) {
    write_flight(encoding);
    const Outcome r = replay();
    ASSERT_EQ(r.exit_code, 0) << encoding << ": " << r.err;
    EXPECT_EQ(trajectory(), wanted) << encoding;
  }
  for (const auto compression : {rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    write_flight("mono8", compression);
    const Outcome r = replay("--start 0.5");  // images are left out at the beginning
    ASSERT_EQ(r.exit_code, 0) << r.err;
  }
}

TEST_F(Bag, TruthOfEveryKindIsComparedWith) {
  expected();
  const Json wanted = without_velocity(Json::parse(read(scratch() / "folder_out/stats.json"))["error"]);
  ASSERT_TRUE(wanted["ate_4dof_m"]["rmse"].is_number());
  for (const char* type : {"geometry_msgs/TransformStamped", "nav_msgs/Odometry"}) {
    {
      rosbag::Bag to(bag.string(), rosbag::bagmode::Write);
      write_images(to);
      write_imu(to);
      write_truth(to, type);
    }
    ASSERT_EQ(replay().exit_code, 0);
    EXPECT_EQ(without_velocity(Json::parse(read(out / "stats.json"))["error"]), wanted) << type;
  }
}

TEST_F(Bag, TopicsAreFoundOrChosen) {
  {
    rosbag::Bag to(bag.string(), rosbag::bagmode::Write);
    write_images(to, "mono8", "/cam0/image_raw");
    write_images(to, "mono8", "/cam1/image_raw");
    write_imu(to);
    RawMessage position{"geometry_msgs/PointStamped", {}};
    position.header(1).f64(1).f64(2).f64(3);
    to.write("/leica/position", ros_time(100'000'000'000), position);
  }
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
  expect_one_line(run("replay '" + bag.string() + "' --out '" + out.string() + "'"), 2,
                  {"holds no calibration", "[camera] calibration"});
  write(config, "[camera]\ncalibration = \"" + (folder() / "mav0/cam0/sensor.yaml").string() + "\"\n");
  expect_one_line(replay(), 2, {"holds no calibration", "[imu] calibration"});
}

TEST_F(Bag, IsBenchmarkedAsAFolderIs) {
  write_flight();
  const Outcome r = run("benchmark '" + bag.string() + "' --factors track --config '" + config.string() + "' --out '" +
                        out.string() + "'");
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
  for (const double share : {0.001, 0.3, 0.7, 0.999}) {
    write(bag, whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    expect_one_line(replay(), 2, {"flight.bag: "});
  }
  std::string unindexed = whole;  // as it is while it is recorded: the header says that the index is at 0
  const std::size_t at = unindexed.find("index_pos=");
  ASSERT_NE(at, std::string::npos);
  unindexed.replace(at + 10, 8, std::string(8, '\0'));
  write(bag, unindexed);
  expect_one_line(replay(), 2, {"not closed", "rosbag reindex"});
  std::string codec = whole;
  for (std::size_t found = 0; (found = codec.find("compression=none", found)) != std::string::npos;)
    codec.replace(found, 16, "compression=rar!");
  write(bag, codec);
  expect_one_line(replay(), 2, {"cannot be read as a bag", "rar!"});
}

TEST_F(Bag, MessagesCutShortAreOneClearLine) {
#ifdef EPILINE_SANITIZED
  constexpr std::size_t kShortest = 1;  // to write an empty message, the library copies nothing from a null pointer
#else
  constexpr std::size_t kShortest = 0;
#endif
  const auto only = [&](const RawMessage& image, const RawMessage& imu) {
    rosbag::Bag to(bag.string(), rosbag::bagmode::Write);
    to.write("/image", ros_time(100'000'000'000), image);
    to.write("/imu", ros_time(100'000'000'000), imu);
  };
  const double still[6] = {0, 0, 0, 0, 0, 9.81};
  const RawMessage imu = imu_message(100'000'000'000, still);
  const cv::Mat pixels(480, 752, CV_8U, cv::Scalar(128));
  const RawMessage image = image_message(100'000'000'000, pixels, "mono8");
  for (const std::size_t left : {kShortest, std::size_t{3}, std::size_t{20}, imu.bytes.size() - 1}) {
    RawMessage cut = imu;
    cut.bytes.resize(left);
    only(image, cut);
    expect_one_line(replay(), 2, {"message 1 of /imu ends after " + std::to_string(left) + " bytes"});
  }
  for (const std::size_t left : {kShortest, std::size_t{10}, std::size_t{30}, image.bytes.size() - 1}) {
    RawMessage cut = image;
    cut.bytes.resize(left);
    only(cut, imu);
    expect_one_line(replay(), 2, {"message 1 of /image ends after " + std::to_string(left) + " bytes"});
  }
  RawMessage liar = image;  // 2^32 - 1 rows in the same data
  const std::size_t rows = 4 + 4 + 4 + 4 + 5;
  for (std::size_t i = 0; i < 4; ++i) liar.bytes[rows + i] = 0xff;
  only(liar, imu);
  expect_one_line(replay(), 2, {"/image ends"});
  only(image_message(100'000'000'000, pixels, "bayer_rggb8"), imu);
  expect_one_line(replay(), 2, {"bayer_rggb8", "mono8"});
  only(image_message(100'000'000'000, cv::Mat(48, 75, CV_8U, cv::Scalar(1)), "mono8"), imu);
  expect_one_line(replay(), 2, {"image 1 of /image has 75x48 pixels", "as in the calibration"});
}

}  // namespace
}  // namespace epiline
#endif
