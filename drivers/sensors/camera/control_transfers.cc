#include "drivers/sensors/camera/control_transfers.h"

namespace epiline {

namespace {

void close_files(SystemCalls& system, V4l2Controls& controls) noexcept {
  for (std::size_t i = 0; i < controls.control_files(); ++i) system.close(controls.control_file(i));
  controls = V4l2Controls(system);
}

}  // namespace

bool ControlTransfers::start() {
  stop();
  thread_ = system_.start_side_thread("controls", work, this);
  return thread_ != nullptr;
}

void ControlTransfers::stop() noexcept {
  thread_.reset();
  state_.store(State::kIdle, std::memory_order_relaxed);
  close_files(system_, controls_);
}

bool ControlTransfers::begin(const V4l2Controls& controls, const ControlJob& job) noexcept {
  if (!is_idle() || !thread_) return false;
  for (std::size_t i = 0; i < controls.control_files(); ++i) {
    const int fd = system_.duplicate(controls.control_file(i));
    if (fd < 0) {
      close_files(system_, controls_);
      return false;
    }
    controls_.add_file(fd);
  }
  job_ = job;
  state_.store(State::kBegun, std::memory_order_release);  // pairs with the acquire in work(): the job is complete
  thread_->wake();
  return true;
}

bool ControlTransfers::take(ControlJob& job) noexcept {
  // acquire, pairs with the release in work(): what became of it is complete
  if (state_.load(std::memory_order_acquire) != State::kEnded) return false;
  job = job_;
  state_.store(State::kIdle, std::memory_order_relaxed);
  return true;
}

void ControlTransfers::work(void* self) noexcept {
  auto& transfers = *static_cast<ControlTransfers*>(self);
  if (transfers.state_.load(std::memory_order_acquire) != State::kBegun) return;
  transfers.carry_out();
  close_files(transfers.system_, transfers.controls_);
  transfers.state_.store(State::kEnded, std::memory_order_release);
}

void ControlTransfers::carry_out() noexcept {
  job_.is_set = false;
  std::array<ControlValue, ControlJob::kMost> values;
  for (std::size_t i = 0; i < job_.count; ++i) {
    ControlJob::Entry& entry = job_.entries[i];
    if (entry.facts.id == 0 && controls_.find(entry.name.data(), entry.facts)) return;
    values[i] = {&entry.facts, entry.name.data(), entry.wanted};
  }
  if (controls_.change({values.data(), job_.count})) return;
  job_.at = {system_.now_ns()};
  for (std::size_t i = 0; i < job_.count; ++i) job_.entries[i].value = values[i].value;
  job_.is_set = true;
}

}  // namespace epiline
