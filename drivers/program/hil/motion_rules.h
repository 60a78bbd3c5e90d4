#pragma once
// The rules that compare an estimate with the previous one: jumps, reset counter, velocity.
#include <cstdint>
#include <optional>

#include "drivers/program/hil/rules.h"
#include "drivers/program/hil/vision_sample.h"

namespace epiline::hil {

class MotionRules {
 public:
  /// Timestamps must increase.
  void take(const VisionSample& sample, RuleBook& book);

 private:
  /// The part of a step that velocity and angular rates do not explain, and the limits below which it is no jump.
  struct Step {
    double position_m = 0, position_most_m = 0, angle_rad = 0, angle_most_rad = 0;
    bool pause = false, changed = false;  ///< a long time since the estimate before; another reset counter
    bool is_jump() const { return position_m > position_most_m || angle_rad > angle_most_rad; }
    bool is_smooth() const { return position_m < 0.01 && angle_rad < 0.01; }
  };
  /// Change of the position since the window's begin, and the integral of the velocity over the same time.
  struct Window {
    Span length;
    Vec3 moved = Vec3::Zero(), integral = Vec3::Zero();
    double sigma_v = 0, sigma_p = 0;
  };

  Step step_to(const VisionSample& sample) const;
  void judge_reset(const VisionSample& sample, const Step& step, RuleBook& book);
  void follow_velocity(const VisionSample& sample, RuleBook& book);

  std::optional<VisionSample> newest_;
  std::optional<Vec3> newest_speed_;  ///< from positions, where messages have no velocity
  Window window_;
  std::uint64_t resets_ = 0;
  double largest_step_m_ = 0, largest_velocity_error_m_s_ = 0;
};

}  // namespace epiline::hil
