// The track factor against its residuals written down, their covariance in full, and what marginalisation
// takes over from the oldest views. Its gradient: gradient_test.cc. Derivations: docs/derivations/drift.md,
// docs/derivations/several_cameras.md, docs/derivations/marginalisation.md.
#include <gtest/gtest.h>

#include "estimator/factors/track.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/explicit_tracks.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

using Eigen::MatrixXd;

constexpr double kAlike = 1e9;  // degrees of freedom at which all weights are one

/// What the tracks are like.
struct Kind {
  const char* name;
  TrackNoiseModel noise;
  bool second;  ///< a second camera sees them as well
};
constexpr Kind kWhite{"white", TrackNoiseModel::kWhite, false}, kOne{"drift", TrackNoiseModel::kDrift, false},
    kTwo{"drift_of_two_cameras", TrackNoiseModel::kDrift, true};

class Tracks : public testing::TestWithParam<Kind> {
 protected:
  static VisualSettings settings(double student, bool rows = false) {
    VisualSettings s = smooth_settings();
    s.rows = rows;
    s.noise = GetParam().noise;
    s.drift_sigma = 0.2;
    s.drift_inflation = 1.5;
    s.student = student;
    if (s.noise == TrackNoiseModel::kWhite) s.cauchy = student == kAlike ? 1e3 : VisualSettings{}.cauchy;
    return s;
  }
  static SyntheticWindow make(SyntheticOptions options) {
    options.second = GetParam().second;
    SyntheticWindow s = make_window(options);
    Window& w = *s.window;
    // views of different ages, as solved frames between images make them; a second camera's come with theirs
    for (int i = 0; i < w.track_count() && !options.second; ++i)
      for (int k = 0; k < w.size(); ++k) w.view(w.track(i), k).age = static_cast<float>(3 + i % 5 + 2 * k + k % 2);
    return s;
  }
  static std::unique_ptr<VisualSystem> system_of(const Window& w, double student, bool rows = false) {
    TrackFactor factor(best_instruction_set());
    auto system = std::make_unique<VisualSystem>();
    factor.collect(w, settings(student, rows));
    factor.linearise(w, *system);
    EXPECT_NEAR(factor.cost(w), system->cost, 1e-9 * system->cost);
    return system;
  }
  /// What of the oldest views is kept.
  static MatrixXd kept_of(const Window& w, double student, bool rows = false) {
    TrackFactor factor(best_instruction_set());
    const auto added = std::make_unique<VisualSystem>();
    factor.collect(w, settings(student, rows));
    factor.marginalise_oldest(w, settings(student, rows), *added);
    return dense(*added, w.size() - 1);
  }
  /// One track of many views is in use; the second camera finds it in the third frame.
  static SyntheticWindow of_one_track(TrackRecord*& chosen) {
    SyntheticWindow s = make({.frames = 9, .tracks = 40, .pixel_noise = 0.3, .state_error = 1e-3});
    Window& w = *s.window;
    w.calibration.focal = 0.01;
    w.calibration.shape = -0.003;
    w.calibration.time_offset = 1e-3;
    for (int i = 0; i < w.track_count(); ++i) {
      TrackRecord& t = w.track(i);
      t.in_use = false;
      if (w.views(t) == w.size() && (!GetParam().second || t.second == t.mask)) chosen = &t;
    }
    chosen->in_use = true;
    chosen->second &= ~(w.bit(0) | w.bit(1));
    return s;
  }
};

class Drift : public Tracks {};

const auto name_of_kind = [](const testing::TestParamInfo<Kind>& kind) { return std::string(kind.param.name); };
INSTANTIATE_TEST_SUITE_P(Kinds, Tracks, testing::Values(kWhite, kOne, kTwo), name_of_kind);
INSTANTIATE_TEST_SUITE_P(Kinds, Drift, testing::Values(kOne, kTwo), name_of_kind);

/// The point that is eliminated is one of the unknowns there.
TEST_P(Tracks, AreWeighedByTheInverseOfTheViewsWholeCovariance) {
  TrackRecord* chosen = nullptr;
  SyntheticWindow s = of_one_track(chosen);
  Window& w = *s.window;
  ExplicitTrack written_down(w, *chosen);
  ASSERT_EQ(written_down.views(), GetParam().second ? 2 * w.size() - 2 : w.size());
  for (const double student : {4.0, kAlike}) {
    if (student != kAlike && GetParam().noise == TrackNoiseModel::kWhite)
      continue;  // each view has a weight of its own
    const auto expected = written_down.equations(settings(student));
    const auto system = system_of(w, student);
    EXPECT_LT(scaled_difference(dense(*system, w.size()), expected.H), 1e-5);
    EXPECT_LT(scaled_difference(dense_rhs(*system, w.size()), expected.b, expected.H), 1e-5);
    EXPECT_NEAR(system->cost, expected.cost, 1e-5 * system->cost);
  }
}

/// What frame 0's views add given the others is what the others lack: of a drift the same walk, seen from the second
/// view on. The second camera sees all tracks in all frames, or finds some of them later, or loses some. Of a rolling
/// shutter as well.
TEST_P(Tracks, AllInformationOfTheOldestViewsIsKeptAndNoneInvented) {
  for (const auto& [ragged, readout_s] : {std::pair{false, 0.}, {true, 0.}, {false, 0.005}, {true, 0.005}}) {
    const bool rows = readout_s > 0;
    SyntheticWindow s =
        make({.pixel_noise = 0, .state_error = 0, .readout_s = readout_s, .second_later = 0.3 * readout_s});
    Window& w = *s.window;
    for (int i = 0; i < w.track_count() && ragged; ++i)
      for (int k = 0; k < w.size(); ++k)
        if (i % 3 == 0 ? k < i % 4 : k > 2 + i % 5) w.track(i).second &= ~w.bit(k);
    const MatrixXd kept = kept_of(w, kAlike, rows);
    w.remove(w.size() - 1);  // the newest takes no part
    const MatrixXd with = dense(*system_of(w, kAlike, rows), w.size());
    for (int i = 0; i < w.track_count(); ++i) {
      w.track(i).mask &= ~w.bit(0);
      w.track(i).second &= ~w.bit(0);
    }
    const MatrixXd lacking = with - dense(*system_of(w, kAlike, rows), w.size());
    EXPECT_GT(kept.norm(), 1);
    EXPECT_LT(relative_difference(lacking, kept), 1e-6) << ragged;
    // views have seven digits, and what is lacking is the difference of two systems that are much larger
    EXPECT_LT(scaled_difference(kept, lacking), 1e-4) << ragged;
  }
}

/// At every parallax, with good and with wild bearings (where weights vary).
TEST_P(Tracks, InformationIsNeverTakenAway) {
  for (const auto& [motion, lever] : {std::pair{0.0, 0.0}, {0.0, 1.0}, {1e-4, 1.0}, {1.0, 1.0}, {10.0, 1.0}})
    for (const double noise : {0.0, 0.5, 20.0})
      for (const double error : {0.0, 3e-3, 0.1}) {
        const SyntheticWindow s =
            make({.pixel_noise = noise, .motion = motion, .lever = lever, .state_error = error * (motion + 1e-3)});
        const MatrixXd kept = kept_of(*s.window, 4);
        ASSERT_TRUE(kept.allFinite());
        EXPECT_GT(kept.norm(), 1);
        EXPECT_GE(least_eigenvalue(kept), -1e-9 * kept.norm())
            << "motion " << motion << ", noise " << noise << " px, error of the states " << error;
      }
}

/// A hole in a track hides how its error went on: what was seen before it is left out, by the second camera as well.
TEST_P(Drift, OfATrackWithAHoleOnlyTheNewestViewsCount) {
  TrackRecord* t = nullptr;
  SyntheticWindow s = of_one_track(t);
  Window& w = *s.window;
  const auto forget = [&](int k) {
    t->mask &= ~w.bit(k);
    t->second &= ~w.bit(k);
  };
  forget(3);
  for (int k = 4; k < w.size(); ++k) t->second &= ~w.bit(k);
  const auto hole = system_of(w, 4);
  for (int k = 0; k < 3; ++k) forget(k);
  const auto late = system_of(w, 4);
  EXPECT_EQ(hole->residuals, 2 * (w.size() - 4) - 3);
  EXPECT_EQ(hole->residuals, late->residuals);
  EXPECT_LT(relative_difference(dense(*hole, w.size()), dense(*late, w.size())), 1e-9);
}

}  // namespace
}  // namespace epiline::test
