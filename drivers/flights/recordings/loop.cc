#include "drivers/flights/recordings/loop.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "drivers/flights/recordings/image_source.h"

namespace epiline {

namespace {

constexpr Span kGap = Span::from_milliseconds(6000);
constexpr Span kAround = Span::from_milliseconds(1000);  // readings before the first and after the last image

/// The images of the recording as often as there are rounds.
class LoopedImages final : public ImageSource {
 public:
  LoopedImages(std::shared_ptr<ImageSource> images, std::size_t count) : images_(std::move(images)), count_(count) {}
  Error complaint(std::size_t index, std::string found, std::string expected) const override {
    return images_->complaint(index % count_, std::move(found), std::move(expected));
  }

 private:
  std::size_t count() const override { return count_; }
  Status decode(std::size_t index, GreyImage& grey) override { return images_->read(index % count_, grey); }

  std::shared_ptr<ImageSource> images_;
  std::size_t count_;
};

/// Appends what is there once more for every later round, moved in time, as long as it begins before `end`.
template <class Sample>
void repeat(std::vector<Sample>& samples, Span period, HostStamp end) {
  const std::size_t once = samples.size();
  for (Span shift = period; samples.front().stamp + shift < end; shift = shift + period) {
    for (std::size_t i = 0; i < once; ++i) {
      samples.push_back(samples[i]);
      samples.back().stamp = samples[i].stamp + shift;
    }
  }
  samples.erase(std::find_if(samples.begin(), samples.end(), [&](const Sample& s) { return s.stamp > end; }),
                samples.end());
}

}  // namespace

void loop_flight(AslDataset& d, double seconds) {
  const auto extent = d.extent();
  const HostStamp first = extent.first, last = extent.second;
  const Span period = last - first + kGap;
  const HostStamp end = first + Span::from_seconds(seconds);
  const auto repeat_around = [&](auto& samples) {
    const auto outside = [&](const auto& s) { return s.stamp < first - kAround || s.stamp > last + kAround; };
    samples.erase(std::remove_if(samples.begin(), samples.end(), outside), samples.end());
    if (!samples.empty()) repeat(samples, period, end + kAround);
  };
  repeat_around(d.imu_samples);
  repeat_around(d.wheel_samples);
  repeat_around(d.height_samples);
  if (!d.images.empty()) {
    const auto repeat_images = [&](AslDataset& camera) {
      camera.image_source = std::make_shared<LoopedImages>(camera.image_source, camera.images.size());
      repeat(camera.images, period, end);
    };
    repeat_images(d);
    for (const auto& other : d.others) repeat_images(*other);
  } else if (!d.instants.empty()) {
    repeat(d.instants, period, end);
  }
}

}  // namespace epiline
