#pragma once
// Keeps the odometry of every IMU reading of a flight, without heap or file on the way.
#include <array>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "platform/ports/ports.h"

namespace epiline {

class PredictedRecorder final : public OdometrySink {
 public:
  /// Room for so many; later ones are not kept. `next`: who gets all of it as well; may be null.
  PredictedRecorder(std::size_t readings, OdometrySink* next) : rows_(readings), next_(next) {}

  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& odometry) noexcept override;
  bool publish_image(const Odometry& odometry) noexcept override {
    return next_ == nullptr || next_->publish_image(odometry);
  }

  /// What came, and how smooth it is.
  PredictedPath path() const;

 private:
  struct Row {
    HostStamp stamp;
    std::array<double, 3> p{}, v{}, omega{};
    std::array<double, 4> q{};
    std::uint32_t resets = 0;
  };
  std::vector<Row> rows_;  // all written once at construction: no page is new later
  std::size_t count_ = 0;
  OdometrySink* next_;
};

}  // namespace epiline
