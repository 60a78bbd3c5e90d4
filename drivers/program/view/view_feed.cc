#include "drivers/program/view/view_feed.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::int64_t kInterval_ns = 45'000'000, kIntervalUnseen_ns = 1'000'000'000;
constexpr std::int64_t kViewerGone_ns = 2'000'000'000;
constexpr std::int64_t kLongAgo_ns = std::numeric_limits<std::int64_t>::min() / 2;

/// Every `step`-th pixel, to `to` and what follows it at distances of `row`; black where the image has none.
void copy_pixels(const Frame& frame, int step, int width, int height, std::uint8_t* to, int row) {
  for (int y = 0; y < height; ++y, to += row) {
    const int seen = frame.data != nullptr && y * step < frame.height ? std::min(width, frame.width / step) : 0;
    std::fill(to + seen, to + width, std::uint8_t{0});
    if (seen == 0) continue;
    const std::uint8_t* const from = frame.data + std::ptrdiff_t{y} * step * frame.stride;
    if (step == 1) {
      std::memcpy(to, from, static_cast<std::size_t>(seen));
    } else {
      for (int x = 0; x < seen; ++x) to[x] = from[x * step];
    }
  }
}

/// `widths`: places for the other cameras' images, which may be missing.
void copy_images(const Frame& frame, const OtherFrames& others, const std::array<int, kMostOthers>& widths,
                 ViewedImage& out) {
  int step = 1;
  const auto width_of_copy = [&] {
    int sum = frame.width / step;
    for (const int width : widths) sum += width / step;
    return sum;
  };
  while (std::size_t(width_of_copy()) * std::size_t(frame.height / step) > ViewedImage::kMostPixels) ++step;
  out.camera_width = frame.width;
  out.camera_height = frame.height;
  out.width = width_of_copy();
  out.height = frame.height / step;
  int at = frame.width / step;
  copy_pixels(frame, step, at, out.height, out.pixels.data(), out.width);
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    out.others_x[i] = widths[i] > 0 ? out.camera_width : 0;
    copy_pixels(others[i], step, widths[i] / step, out.height, out.pixels.data() + at, out.width);
    out.camera_width += widths[i];
    at += widths[i] / step;
  }
}

}  // namespace

ViewFeed::ViewFeed() : seen_ns_(kLongAgo_ns), last_draft_ns_(kLongAgo_ns) {
  for (int i = 0; i < static_cast<int>(buffers_.size()); ++i) empty_.push(i);
}

void ViewFeed::take(const FrameOutcome& outcome) noexcept {
  if (ViewedOutcome* const out = outcomes_.claim()) {
    out->outcome = outcome;
    out->imu_samples = imu_samples_;
    out->newest_imu = newest_imu_;
    out->images_lost = images_lost_;
    outcomes_.publish();
  }
}

void ViewFeed::published(std::uint64_t serial, std::int64_t latency_ns) noexcept {
  latencies_.push({serial, latency_ns});
}

void ViewFeed::imu(const ImuSample& sample) noexcept {
  ++imu_samples_;
  newest_imu_ = sample.stamp;
}

void ViewFeed::event(const Event& event) noexcept { events_.push(event); }

/// The buffer for this image; null if none is wanted or free now.
ViewedImage* ViewFeed::draft_for(std::uint64_t sequence, HostStamp stamp) noexcept {
  if (draft_ != kNone && sequence <= draft_sequence_) {
    return sequence == draft_sequence_ ? &buffers_[static_cast<std::size_t>(draft_)] : nullptr;
  }
  const std::int64_t now_ns = monotonic_ns();
  if (draft_ == kNone) {
    const bool seen = now_ns - seen_ns_.load(std::memory_order_relaxed) < kViewerGone_ns;  // a hint, orders nothing
    if (now_ns - last_draft_ns_ < (seen ? kInterval_ns : kIntervalUnseen_ns) || !empty_.pop(draft_)) return nullptr;
  }  // else: the rest of the image before never came, its buffer is free
  last_draft_ns_ = now_ns;
  draft_sequence_ = sequence;
  ViewedImage& draft = buffers_[static_cast<std::size_t>(draft_)];
  draft.stamp = stamp;
  draft.sequence = sequence;
  draft.camera_width = draft.camera_height = draft.width = draft.height = 0;
  draft.has_tracks = false;
  draft.others_x = {};
  draft.tracks.clear();
  for (auto& tracks : draft.other_tracks) tracks.clear();
  return &draft;
}

bool ViewFeed::draft_is_whole() const noexcept {
  const ViewedImage& draft = buffers_[static_cast<std::size_t>(draft_)];
  return draft.has_tracks && (draft.width > 0 || !images_expected_);
}

void ViewFeed::hand_over() noexcept {
  filled_.push(draft_);  // holds all there are
  draft_ = kNone;
}

void ViewFeed::tracks(const LoggedTracks& tracks) noexcept {
  if (sequence_known_ && tracks.sequence > newest_sequence_) images_lost_ += tracks.sequence - newest_sequence_ - 1;
  sequence_known_ = true;
  newest_sequence_ = std::max(newest_sequence_, tracks.sequence);
  ViewedImage* const draft = draft_for(tracks.sequence, tracks.stamp);
  if (draft == nullptr) return;
  draft->tracks = tracks.points;
  draft->other_tracks = tracks.others;
  draft->has_tracks = true;
  if (draft_is_whole()) hand_over();
}

void ViewFeed::image(const Frame& frame, const OtherFrames& others) noexcept {
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (others[i].data != nullptr) other_widths_[i] = others[i].width;
  if (frame.data == nullptr || frame.width <= 0 || frame.height <= 0) return;
  ViewedImage* const draft = draft_for(frame.sequence, frame.stamp);
  if (draft == nullptr) return;
  copy_images(frame, others, other_widths_, *draft);
  if (draft_is_whole()) hand_over();
}

const ViewedImage* ViewFeed::newest_image() noexcept {
  bool fresh = false;
  for (int i = kNone; filled_.pop(i);) {
    if (shown_ != kNone) empty_.push(shown_);
    shown_ = i;
    fresh = true;
  }
  return fresh ? &buffers_[static_cast<std::size_t>(shown_)] : nullptr;
}

}  // namespace epiline
