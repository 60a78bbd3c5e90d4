#include "estimator/window/window.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "platform/error/contract.h"

namespace epiline {

static_assert(kMaxCameras == kMostOthers + 1, "capacity.h includes nothing, so it says it again");

void retract(Calibration& c, const CalibrationTangent& d) {
  c.time_offset += d[0];
  c.R_BC = so3_normalised(c.R_BC * so3_exp(d.segment<3>(kRotationColumn)));
  c.p_BC += d.segment<3>(kTranslationColumn);
  c.focal += d[kFocalColumn];
  c.shape += d[kShapeColumn];
  c.scale.accelerometer += d[kAccelerometerScaleColumn];
  c.scale.gyroscope += d[kGyroscopeScaleColumn];
}

CalibrationTangent local(const Calibration& c0, const Calibration& c) {
  CalibrationTangent d;
  d << c.time_offset - c0.time_offset, so3_log(c0.R_BC.transpose() * c.R_BC), c.p_BC - c0.p_BC, c.focal - c0.focal,
      c.shape - c0.shape, c.scale.accelerometer - c0.scale.accelerometer, c.scale.gyroscope - c0.scale.gyroscope;
  return d;
}

void set_view(const Vec3& f_C, const Mat23& chart, Observation& o) {
  Eigen::Map<Eigen::Vector3f>(o.f_C) = f_C.cast<float>();
  Eigen::Map<Eigen::Matrix<float, 2, 3, Eigen::RowMajor>>(o.chart) = chart.cast<float>();
}

void Window::clear() {
  size_ = tracks_ = 0;
  prior.frames = 0;
  for (std::size_t s = 0; s < order_.size(); ++s) order_[s] = static_cast<std::uint8_t>(s);
  for (std::size_t i = 0; i < records_.size(); ++i) records_[i].place = static_cast<std::uint16_t>(i);
  index_.fill(-1);
}

int Window::index_of(std::uint64_t slot_id) const {
  for (int k = 0; k < size_; ++k)
    if (at(k).id == slot_id) return k;
  return -1;
}

void Window::slip(double by_s) {
  for (int k = 0; k + 1 < size_; ++k) {
    at(k).image_stamp = at(k).image_stamp - Span::from_seconds(by_s);
    at(k).time_offset_used += by_s;
  }
  calibration.time_offset += by_s;
  prior.c0.time_offset += by_s;
}

Slot& Window::append() {
  EPILINE_EXPECTS(size_ < kMaxFrames, "a frame appended to a window without room");
  Slot& s = slots_[order_[static_cast<std::size_t>(size_++)]];
  s = Slot{};
  s.id = next_id_++;
  return s;
}

void Window::remove(int k) {
  const std::uint8_t slot = order_[static_cast<std::size_t>(k)];
  for (int i = 0; i < tracks_; ++i) {
    records_[static_cast<std::size_t>(i)].mask &= ~(1u << slot);
    records_[static_cast<std::size_t>(i)].second &= ~(1u << slot);
  }
  for (int i = k; i + 1 < size_; ++i) order_[static_cast<std::size_t>(i)] = order_[static_cast<std::size_t>(i) + 1];
  order_[static_cast<std::size_t>(--size_)] = slot;
}

namespace {
/// From the chart alone: across the meridian it shows the pixel's distance from the centre, along it how that grows.
/// docs/derivations/calibration.md, "Focal length".
float bend_of(const Vec3& f_C, const Mat23& chart) {
  constexpr double kOnAxis = 5e-4;
  const double x = f_C.x(), y = f_C.y(), cosine = f_C.z(), sine2 = x * x + y * y;
  if (1 - cosine < kOnAxis) return 1;
  const double across2 = (chart * Vec3(-y, x, 0)).squaredNorm();
  const double along2 = (chart * Vec3(cosine * x, cosine * y, -sine2)).squaredNorm();
  const double bend = (1 - std::sqrt(across2 / along2)) / (1 - cosine);
  return std::isfinite(bend) ? static_cast<float>(bend) : 1;
}

Mat23 chart_of(const std::array<double, 6>& pixel_jacobian) {
  return Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(pixel_jacobian.data());
}

void put(const TrackedFeature& f, Observation& o) {
  const Vec3 f_C(f.bearing.data());
  const Mat23 chart = chart_of(f.pixel_jacobian);
  set_view(f_C, chart, o);
  o.bend = bend_of(f_C, chart);
  o.row_s = f.row_s;
  o.age = static_cast<float>(f.age);
  o.found = 0;
}

void put(const SecondView& v, Observation& o) {
  set_view(Vec3(v.bearing.data()), chart_of(v.pixel_jacobian), o);
  o.bend = 0;
  o.row_s = v.row_s;
  o.age = static_cast<float>(v.age);
  o.found = static_cast<float>(v.found);
}

std::uint16_t cell_of(const std::array<float, 2>& pixel) {
  const auto index = [](float x) { return static_cast<int>(std::clamp(x / 64.0F, 0.0F, 31.0F)); };
  return static_cast<std::uint16_t>(32 * index(pixel[1]) + index(pixel[0]));
}
}  // namespace

namespace {
bool is_possible(const std::array<double, 3>& bearing, const std::array<double, 6>& pixel_jacobian) noexcept {
  constexpr double kUnit = 1e-3, kMostPixels = 1e5;  // px/rad: a lens of a kilometre in pixels
  const double length2 = Vec3(bearing.data()).squaredNorm();
  const double slope2 = Eigen::Map<const Vec6>(pixel_jacobian.data()).squaredNorm();
  // written so that a NaN fails
  return std::abs(length2 - 1) < 2 * kUnit && slope2 > 0 && slope2 < kMostPixels * kMostPixels;
}
}  // namespace

bool is_possible(const TrackedFeature& f) noexcept { return is_possible(f.bearing, f.pixel_jacobian); }
bool is_possible(const SecondView& v) noexcept { return is_possible(v.bearing, v.pixel_jacobian); }

Window::Observed Window::observe(const TrackedFrame& frame) {
  Observed seen;
  for (const TrackedFeature& feature : frame.features) observe(feature, 0, seen);
  for (std::uint8_t camera = 1; camera < kMaxCameras; ++camera) {
    if (!rig.use[camera]) continue;
    const OtherTracks& other = frame.others[camera - std::size_t{1}];
    for (const SecondView& view : other.views) seen.impossible += !observe_second(view, camera);
    for (const TrackedFeature& feature : other.alone) observe(feature, camera, seen);
  }
  return seen;
}

void Window::observe(const TrackedFeature& feature, std::uint8_t camera, Observed& seen) {
  if (!is_possible(feature)) {
    ++seen.impossible;
    return;
  }
  int i = find(feature.id);
  if (i < 0) {
    if (tracks_ == kMaxTracks) {
      ++seen.without_room;
      return;
    }
    i = tracks_++;
    TrackRecord& t = records_[static_cast<std::size_t>(i)];
    t.id = feature.id;
    t.mask = t.second = 0;
    t.camera = camera;
    t.second_camera = 0;
    t.in_use = true;
    insert_index(feature.id, i);
  }
  const std::uint8_t slot = order_[static_cast<std::size_t>(size_ - 1)];
  TrackRecord& t = records_[static_cast<std::size_t>(i)];
  put(feature, views_[t.place][slot]);
  t.mask |= 1u << slot;
  t.cell = cell_of(feature.pixel);
}

/// Of a track that its own camera sees in this frame. Of several second cameras it keeps the one that has views in the
/// window. False: the view is impossible.
bool Window::observe_second(const SecondView& v, std::uint8_t camera) {
  if (!is_possible(v)) return false;
  const int i = find(v.id);
  if (i < 0 || !seen(records_[static_cast<std::size_t>(i)], size_ - 1)) return true;
  TrackRecord& t = records_[static_cast<std::size_t>(i)];
  if (t.camera >= camera || (t.second != 0 && t.second_camera != camera)) return true;
  const std::uint8_t slot = order_[static_cast<std::size_t>(size_ - 1)];
  put(v, second_views_[t.place][slot]);
  t.second |= 1u << slot;
  t.second_camera = camera;
  return true;
}

void Window::fetch(const TrackRecord& t) const {
  const auto fetch = [](std::uint32_t mask, const auto& views) {
    for (; mask != 0; mask &= mask - 1) __builtin_prefetch(&views[static_cast<std::size_t>(std::countr_zero(mask))]);
  };
  fetch(t.mask, views_[t.place]);
  fetch(t.second, second_views_[t.place]);
}

void Window::prune() {
  for (int i = 0; i < tracks_;) {
    TrackRecord& t = records_[static_cast<std::size_t>(i)];
    if (seen(t, size_ - 1) || views(t) >= 2)
      ++i;
    else
      std::swap(t, records_[static_cast<std::size_t>(--tracks_)]);  // its place is free for a new track
  }
  rebuild_index();
}

namespace {
std::uint32_t bucket(std::uint32_t id) { return id * 2654435761u >> 20; }  // Knuth's multiplicative hash, 12 bits
}  // namespace

int Window::find(std::uint32_t id) const {
  for (std::uint32_t h = bucket(id); index_[h] >= 0; h = (h + 1) % kBuckets)
    if (records_[static_cast<std::size_t>(index_[h])].id == id) return index_[h];
  return -1;
}

void Window::insert_index(std::uint32_t id, int i) {
  std::uint32_t h = bucket(id);
  while (index_[h] >= 0) h = (h + 1) % kBuckets;
  index_[h] = static_cast<std::int16_t>(i);
}

void Window::rebuild_index() {
  index_.fill(-1);
  for (int i = 0; i < tracks_; ++i) insert_index(records_[static_cast<std::size_t>(i)].id, i);
}

}  // namespace epiline
