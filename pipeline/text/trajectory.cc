#include "pipeline/text/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "pipeline/text/table.h"

namespace epiline {

namespace {

Vec3 vec3(const double* v) { return {v[0], v[1], v[2]}; }

bool comma_in_first_line(const std::string& text) {
  LineReader lines(text);
  std::string_view line;
  return lines.next(line) && line.find_first_of(",;") != std::string_view::npos;
}

/// Whether the names of the columns, above the first number, say where w of the quaternion stands: `qw`, `q_RS_w []`.
std::optional<bool> w_is_first(std::string_view text) {
  for (std::string_view line; !text.empty();) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.substr(0, 1) != "#" && !is_header(line)) break;
    std::string order;
    for (std::string_view name; take_field(line, name);) {
      name = name.substr(0, name.find('['));
      while (!name.empty() && name[0] == '#') name.remove_prefix(1);
      if (name.size() >= 2 && (name[0] == 'q' || name[0] == 'Q')) order += name.back();
    }
    if (order == "wxyz" || order == "xyzw") return order[0] == 'w';
  }
  return std::nullopt;
}

bool finite(const double* values, std::size_t count) {
  return std::all_of(values, values + count, [](double v) { return std::isfinite(v); });
}

/// Takes the rows over in the file's order, good ones only.
Trajectory from_table(const NumberTable& table, bool w_first) {
  Trajectory t;
  t.notes = table.notes;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double* row = table.row(i);
    const double* q = row + 3;
    const Eigen::Quaterniond q_WB =
        w_first ? Eigen::Quaterniond(q[0], q[1], q[2], q[3]) : Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
    if (!finite(row + 7, table.columns - 7)) {
      ++t.not_finite;
      continue;
    }
    if (!add_pose({HostStamp{table.time_ns[i]}, vec3(row), q_WB}, t)) continue;
    if (table.columns >= 10) t.v_WB_m_s.push_back(vec3(row + 7));
    if (table.columns >= 16) {
      t.gyroscope_bias_rad_s.push_back(vec3(row + 10));
      t.accelerometer_bias_m_s2.push_back(vec3(row + 13));
    }
  }
  return t;
}

}  // namespace

bool add_pose(const TimedPose& pose, Trajectory& t) {
  if (!pose.p_WB.allFinite() || !pose.q_WB.coeffs().allFinite() || pose.q_WB.norm() < 0.5) {
    ++t.not_finite;
    return false;
  }
  if (!t.poses.empty() && pose.stamp <= t.poses.back().stamp) {
    ++t.out_of_order;
    return false;
  }
  t.poses.push_back({pose.stamp, pose.p_WB, pose.q_WB.normalized()});
  const double norm_error = std::abs(pose.q_WB.norm() - 1);
  if (norm_error > t.worst_norm_error) {
    t.worst_norm_error = norm_error;
    t.worst_norm_at = pose.stamp;
  }
  return true;
}

Result<Trajectory> read_trajectory(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text) return text.error();
  const bool asl = comma_in_first_line(*text);
  const auto table = asl ? parse_table(*text, path.string(), TimeColumn::kSensor, {8, 11, 17}, "ground truth pose")
                         : parse_table(*text, path.string(), TimeColumn::kSeconds, {8}, "pose");
  if (!table) return table.error();
  Trajectory trajectory = from_table(*table, w_is_first(*text).value_or(asl));
  if (trajectory.poses.empty()) {
    return Error{ErrorKind::kUsage, path.string(), 0, "no pose", "a TUM trajectory or an ASL ground truth"};
  }
  return trajectory;
}

std::string tum_text(const Trajectory& trajectory) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  std::string text;
  for (const TimedPose& pose : trajectory.poses) {
    const std::int64_t ns = pose.stamp.ns;
    const Vec3& p = pose.p_WB;
    const Eigen::Quaterniond& q = pose.q_WB;
    text +=
        fmt::format("{}{}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", ns < 0 ? "-" : "",
                    std::abs(ns / kSecond), std::abs(ns % kSecond), p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

bool interpolate(const Trajectory& trajectory, HostStamp stamp, Span max_gap, TimedPose& pose, std::size_t& hint) {
  const auto& poses = trajectory.poses;
  if (poses.empty() || stamp < poses.front().stamp || stamp > poses.back().stamp) return false;
  if (hint >= poses.size() || poses[hint].stamp > stamp) hint = 0;
  const auto after = std::upper_bound(poses.begin() + static_cast<std::ptrdiff_t>(hint), poses.end(), stamp,
                                      [](HostStamp t, const TimedPose& p) { return t < p.stamp; });
  hint = static_cast<std::size_t>(after - poses.begin()) - 1;
  const TimedPose& a = poses[hint];
  if (a.stamp == stamp) {
    pose = a;
    return true;
  }
  const TimedPose& b = *after;
  const Span gap = b.stamp - a.stamp;
  if (gap > max_gap) return false;
  const double u = static_cast<double>((stamp - a.stamp).ns) / static_cast<double>(gap.ns);
  pose = {stamp, (1 - u) * a.p_WB + u * b.p_WB, a.q_WB.slerp(u, b.q_WB)};
  return true;
}

}  // namespace epiline
