// The table of flights, and what is asked of each.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <initializer_list>
#include <utility>

#include "platform/log/suspicion_names.h"
#include "tests/estimator/estimator/life.h"
#include "tests/estimator/made_up_time.h"

namespace epiline::test {

namespace {

constexpr double kFree_s = 3;  // after the first pose of each reset
constexpr double kBack_s = 5;  // after what disturbed it
// The truth is exact; this is what no user asks for.
constexpr double kFloor_m = 0.005, kFloor_m_s = 0.01, kFloor_rad = 0.002;

template <int n>
double largest_sigma(const Eigen::Matrix<double, n, n>& covariance) {
  return std::sqrt(std::max(0., covariance.template selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
}
double yaw(const Mat3& R) { return std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)); }
Mat3 rotation(const std::array<double, 4>& q) { return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix(); }

bool is_one_of(Suspect s, std::initializer_list<Suspect> list) {
  return std::find(list.begin(), list.end(), s) != list.end();
}

/// Whether a word names what is wrong in this row. That images and IMU contradict each other is true of any number that
/// is wrong, and of a lift; of traffic and own parts it is not, since they say nothing of the numbers.
bool names_the_guilty(const Row& row, Suspect s) {
  using enum Suspect;
  const bool contradiction = is_one_of(s, {kMisfit, kImuMisfit}),
             noise = is_one_of(s, {kGyroscopeNoise, kAccelerometerNoise});
  switch (row[kNumber]) {
    case kFocalOff:
      if (contradiction || is_one_of(s, {kFocalLength, kScale})) return true;
      break;
    case kLeverOff:
      if (contradiction || s == kPlace) return true;
      break;
    case kTurned:
      if (contradiction || is_one_of(s, {kRotation, kUnrelated})) return true;
      break;
    case kStampsOff:
      if (contradiction || s == kTimeOffset) return true;
      break;
    case kForceScale:
      if (contradiction || s == kAccelerometerScale) return true;
      break;
    case kRateScale:
      if (contradiction || is_one_of(s, {kGyroscopeScale, kScale})) return true;
      break;
    case kTenfold:
      if (noise) return true;
      break;
    case kTenth:
      if (contradiction || noise) return true;
      break;
    default:
      break;
  }
  if (row[kView] == kLift && contradiction) return true;
  if (row[kVibration] != kSmooth && (noise || s == kImuMisfit)) return true;
  return row[kWarming] > 1 && (s == kImuMisfit || s == kGyroscopeNoise);
}

/// What stays wrong may be said with each pose: then a pose is enough, be it `degraded`.
bool has_lasting_fault(const Row& row) {
  return row[kNumber] != kRight || row[kVibration] != kSmooth || row[kWarming] > 1;
}

void list_words(const Row& row, const Suspicions& suspicions, LifeVerdict& verdict) {
  for (std::size_t i = 0; i < suspicions.size(); ++i) {
    const Suspicion& s = suspicions[i];
    if (s.severity < Severity::kSuspect) continue;
    std::string& list = names_the_guilty(row, static_cast<Suspect>(i)) ? verdict.guilty : verdict.innocent;
    list += fmt::format("{}{}{} {:.3g}", list.empty() ? "" : ", ", kSuspectNames[i],
                        s.severity == Severity::kGross ? " (gross)" : "", s.figure);
  }
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

LifeError worst_error(const LifeRig& rig) {
  const Odometry& o = rig.estimator().odometry();
  const WorldOrigin& origin = rig.estimator().stats().origins[o.reset_counter % 8];
  if (!origin.known || origin.reset_counter != o.reset_counter) return {};
  const double t = (o.stamp - at(0)).seconds(), t0 = (origin.stamp - at(0)).seconds();
  const LifeMotion& truth = rig.motion;
  const Mat3 R = rotation(o.q_WB), R_true = truth.R(t);
  const Mat3 turn = so3_exp(Vec3(0, 0, yaw(rotation(origin.q_WB) * truth.R(t0).transpose())));
  const Eigen::Map<const Eigen::Matrix<double, 16, 16, Eigen::RowMajor>> P(o.covariance.data());
  const auto ratio = [](double error, double sigma, double floor, char what) {
    return LifeError{error / (sigma + floor), error, what};
  };
  const Vec3 moved = Vec3(o.p_WB_m.data()) - Vec3(origin.p_WB_m.data()) - turn * (truth.p(t) - truth.p(t0));
  const Vec3 lifted(0, 0, truth.lifted(t) - truth.lifted(t0)), lifting(0, 0, truth.lifting(t));
  const Vec3 speed = R.transpose() * Vec3(o.v_WB_m_s.data()) - R_true.transpose() * truth.v(t);
  // in a lift both are right: what is seen, and the world outside
  const LifeError p =
      ratio(std::min(moved.norm(), (moved - lifted).norm()), largest_sigma<3>(P.block<3, 3>(0, 0)), kFloor_m, 'p');
  const LifeError v = ratio(std::min(speed.norm(), (speed - R_true.transpose() * lifting).norm()),
                            largest_sigma<3>(P.block<3, 3>(6, 6)), kFloor_m_s, 'v');
  const Mat3 attitude = R * P.block<3, 3>(3, 3) * R.transpose();
  const LifeError y = ratio(std::abs(yaw(R * (turn * R_true).transpose())), std::sqrt(attitude(2, 2)), kFloor_rad, 'y');
  const Vec3 up = R.transpose() * Vec3::UnitZ(), up_true = R_true.transpose() * Vec3::UnitZ();
  const LifeError tilt = ratio(std::asin(std::min(1., up.cross(up_true).norm())),
                               largest_sigma<2>(attitude.topLeftCorner<2, 2>()), kFloor_rad, 't');
  return std::max({p, v, y, tilt}, [](const LifeError& a, const LifeError& b) { return a.sigmas < b.sigmas; });
}

LifeVerdict fly(const Row& row, unsigned seed) {
  const double begin = cpu_seconds();
  LifeRig rig(row, seed);
  LifeVerdict verdict;
  const bool lasting = has_lasting_fault(row);
  std::vector<bool> back(rig.causes().size(), false);
  double first_of_start = 0;
  std::int64_t start = -1;
  int frames = 0, tracking = 0;
  rig.run_to(rig.ends_at(), [&](const StepResult& result) {
    const Odometry& o = rig.estimator().odometry();
    const double t = rig.now();
    const bool has_pose = result.has_pose && o.health.state != HealthState::kLost;
    const bool tracks = has_pose && o.health.state == HealthState::kTracking;
    ++frames;
    tracking += tracks;
    bool excused = false;
    for (std::size_t i = 0; i < back.size(); ++i) {
      const auto& cause = rig.causes()[i];
      excused |= t >= cause.from && t < cause.to + kBack_s;
      if (t >= cause.to && t <= cause.to + kBack_s) back[i] = back[i] || tracks || (lasting && has_pose);
    }
    if (!has_pose && !excused && verdict.lost_at_s < 0) verdict.lost_at_s = t;
    if (!result.has_pose) return;
    if (verdict.first_pose_s < 0) verdict.first_pose_s = t;
    if (o.reset_counter != start) start = o.reset_counter, first_of_start = t;
    if (!tracks || t < first_of_start + kFree_s) return;
    const LifeError e = worst_error(rig);
    ++verdict.judged;
    verdict.wrong += !(e.sigmas <= LifeVerdict::kSigmas);
    if (e.sigmas > verdict.worst)
      verdict.worst = e.sigmas, verdict.what = e.what, verdict.worst_error = e.error, verdict.worst_at_s = t;
  });
  for (std::size_t i = back.size(); i-- > 0;)
    if (!back[i]) verdict.not_back_after_s = rig.causes()[i].to;
  verdict.tracking_share = static_cast<double>(tracking) / frames;
  verdict.resets = rig.estimator().stats().resets;
  list_words(row, rig.estimator().stats().suspicions, verdict);
  verdict.cpu_s = cpu_seconds() - begin;
  return verdict;
}

std::string to_string(const LifeVerdict& v) {
  std::string s = fmt::format(
      "{:.1f} sigma of {} ({:.3g}) at {:.2f} s, wrong {} of {}, tracking {:.0f} %, first pose {:.2f} s, resets {}",
      v.worst, v.what, v.worst_error, v.worst_at_s, v.wrong, v.judged, 100 * v.tracking_share, v.first_pose_s,
      v.resets);
  if (v.lost_at_s >= 0) s += fmt::format(", lost at {:.2f} s", v.lost_at_s);
  if (v.is_mute()) s += ", never tracking";
  if (v.not_back_after_s >= 0) s += fmt::format(", not back 5 s after {:.2f} s", v.not_back_after_s);
  if (!v.innocent.empty()) s += ", accuses " + v.innocent;
  if (!v.guilty.empty()) s += ", names " + v.guilty;
  return s;
}

Row smallest(Row row, unsigned seed, const LifeVerdict& verdict) {
  for (std::uint8_t& value : row) {
    if (value == 0) continue;
    const std::uint8_t kept = std::exchange(value, 0);
    if (!fly(row, seed).fails_like(verdict)) value = kept;
  }
  return row;
}

namespace {

/// What cannot be flown. No cabin is so large that a fast flight has room in it. The accelerations of a hover, 0.06
/// m/s^2, do not tell from the biases how large the world is, so that none can begin there. And what begins while a
/// lorry fills the view may as well take the lorry for the world: no accelerometer knows a steady speed.
bool exclude(int switch_a, int a, int switch_b, int b) {
  if (switch_a > switch_b) return exclude(switch_b, b, switch_a, a);
  if (switch_a == kPath)
    return (a >= kDash && switch_b == kView && b == kLift) || (a == kHover && switch_b == kWait && b == kInMotion);
  return switch_a == kWait && a == kInMotion && switch_b == kView && b == kLorry;
}

bool is_fault(int s) { return s >= kNumber && s <= kImages; }

class PairwiseTable {
 public:
  explicit PairwiseTable(unsigned seed) : random_(seed) {
    for (int a = 0; a < kSwitches; ++a)
      for (int i = 0; i < values(a); ++i)
        for (int b = a + 1; b < kSwitches; ++b)
          for (int j = 0; j < values(b); ++j)
            if (!exclude(a, i, b, j)) missing_.push_back({a, i, b, j});
  }
  std::vector<Row> rows() {
    constexpr int kCandidates = 30;
    std::vector<Row> all;
    while (!missing_.empty()) {
      Row best{};
      std::size_t most = 0;
      for (int n = 0; n < kCandidates; ++n) {
        const Row row = candidate();
        const auto gain = static_cast<std::size_t>(
            std::count_if(missing_.begin(), missing_.end(), [&](const Pair& pair) { return pair.is_in(row); }));
        if (gain > most) best = row, most = gain;
      }
      std::erase_if(missing_, [&](const Pair& pair) { return pair.is_in(best); });
      all.push_back(best);
    }
    return all;
  }

 private:
  struct Pair {
    int a, i, b, j;
    bool is_in(const Row& row) const {
      return row[static_cast<std::size_t>(a)] == i && row[static_cast<std::size_t>(b)] == j;
    }
  };
  static int values(int s) { return static_cast<int>(switch_names()[static_cast<std::size_t>(s)].values.size()); }
  std::size_t any(std::size_t below) { return random_() % below; }

  /// Begins with a pair that is missing; then each switch, in any order, as most missing pairs want it.
  Row candidate() {
    std::array<int, kSwitches> chosen;
    chosen.fill(-1);
    const Pair& first = missing_[any(missing_.size())];
    chosen[static_cast<std::size_t>(first.a)] = first.i;
    chosen[static_cast<std::size_t>(first.b)] = first.j;
    std::vector<int> others;
    for (int s = 0; s < kSwitches; ++s)
      if (s != first.a && s != first.b) others.push_back(s);
    for (std::size_t n = others.size(); n > 1; --n) std::swap(others[n - 1], others[any(n)]);
    for (const int s : others) chosen[static_cast<std::size_t>(s)] = best_value(s, chosen);
    Row row;
    std::copy(chosen.begin(), chosen.end(), row.begin());
    return row;
  }
  int best_value(int s, const std::array<int, kSwitches>& chosen) {
    constexpr int kMostWrong = 2;
    const bool enough = is_fault(s) && std::count_if(chosen.begin(), chosen.end(), [&](const int& value) {
                                         return is_fault(static_cast<int>(&value - chosen.data())) && value > 0;
                                       }) >= kMostWrong;
    const int count = values(s), from = static_cast<int>(any(static_cast<std::size_t>(count)));
    int best = -1, most = -1;
    for (int n = 0; n < count; ++n) {
      const int value = (from + n) % count;
      bool possible = value == 0 || !enough;
      for (int o = 0; o < kSwitches; ++o) {
        const int other = chosen[static_cast<std::size_t>(o)];
        possible &= other < 0 || !exclude(s, value, o, other);
      }
      if (!possible) continue;
      const auto gain = std::count_if(missing_.begin(), missing_.end(), [&](const Pair& pair) {
        return (pair.a == s && pair.i == value && chosen[static_cast<std::size_t>(pair.b)] == pair.j) ||
               (pair.b == s && pair.j == value && chosen[static_cast<std::size_t>(pair.a)] == pair.i);
      });
      if (gain > most) best = value, most = static_cast<int>(gain);
    }
    return best;
  }

  std::mt19937 random_;
  std::vector<Pair> missing_;
};

}  // namespace

std::vector<Row> pairwise_table(unsigned seed) { return PairwiseTable(seed).rows(); }

std::vector<Row> single_table() {
  std::vector<Row> all;
  const auto count = [](std::size_t s) { return static_cast<std::uint8_t>(switch_names()[s].values.size()); };
  for (std::uint8_t path = 0; path < count(kPath); ++path)
    for (std::uint8_t wait = 0; wait < count(kWait); ++wait) {
      if (exclude(kPath, path, kWait, wait)) continue;
      all.push_back({path, wait});
      for (std::uint8_t s = kBreak; s < kSwitches; ++s)
        for (std::uint8_t value = 1; value < count(s); ++value) {
          if (exclude(kPath, path, s, value) || exclude(kWait, wait, s, value)) continue;
          all.push_back({path, wait});
          all.back()[s] = value;
        }
    }
  return all;
}

}  // namespace epiline::test
