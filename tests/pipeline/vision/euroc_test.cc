// The front end on a recorded flight (EuRoC MH_01, 100 images in motion): how long tracks live and how well they agree
// with one rigid motion. The bounds are loose: they catch a broken tracker, not a slightly worse one; the figures are
// in docs/developers/vision.md.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "pipeline/config/calibration.h"
#include "pipeline/vision/tracker.h"

namespace epiline {
namespace {

constexpr int kImages = 100;
const Vec3 kGyroscopeBias(-0.003, 0.021, 0.079);  // rad/s, of this recording

std::filesystem::path flight() {
  const char* data = std::getenv("EPILINE_DATA");
  const std::filesystem::path root = std::filesystem::path(__FILE__).parent_path() / "../../..";
  return (data ? std::filesystem::path(data) : root / "../shared/data") / "euroc_MH_01/mav0";
}

std::vector<std::vector<std::string>> read_rows(const std::filesystem::path& file, std::size_t limit) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream in(file);
  for (std::string line; rows.size() < limit && std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::stringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) {
      cell.erase(cell.find_last_not_of(" \r") + 1);
      rows.back().push_back(cell);
    }
  }
  return rows;
}

struct Gyro {
  std::int64_t ns;
  Vec3 rate;
};

/// R_B0B1 from the readings between two stamps, bias removed, rates taken as constant from reading to reading.
Mat3 integrate(const std::vector<Gyro>& gyro, std::int64_t from, std::int64_t to) {
  Mat3 R = Mat3::Identity();
  for (std::size_t i = 0; i + 1 < gyro.size(); ++i) {
    const double s = 1e-9 * static_cast<double>(std::min(to, gyro[i + 1].ns) - std::max(from, gyro[i].ns));
    if (s <= 0) continue;
    const Vec3 turn = s * (0.5 * (gyro[i].rate + gyro[i + 1].rate) - kGyroscopeBias);
    R = R * Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  return R;
}

struct Match {
  Vec3 before, now;
};

/// Sampson distance in the normalised image plane.
double sampson(const Mat3& E, const Match& m) {
  const Vec3 a = m.before / m.before.z(), b = m.now / m.now.z();
  return b.dot(E * a) / std::sqrt((E * a).head<2>().squaredNorm() + (E.transpose() * b).head<2>().squaredNorm());
}

struct RelativePose {
  Mat3 R;
  Vec3 t;
  Mat3 essential() const {
    Mat3 S;
    S << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
    return S * R;
  }
  RelativePose moved(const Eigen::Matrix<double, 5, 1>& d) const {
    const Vec3 u = t.unitOrthogonal(), w = t.cross(u);
    const Vec3 turn = d.head<3>();
    const Mat3 D =
        turn.norm() > 0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() : Mat3(Mat3::Identity());
    return {D * R, (t + d[3] * u + d[4] * w).normalized()};
  }
};

/// Robust fit of a relative pose to the matches; its residuals are the tracker's error, not the ground truth's.
RelativePose polish(RelativePose pose, const std::vector<Match>& matches, double focal) {
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  for (int iteration = 0; iteration < 8; ++iteration) {
    Eigen::Matrix<double, 5, 5> H = 1e-3 * Eigen::Matrix<double, 5, 5>::Identity();
    Vec5 g = Vec5::Zero();
    Mat3 E[5];
    for (int k = 0; k < 5; ++k) E[k] = pose.moved(1e-5 * Vec5::Unit(k)).essential();
    for (const Match& m : matches) {
      const double r = focal * sampson(pose.essential(), m);
      Vec5 J;
      for (int k = 0; k < 5; ++k) J[k] = (focal * sampson(E[k], m) - r) / 1e-5;
      const double weight = 1 / (1 + r * r / 0.25);
      H += weight * J * J.transpose();
      g += weight * r * J;
    }
    pose = pose.moved(-H.ldlt().solve(g));
  }
  return pose;
}

class Euroc : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(flight() / "cam0/data.csv")) GTEST_SKIP() << "no recording at " << flight();
    const auto calibration = read_camera_calibration(flight() / "cam0/sensor.yaml", "cam0");
    ASSERT_TRUE(calibration) << calibration.error().text();
    camera_ = Camera((*calibration).parameters);
    R_BC_ = (*calibration).R_BC;
    for (const auto& row : read_rows(flight() / "imu0/data.csv", 2000)) {
      gyro_.push_back({std::stoll(row[0]), Vec3(std::stod(row[1]), std::stod(row[2]), std::stod(row[3]))});
    }
    track();
  }

  void track() {
    Tracker tracker(camera_, {});
    auto out = std::make_unique<TrackedFrame>();
    cv::Mat image, previous;
    std::int64_t before = 0;
    for (const auto& row : read_rows(flight() / "cam0/data.csv", kImages)) {
      std::swap(image, previous);
      image = cv::imread(flight() / "cam0/data" / row[1], cv::IMREAD_GRAYSCALE);
      ASSERT_FALSE(image.empty()) << row[1];
      const std::int64_t ns = std::stoll(row[0]);
      const Mat3 R_BB0 = before ? Mat3(integrate(gyro_, before, ns).transpose()) : Mat3(Mat3::Identity());
      turns_.push_back(R_BC_.transpose() * R_BB0 * R_BC_);
      tracker.step({HostStamp{ns}, 0, image.data, image.cols, image.rows, static_cast<int>(image.step)}, turns_.back(),
                   *out);
      frames_.emplace_back();
      for (const TrackedFeature& f : out->features)
        frames_.back()[f.id] = Vec3(f.bearing[0], f.bearing[1], f.bearing[2]);
      before = ns;
    }
    stats_ = tracker.stats();
  }

  /// Absolute Sampson distances (px) of all tracks over `span` images, each pair of images under its own polished pose.
  std::vector<double> residuals(std::size_t span) const {
    std::vector<double> all;
    for (std::size_t i = 0; i + span < frames_.size(); i += 3) {
      std::vector<Match> matches;
      for (const auto& [id, now] : frames_[i + span]) {
        if (const auto old = frames_[i].find(id); old != frames_[i].end()) matches.push_back({old->second, now});
      }
      Mat3 R = Mat3::Identity();
      for (std::size_t k = i + 1; k <= i + span; ++k) R = turns_[k] * R;
      // The direction of travel is unknown here: the best of a few starts.
      std::vector<double> best;
      double least = 1e300;
      for (const Vec3& start : {Vec3(1, 0, 0.1), Vec3(0, 1, 0.1), Vec3(0.1, 0, 1)}) {
        const Mat3 E = polish({R, start.normalized()}, matches, camera_.focal_px()).essential();
        std::vector<double> r;
        for (const Match& m : matches) r.push_back(std::abs(camera_.focal_px() * sampson(E, m)));
        const double cost =
            std::accumulate(r.begin(), r.end(), 0.0, [](double s, double v) { return s + std::min(v, 1.0); });
        if (cost < least) least = cost, best = r;
      }
      all.insert(all.end(), best.begin(), best.end());
    }
    std::sort(all.begin(), all.end());
    return all;
  }

  Camera camera_;
  Mat3 R_BC_ = Mat3::Identity();
  std::vector<Gyro> gyro_;
  std::vector<Mat3> turns_;
  std::vector<std::map<std::uint32_t, Vec3>> frames_;
  TrackerStats stats_;
};

TEST_F(Euroc, TracksSurvive) {
  const double survival = static_cast<double>(stats_.tracked) / static_cast<double>(stats_.tried);
  std::printf("survival %.4f, rejected near %.4f, wide %.4f\n", survival,
              static_cast<double>(stats_.rejected_near) / static_cast<double>(stats_.tried),
              static_cast<double>(stats_.rejected_wide) / static_cast<double>(stats_.tried));
  EXPECT_GT(survival, 0.93);
  EXPECT_EQ(stats_.gaps, 0u);
  for (std::size_t i = 0; i < frames_.size(); ++i) EXPECT_GT(frames_[i].size(), 140u) << "image " << i;
}

TEST_F(Euroc, TracksAgreeWithOneRigidMotion) {
  struct Bound {
    std::size_t span;
    double median_px, p90_px;
  };
  for (const Bound& bound : {Bound{1, 0.09, 0.34}, {5, 0.24, 0.90}, {10, 0.33, 1.32}, {20, 0.49, 2.0}}) {
    const std::vector<double> r = residuals(bound.span);
    ASSERT_GT(r.size(), 500u);
    const double median = r[r.size() / 2], p90 = r[r.size() * 9 / 10];
    std::printf("span %zu: %zu pairs, median %.3f px, p90 %.3f px\n", bound.span, r.size(), median, p90);
    EXPECT_LT(median, bound.median_px) << "span " << bound.span;
    EXPECT_LT(p90, bound.p90_px) << "span " << bound.span;
  }
}

}  // namespace
}  // namespace epiline
