#include "estimator/initialise/starter.h"

#include <array>
#include <cmath>

#include "estimator/factors/prior.h"
#include "estimator/initialise/stationary_start.h"

namespace epiline {

namespace {
constexpr double kScaleNearby = 0.5;  // relative: so near a guess must be for the window to find a measured scale
}

struct Starter::Memory {
  explicit Memory(InstructionSet set) : points(set) {}
  std::array<Preintegration, kStartFrames> interval;
  std::array<StartTrack, kStartTracks> track;
  std::size_t tracks = 0;
  PointElimination points;
  StartMemory last;
  StartGuess guess;
};

Starter::Starter(InstructionSet set) : memory_(new Memory(set)) {}
Starter::~Starter() = default;
const StartGuess& Starter::guess() const { return memory_->guess; }
void Starter::forget() { memory_->last = {}; }

void Starter::collect_tracks(const Window& w) {
  Memory& m = *memory_;
  m.tracks = 0;
  // long tracks first: they are the cleanest, and room is limited
  for (int fewest = w.size() / 2 + 1, most = w.size(); most >= 2; most = fewest - 1, fewest = 2)
    for (int i = 0; i < w.track_count() && m.tracks < m.track.size(); ++i) {
      const TrackRecord& t = w.track(i);
      const int views = w.views(t);
      if (views < fewest || views > most || t.camera > 0) continue;
      StartTrack& s = m.track[m.tracks++];
      s.count = 0;
      for (int k = 0; k < w.size(); ++k) {
        if (!w.seen(t, k)) continue;
        s.frame[static_cast<std::size_t>(s.count)] = static_cast<std::uint8_t>(k);
        s.f_C[static_cast<std::size_t>(s.count++)] = bearing_of(w.view(t, k));
      }
    }
}

namespace {
/// What is known before anything was seen: nothing of attitude and velocity, a little of the biases.
void set_weak_prior(Window& w, const StarterSettings& s) {
  InitialState sigmas;
  sigmas.sigma_tilt = 1;
  sigmas.sigma_v = 10;
  sigmas.sigma_b_a = s.b_a_sigma;
  sigmas.sigma_b_g = s.b_g_sigma;
  set_initial_prior(w, sigmas, s.calibration_sigmas);
  w.prior.x0[0].b_a.setZero();
  w.prior.x0[0].b_g = s.b_g_reference;
}
}  // namespace

std::optional<StartRefusal> Starter::start_moving(Window& w, const StarterSettings& s) {
  Memory& m = *memory_;
  if (w.size() < 2) return StartRefusal::kTooFewFrames;
  collect_tracks(w);
  for (int k = 1; k < w.size(); ++k) m.interval[static_cast<std::size_t>(k - 1)] = w.at(k).imu;
  StartProblem problem;
  problem.frames = w.size();
  for (int k = 0; k < w.size(); ++k) problem.id[static_cast<std::size_t>(k)] = w.at(k).id;
  problem.interval = m.interval.data();
  problem.tracks = {m.track.data(), m.tracks};
  problem.R_BC = w.calibration.R_BC;
  problem.p_BC = w.calibration.p_BC;
  problem.sigma_rad = s.pixel_sigma / s.focal_px;
  problem.b_g_ref = s.b_g_reference;
  problem.b_g_sigma = s.b_g_sigma;
  problem.b_a_sigma = s.b_a_sigma;
  problem.v_0_ref = s.v_B;
  problem.v_0_information = s.v_B_information;
  StartLimits limits;
  limits.noise_least = s.least_pixel_sigma / s.pixel_sigma;
  limits.noise_most = s.most_pixel_sigma / s.pixel_sigma;
  if (s.depth_is_measured) limits.sigma_scale = kScaleNearby;
  if (const auto refusal = solve_moving_start(problem, limits, m.points, m.last, m.guess)) return refusal;
  const auto newest = static_cast<std::size_t>(w.size() - 1);
  Mat3 R_WB0 = levelled(-m.guess.state.g_0.normalized());
  const Mat3 R_WB = R_WB0 * m.guess.R[newest];
  const double turn = s.R_WB ? heading_from(R_WB, *s.R_WB) : -std::atan2(R_WB(1, 0), R_WB(0, 0));
  R_WB0 = so3_exp(Vec3(0, 0, turn)) * R_WB0;
  const Vec3 p_WB0 = s.p_WB - R_WB0 * m.guess.p[newest];
  for (int k = 0; k < w.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    NavState& x = w.at(k).x;
    x.p = p_WB0 + R_WB0 * m.guess.p[i];
    x.R = so3_normalised(R_WB0 * m.guess.R[i]);
    x.v = R_WB0 * m.guess.v[i];
    x.b_a = m.guess.state.b_a;
    x.b_g = m.guess.state.b_g;
  }
  set_weak_prior(w, s);
  return std::nullopt;
}

}  // namespace epiline
