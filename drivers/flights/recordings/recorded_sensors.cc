#include "drivers/flights/recordings/recorded_sensors.h"

#include <system_error>
#include <thread>

namespace epiline {

RecordedCamera::RecordedCamera(const AslDataset& dataset, const FlightPlan& plan) : dataset_(dataset), plan_(plan) {}

Status RecordedCamera::open() {
  const auto decode = [](void* camera) { static_cast<RecordedCamera*>(camera)->decode_all(); };
  constexpr std::size_t kStack = 256 * 1024;
  if (!decoder_thread_.start({.name = "decode", .stack_bytes = kStack}, decode, this))
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  while (ready_.published() < kBuffers && !ended_.load(std::memory_order_acquire))
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return Done{};
}

void RecordedCamera::close() noexcept {
  closing_.store(true, std::memory_order_release);
  decoder_parking_.notify();
  decoder_thread_.join();
}

void RecordedCamera::start(const Pace& pace) noexcept {
  pace_ = pace;
  started_.store(true, std::memory_order_release);
}

bool RecordedCamera::is_overdue(std::size_t i) const noexcept {
  return started_.load(std::memory_order_acquire) && monotonic_ns() > pace_.host_of(plan_.images[i].stamp);
}

/// -1: all are in use.
int RecordedCamera::free_slot() const noexcept {
  for (std::size_t i = 0; i < kBuffers; ++i) {
    // acquire, pairs with the release in give_back(): the last look at the pixels comes before they are written
    if (!in_use_[i].load(std::memory_order_acquire)) return static_cast<int>(i);
  }
  return -1;
}

int RecordedCamera::wait_for_slot() noexcept {
  constexpr std::int64_t kPoll_ns = 20'000'000;
  int slot = -1;
  while (slot < 0 && !closing_.load(std::memory_order_acquire)) {
    decoder_parking_.wait_until(monotonic_ns() + kPoll_ns, [&] {
      slot = free_slot();
      return slot >= 0 || closing_.load(std::memory_order_acquire);
    });
  }
  if (slot >= 0) in_use_[static_cast<std::size_t>(slot)].store(true, std::memory_order_relaxed);
  return slot;
}

/// Image `i` of the plan, and those of the other cameras.
Status RecordedCamera::decode(std::size_t i, std::size_t slot, Frame& frame) {
  const PlannedImage& planned = plan_.images[i];
  const auto image = decoder_.read(planned.index, dataset_, slot);
  if (!image) return image.error();
  frame = *image;
  others_[slot] = {};
  for (std::size_t c = 0; c < dataset_.others.size(); ++c) {
    if (!planned.others[c]) continue;
    const auto other = other_decoders_[c].read(*planned.others[c], *dataset_.others[c], slot);
    if (!other) return other.error();
    if (other->data == nullptr) continue;
    others_[slot][c] = *other;
    others_[slot][c].stamp = planned.stamp + planned.later[c];
  }
  return Done{};
}

void RecordedCamera::decode_all() {
  int slot = -1;
  for (std::size_t i = 0; i < plan_.images.size(); ++i) {
    if (slot < 0) slot = wait_for_slot();
    if (slot < 0) break;  // closing
    if (is_overdue(i)) {
      missed_.fetch_add(1, std::memory_order_relaxed);
      continue;
    }
    Frame frame;
    if (!dataset_.images.empty()) {
      if (const Status s = decode(i, static_cast<std::size_t>(slot), frame); !s) {
        error_ = s.error();
        break;
      }
      if (frame.data == nullptr) continue;
    }
    frame.stamp = frame.arrival = plan_.images[i].stamp;
    frame.sequence = i;
    frame.slot = slot;
    slot = -1;
    ready_.push(frame);  // there is room: as many places as buffers
    reader_parking_.notify();
  }
  ended_.store(true, std::memory_order_release);
  reader_parking_.notify();
}

ReadOutcome RecordedCamera::read(Frame& frame, Span timeout) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns;
  bool ended = false;
  reader_parking_.wait_until(deadline_ns, [&] {
    ended = ended_.load(std::memory_order_acquire);
    return ready_.front() != nullptr || ended;
  });
  if (ready_.front() == nullptr) return ended ? ReadOutcome::kEnd : ReadOutcome::kTimeout;
  const std::int64_t due_ns = pace_.host_of(ready_.front()->stamp);
  sleep_until(std::min(due_ns, deadline_ns));
  if (due_ns > deadline_ns) return ReadOutcome::kTimeout;
  ready_.pop(frame);
  return ReadOutcome::kSample;
}

/// Written before the frame went through the ring.
OtherFrames RecordedCamera::others(const Frame& frame) const noexcept {
  return others_[static_cast<std::size_t>(frame.slot)];
}

void RecordedCamera::give_back(const Frame& frame) noexcept {
  in_use_[static_cast<std::size_t>(frame.slot)].store(false, std::memory_order_release);
  decoder_parking_.notify();
}

ReadOutcome RecordedImu::read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  count = 0;
  if (next_ == samples_.size()) return ReadOutcome::kEnd;
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns, due_ns = pace_.host_of(samples_[next_].stamp);
  sleep_until(std::min(due_ns, deadline_ns));
  const std::int64_t now_ns = monotonic_ns();
  while (count < samples.size() && next_ < samples_.size() && pace_.host_of(samples_[next_].stamp) <= now_ns)
    samples[count++] = arrived(samples_[next_++]);
  return count > 0 ? ReadOutcome::kSample : ReadOutcome::kTimeout;
}

}  // namespace epiline
