#include "drivers/program/record/sample_intake.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <new>
#include <thread>

#include "platform/concurrency/counter.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kIntakeWait = Span::from_milliseconds(20);

bool goes_on(ReadOutcome outcome) noexcept {
  if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return outcome != ReadOutcome::kEnd;
}

}  // namespace

bool ImageIntake::step() noexcept {
  Frame frame;
  const ReadOutcome outcome = camera_.read(frame, kIntakeWait);
  if (outcome != ReadOutcome::kSample) return goes_on(outcome);
  take(frame, camera_.others(frame));
  camera_.give_back(frame);
  return true;
}

void ImageIntake::take(const Frame& frame, const OtherFrames& others) noexcept {
  const bool is_first = newest_ns() == 0;
  newest_ns_.store(monotonic_ns(), std::memory_order_relaxed);
  if (is_first) make_buffers(frame);
  if (!is_first && frame.sequence > sequence_ + 1) bump(missed_, frame.sequence - sequence_ - 1);
  sequence_ = frame.sequence;
  if (frame.width != width() || frame.height != height_) return bump(resized_);
  if (!is_first && frame.stamp <= last_) return bump(old_);
  WaitingImage image;
  if (!find_buffer(image.buffer)) return bump(unwritten_);
  copy(frame, 0, image);
  for (std::size_t i = 1; i < cameras_; ++i) {
    const Frame& other = others[i - 1];
    if (other.data != nullptr && other.width == frame.width && other.height == frame.height) copy(other, i, image);
  }
  last_ = frame.stamp;
  waiting_.push(image);  // never full: there are no more buffers than places
  wakes_.notify();
}

void ImageIntake::copy(const Frame& from, std::size_t camera, WaitingImage& to) noexcept {
  to.stamps[camera] = from.stamp;
  const auto width = static_cast<std::size_t>(from.width);
  std::uint8_t* pixels = pixels_.data() + (to.buffer * cameras_ + camera) * image_bytes_;
  for (int y = 0; y < from.height; ++y, pixels += width)
    std::memcpy(pixels, from.data + std::ptrdiff_t{y} * from.stride, width);
}

/// Without memory there is no buffer, and every image counts as unwritten.
void ImageIntake::make_buffers(const Frame& first) noexcept {
  image_bytes_ = static_cast<std::size_t>(first.width) * static_cast<std::size_t>(first.height);
  const std::size_t bytes = image_bytes_ * cameras_;
  buffers_ = std::clamp(waiting_bytes_ / std::max<std::size_t>(bytes, 1), kFewest, kMost);
  try {
    pixels_.resize(buffers_ * bytes);
  } catch (const std::bad_alloc&) {
    buffers_ = 0;
  }
  height_ = first.height;
  width_.store(first.width, std::memory_order_release);  // pairs with the acquire of width(): the height is there
}

bool ImageIntake::find_buffer(std::uint16_t& buffer) noexcept {
  if (used_ == buffers_) return given_back_.pop(buffer);
  buffer = static_cast<std::uint16_t>(used_++);
  return true;
}

Frame ImageIntake::image_of(const WaitingImage& waiting, std::size_t camera) const noexcept {
  Frame frame;
  frame.stamp = *waiting.stamps[camera];
  frame.data = pixels_.data() + (waiting.buffer * cameras_ + camera) * image_bytes_;
  frame.width = frame.stride = width();
  frame.height = height_;
  return frame;
}

void ImageIntake::pop() noexcept {
  given_back_.push(waiting_.front()->buffer);
  waiting_.pop();
}

bool ReadingIntake::step() noexcept {
  std::array<ImuSample, 64> samples;
  std::size_t count = 0;
  const ReadOutcome outcome = imu_.read(samples, count, kIntakeWait);
  if (outcome != ReadOutcome::kSample) return goes_on(outcome);
  for (std::size_t i = 0; i < count; ++i) take(samples[i]);
  return true;
}

void ReadingIntake::take(const ImuSample& sample) noexcept {
  const bool is_first = newest_ns() == 0;
  newest_ns_.store(monotonic_ns(), std::memory_order_relaxed);
  if (!is_first && sample.stamp > last_) bump(missed_, interval_.note((sample.stamp - last_).ns));
  last_ = sample.stamp;
  waiting_.push(sample);
  const auto& w = sample.angular_velocity_rad_s;
  if (turns_) turns_(std::hypot(w[0], w[1], w[2]));
}

}  // namespace epiline
