#include "pipeline/stages/imu_stage.h"

namespace epiline {

void ImuStage::use() noexcept {
  for (std::size_t i = 0; i < count_; ++i) take(batch_[i]);
  out_.heard.tell(times_.imu, times_.imu_period);
  for (const Reader& reader : out_.readers) reader.parking->notify();
}

bool ImuStage::take(ImuSample& reading) noexcept {
  if (out_.log != nullptr) out_.log->push(reading);  // first: what was used is in the record
  readings_.bump();
  const bool taken = gate_.step(reading);
  events_.after(taken, reading, gate_);
  if (!taken) return false;
  correction_.apply(reading);
  times_.heard_imu(reading.arrival.ns != 0 ? reading.arrival : reading.stamp);
  for (const Reader& reader : out_.readers) reader.ring->push(reading);
  return true;
}

}  // namespace epiline
