#include "drivers/links/stream/odometry_stream.h"

#include <limits>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::int64_t kFar_ns = std::numeric_limits<std::int64_t>::max();

std::uint8_t first_reset_counter() { return static_cast<std::uint8_t>(monotonic_ns() / 1'000'000'000); }

}  // namespace

OdometryStream::OdometryStream(double rate_hz) noexcept : schedule_(rate_hz), gate_(first_reset_counter()) {}

// ---- the offering thread ----

void OdometryStream::offer(const Odometry& odometry, std::int64_t now_ns) noexcept {
  Offer& offer = newest_.draft();
  offer.odometry = odometry;
  offer.images = images_;
  offer.offered_ns = now_ns;
  newest_.publish();
}

void OdometryStream::offer_image(const Odometry& odometry) noexcept { image_marks_.push({++images_, odometry.stamp}); }

// ---- the sending thread ----

bool OdometryStream::has_news() noexcept {
  const Offer* const newest = newest_.read();
  return newest != nullptr && newest->offered_ns != seen_ns_;
}

bool OdometryStream::may_send() const noexcept {
  return condition_ == Condition::kGood || condition_ == Condition::kDegraded;
}

template <class Visit>
void OdometryStream::take_images(std::uint64_t number, Visit visit) noexcept {
  for (const ImageMark* mark = image_marks_.front(); mark != nullptr && mark->number <= number;
       mark = image_marks_.front()) {
    visit(*mark);
    image_marks_.pop();
  }
}

void OdometryStream::look(std::int64_t now_ns, bool is_open) noexcept {
  if (has_news()) {
    const Offer& newest = *newest_.read();
    seen_ns_ = newest.offered_ns;
    health_ = newest.odometry.health;
    condition_ = condition_of(health_);
    if (newest.images > images_seen_) schedule_.image(now_ns);
    images_seen_ = newest.images;
    if (gate_.admits(newest.odometry)) {
      next_ = newest;
      has_unsent_ = true;
    }
  } else if (seen_ns_ != 0 && now_ns - seen_ns_ > kSilence_ns) {
    condition_ = Condition::kSilent;
    gate_.stop();
  }
  has_unsent_ = has_unsent_ && may_send() && now_ns - next_.offered_ns < kTooOld_ns;
  if (is_open && may_send()) return;
  take_images(images_seen_, [](const ImageMark&) {});  // nobody waits for these
  images_begun_ = images_seen_;
}

std::uint32_t OdometryStream::reasons() const noexcept {
  return condition_ == Condition::kSilent ? 0 : health_.reasons;
}

std::int64_t OdometryStream::silent_ns() const noexcept {
  return seen_ns_ == 0 || condition_ == Condition::kSilent ? kFar_ns : seen_ns_ + kSilence_ns;
}

std::int64_t OdometryStream::due_ns() const noexcept {
  return has_unsent_ ? schedule_.due_ns(next_.images > images_begun_) : kFar_ns;
}

void OdometryStream::begun(std::int64_t now_ns) noexcept {
  images_begun_ = next_.images;
  has_unsent_ = false;
  schedule_.sent(now_ns);
  held_up_since_ns_ = 0;
}

void OdometryStream::finished(std::int64_t now_ns) noexcept {
  take_images(images_begun_, [&](const ImageMark& mark) { latency_.add(now_ns - mark.stamp.ns); });
}

void OdometryStream::count_dropped(std::int64_t now_ns, bool is_held_up) noexcept {
  if (!is_held_up || now_ns < due_ns()) {
    if (!is_held_up || !has_unsent_) held_up_since_ns_ = 0;
    return;
  }
  if (held_up_since_ns_ == 0) held_up_since_ns_ = now_ns;
  for (; now_ns - held_up_since_ns_ >= schedule_.period_ns(); held_up_since_ns_ += schedule_.period_ns()) ++dropped_;
}

}  // namespace epiline
