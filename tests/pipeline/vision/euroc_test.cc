// The front end on a recorded flight (EuRoC MH_01, 100 images in motion): how long tracks live and how well they agree
// with one rigid motion. The bounds are loose: they catch a broken tracker, not a slightly worse one; the figures are
// in docs/developers/vision.md.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "pipeline/config/calibration.h"
#include "pipeline/stages/gyro_rotation.h"
#include "pipeline/text/table.h"
#include "pipeline/vision/tracker.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

constexpr std::size_t kImages = 100;
const Vec3 kGyroscopeBias(-0.003, 0.021, 0.079);  // rad/s, of this recording

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
    const std::filesystem::path flight = test::recorded_data("euroc_MH_01/mav0");
    if (!std::filesystem::exists(flight)) GTEST_SKIP() << "no recording at " << flight;
    const auto calibration = read_camera_calibration(flight / "cam0/sensor.yaml", "cam0");
    ASSERT_TRUE(calibration) << calibration.error().text();
    camera_ = Camera(calibration->parameters);
    R_BC_ = calibration->R_BC;
    const auto imu =
        parse_table(*read_text(find_table(flight / "imu0", "data.csv")), "imu0", TimeColumn::kImu, {7}, "");
    ASSERT_TRUE(imu) << imu.error().text();
    const auto images = read_text(find_table(flight / "cam0", "data.csv"));
    ASSERT_TRUE(images) << images.error().text();
    track(flight / "cam0/data", *images, *imu);
  }

  void track(const std::filesystem::path& folder, const std::string& list, const NumberTable& imu) {
    Tracker tracker(camera_, {});
    auto out = std::make_unique<TrackedFrame>();
    auto gyro = std::make_unique<GyroRotation>();
    cv::Mat image, previous;
    std::size_t next = 0;
    std::int64_t before_ns = 0, ns = 0;
    LineReader lines(list);
    for (std::string_view line, time, name; frames_.size() < kImages && lines.next(line); before_ns = ns) {
      ASSERT_TRUE(take_field(line, time) && parse_number(time, ns) && take_field(line, name));
      std::swap(image, previous);
      image = cv::imread(folder / name, cv::IMREAD_GRAYSCALE);
      ASSERT_FALSE(image.empty()) << name;
      for (; next < imu.rows() && (next == 0 || imu.time_ns[next - 1] < ns); ++next) {
        const double* const row = imu.row(next);
        gyro->add({HostStamp{imu.time_ns[next]}, {row[0], row[1], row[2]}, {row[3], row[4], row[5]}});
      }
      const Mat3 R_BB0 =
          before_ns == 0 ? Mat3(Mat3::Identity()) : Mat3(gyro->between({before_ns}, {ns}, kGyroscopeBias).transpose());
      turns_.push_back(R_BC_.transpose() * R_BB0 * R_BC_);
      tracker.step({HostStamp{ns}, 0, image.data, image.cols, image.rows, static_cast<int>(image.step)}, turns_.back(),
                   *out);
      frames_.emplace_back();
      for (const TrackedFeature& f : out->features) frames_.back()[f.id] = Vec3(f.bearing.data());
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
