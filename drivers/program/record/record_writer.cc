#include "drivers/program/record/record_writer.h"

#include <array>
#include <exception>
#include <string>

#include "drivers/flights/recordings/image_codecs.h"
#include "platform/concurrency/counter.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::int64_t kRoundMost_ns = 50'000'000;  // between two rounds without an image

/// Follows the mean of about the last ten values.
void follow(std::atomic<double>& mean, std::int64_t ns) {
  const double value = 1e-6 * static_cast<double>(ns), before = mean.load(std::memory_order_relaxed);
  mean.store(before == 0 ? value : before + 0.1 * (value - before), std::memory_order_relaxed);
}

}  // namespace

void RecordWriter::start() {
  thread_ = std::thread([this] { run(); });
}

void RecordWriter::stop(Span at_most) {
  if (!thread_.joinable()) return;
  ends_at_ns_.store(monotonic_ns() + at_most.ns, std::memory_order_relaxed);
  stops_.store(true, std::memory_order_release);  // pairs with the acquire in run(): the end is known
  wake_.notify();
  thread_.join();
}

void RecordWriter::run() noexcept {
  bool is_last = false;
  try {
    while (round() && !is_last) {
      is_last = stops_.load(std::memory_order_acquire);  // one more round finds all that came before
      while (is_last && images_in_.front() != nullptr && monotonic_ns() < ends_at_ns_.load(std::memory_order_relaxed))
        if (!round()) break;
      if (is_last) continue;
      wake_.wait_until(monotonic_ns() + kRoundMost_ns,
                       [this] { return images_in_.front() != nullptr || stops_.load(std::memory_order_relaxed); });
    }
  } catch (const std::exception& e) {
    fail({ErrorKind::kRun, "", 0, e.what(), "free memory"});
  }
  for (; images_in_.front() != nullptr; images_in_.pop()) ++left_over_;
}

bool RecordWriter::round() {
  bump(rounds_);
  if (has_failed()) return false;
  const bool good = write_readings() && write_image();
  bytes_.store(files_.bytes(), std::memory_order_relaxed);
  return good;
}

bool RecordWriter::write_readings() {
  std::array<ImuSample, 128> readings;
  for (;;) {
    std::size_t count = 0;
    while (count < readings.size() && readings_in_.pop(readings[count])) ++count;
    if (count == 0) return true;
    if (const Status s = files_.add_readings({readings.data(), count}); !s) return fail(s.error());
    bump(readings_, count);
  }
}

bool RecordWriter::write_image() {
  const WaitingImage* const waiting = images_in_.front();
  if (waiting == nullptr) return true;
  bool good = true;
  for (std::size_t i = 0; i <= kMostOthers; ++i)
    if (waiting->stamps[i]) good = good && write(i, images_in_.image_of(*waiting, i));
  images_in_.pop();
  if (good) bump(images_);
  return good;
}

bool RecordWriter::write(std::size_t camera, const Frame& image) {
  const std::int64_t begin_ns = monotonic_ns();
  const std::string png = png_of({image.data, image.width, image.height, image.stride});
  const std::int64_t compressed_ns = monotonic_ns();
  if (png.empty()) return fail({ErrorKind::kRun, "", 0, "memory is short for an image", "free memory"});
  if (const Status s = files_.add_image(camera, image.stamp, png); !s) return fail(s.error());
  follow(compress_ms_, compressed_ns - begin_ns);
  follow(write_ms_, monotonic_ns() - compressed_ns);
  return true;
}

bool RecordWriter::fail(const Error& error) {
  failure_ = error;
  failed_.store(true, std::memory_order_release);  // pairs with the acquire in has_failed(): the error is there
  return false;
}

}  // namespace epiline
