#pragma once
// Keeps the odometry of every IMU sample of a flight in memory, without heap calls or files during the flight.
#include <array>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "platform/ports/ports.h"

namespace epiline {

class PredictedRecorder final : public OdometrySink {
 public:
  /// Keeps the odometry of the first `readings` samples. `next` gets all of it as well; may be null.
  PredictedRecorder(std::size_t readings, OdometrySink* next) : rows_(readings), next_(next) {}

  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& odometry) noexcept override;
  bool publish_image(const Odometry& odometry) noexcept override {
    return next_ == nullptr || next_->publish_image(odometry);
  }

  /// The path of the kept odometry, and how smooth it is.
  PredictedPath path() const;

 private:
  struct Row {
    HostStamp stamp;
    std::array<double, 3> p{}, v{}, omega{};
    std::array<double, 4> q{};
    std::uint32_t resets = 0;
  };
  std::vector<Row> rows_;  // written once at construction, so that no page fault comes later
  std::size_t count_ = 0;
  OdometrySink* next_;
};

}  // namespace epiline
