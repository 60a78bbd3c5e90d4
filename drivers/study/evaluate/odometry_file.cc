#include "drivers/study/evaluate/odometry_file.h"

#include <fmt/format.h>

#include <iterator>
#include <utility>

#include "pipeline/text/table.h"

namespace epiline {

namespace {

constexpr const char* kHeader =
    "#time ns,p_x m,p_y,p_z,q_w,q_x,q_y,q_z,v_x m/s,v_y,v_z,segment,P_xx m^2,P_xy,P_xz,P_yy,P_yz,P_zz,yaw rad^2,"
    "tilt_xx rad^2,tilt_xy,tilt_yy,V_xx m^2/s^2,V_xy,V_xz,V_yy,V_yz,V_zz\n";
constexpr std::size_t kColumns = 28;

void append(double value, std::string& text) { fmt::format_to(std::back_inserter(text), ",{:.9g}", value); }

/// The upper triangle, row by row.
template <class Matrix>
void append_upper(const Matrix& m, std::string& text) {
  for (Eigen::Index i = 0; i < m.rows(); ++i)
    for (Eigen::Index j = i; j < m.cols(); ++j) append(m(i, j), text);
}

template <class Matrix>
Matrix from_upper(const double* values) {
  Matrix m;
  for (Eigen::Index i = 0; i < m.rows(); ++i)
    for (Eigen::Index j = i; j < m.cols(); ++j) m(i, j) = m(j, i) = *values++;
  return m;
}

void append_row(const TimedPose& pose, const Vec3& v_WB_m_s, const PoseUncertainty& u, std::string& text) {
  const Eigen::Quaterniond& q = pose.q_WB;
  fmt::format_to(std::back_inserter(text), "{}", pose.stamp.ns);
  for (const double x : {pose.p_WB.x(), pose.p_WB.y(), pose.p_WB.z(), q.w(), q.x(), q.y(), q.z(), v_WB_m_s.x(),
                         v_WB_m_s.y(), v_WB_m_s.z()})
    append(x, text);
  fmt::format_to(std::back_inserter(text), ",{}", u.segment);
  append_upper(u.position, text);
  append(u.yaw_variance, text);
  append_upper(u.tilt, text);
  append_upper(u.velocity, text);
  text += '\n';
}

PoseUncertainty uncertainty_from(const double* values) {
  const bool counts = values[0] >= 0 && values[0] < 4294967296.0;
  return {from_upper<Mat3>(values + 1), values[7], counts ? static_cast<std::uint32_t>(values[0]) : 0,
          from_upper<Mat3>(values + 11), from_upper<Eigen::Matrix2d>(values + 8)};
}

/// Rows with a bad pose are left out, and counted.
ClaimedTrajectory from_rows(const NumberTable& table) {
  ClaimedTrajectory odometry;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double* x = table.row(i);
    const TimedPose pose{HostStamp{table.time_ns[i]}, Vec3(x[0], x[1], x[2]),
                         Eigen::Quaterniond(x[3], x[4], x[5], x[6])};
    const PoseUncertainty u = uncertainty_from(x + 10);
    if (u.position.isZero(0)) {
      odometry.claims.origins.push_back({u.segment, pose});
    } else if (add_pose(pose, odometry.trajectory)) {
      odometry.trajectory.v_WB_m_s.emplace_back(x[7], x[8], x[9]);
      odometry.claims.poses.push_back(u);
    }
  }
  return odometry;
}

}  // namespace

std::string odometry_text(const ClaimedTrajectory& odometry) {
  std::string text = kHeader;
  for (const SegmentOrigin& origin : odometry.claims.origins) {
    PoseUncertainty none;
    none.segment = origin.segment;
    append_row(origin.pose, Vec3::Zero(), none, text);
  }
  for (std::size_t i = 0; i < odometry.trajectory.poses.size(); ++i)
    append_row(odometry.trajectory.poses[i], odometry.trajectory.v_WB_m_s[i], odometry.claims.poses[i], text);
  return text;
}

Result<ClaimedTrajectory> read_odometry(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text) return text.error();
  if (text->rfind(kHeader, 0) != 0) {
    auto trajectory = read_trajectory(path);
    if (!trajectory) return trajectory.error();
    return ClaimedTrajectory{std::move(*trajectory), {}};
  }
  const auto table = parse_table(*text, path.string(), TimeColumn::kNanoseconds, {kColumns}, "odometry");
  if (!table) return table.error();
  ClaimedTrajectory odometry = from_rows(*table);
  if (odometry.trajectory.poses.empty())
    return Error{ErrorKind::kUsage, path.string(), 0, "no pose", "the odometry.csv of a replay"};
  return odometry;
}

}  // namespace epiline
