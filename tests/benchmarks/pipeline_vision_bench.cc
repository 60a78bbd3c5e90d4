// The front end's stages against OpenCV's, in one run on one core. Two neighbouring images of a recorded flight, if it
// is there, else a synthetic texture.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <random>

#include "pipeline/vision/detector.h"
#include "pipeline/vision/klt.h"
#include "pipeline/vision/pyramid.h"
#include "pipeline/vision/tracker.h"
#include "pipeline/vision/two_point.h"

namespace epiline {
namespace {

constexpr int kWidth = 752, kHeight = 480, kFeatures = 150;
constexpr int kLoop = 40;  // images, played forward and backward

ImageView view_of(const cv::Mat& m) { return {m.data, m.cols, m.rows, static_cast<int>(m.step)}; }

std::vector<cv::Mat> synthetic_images() {
  std::mt19937 random(1);
  cv::Mat noise(kHeight + 2 * kLoop, kWidth + 2 * kLoop, CV_8UC1);
  for (auto p = noise.begin<std::uint8_t>(); p != noise.end<std::uint8_t>(); ++p)
    *p = static_cast<std::uint8_t>(random() % 256);
  cv::GaussianBlur(noise, noise, {0, 0}, 2.5);
  cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
  std::vector<cv::Mat> images;
  for (int k = 0; k < kLoop; ++k) images.push_back(noise(cv::Rect(2 * k, k, kWidth, kHeight)).clone());
  return images;
}

std::vector<cv::Mat> recorded_images() {
  const char* data = std::getenv("EPILINE_DATA");
  if (!data) return {};
  const std::filesystem::path folder = std::filesystem::path(data) / "euroc_MH_01/mav0/cam0/data";
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  if (files.size() < kLoop) return {};
  std::vector<cv::Mat> images;
  for (int k = 0; k < kLoop; ++k)
    images.push_back(cv::imread(files[static_cast<std::size_t>(k)], cv::IMREAD_GRAYSCALE));
  return images;
}

struct Input {
  Input() : images(recorded_images()) {
    cv::setNumThreads(1);
    recorded = !images.empty();
    if (!recorded) images = synthetic_images();
    cv::goodFeaturesToTrack(images[0], corners, kFeatures, 0.01, 25);
  }
  static const Input& get() {
    static const Input input;
    return input;
  }
  void describe(benchmark::State& state) const {
    state.SetLabel(std::string(recorded ? "recorded, " : "synthetic, ") + simd_target());
  }
  std::vector<cv::Mat> images;
  std::vector<cv::Point2f> corners;
  bool recorded = false;
};

void pyramid(benchmark::State& state) {
  const Input& in = Input::get();
  Pyramid p(kWidth, kHeight, 4);
  std::size_t k = 0;
  for (auto _ : state) p.build(view_of(in.images[++k % kLoop]));
  in.describe(state);
}
BENCHMARK(pyramid)->Unit(benchmark::kMicrosecond);

void pyramid_opencv(benchmark::State& state) {
  const Input& in = Input::get();
  std::vector<cv::Mat> p;
  std::size_t k = 0;
  for (auto _ : state) cv::buildOpticalFlowPyramid(in.images[++k % kLoop], p, {21, 21}, 3);
}
BENCHMARK(pyramid_opencv)->Unit(benchmark::kMicrosecond);

// Forward, correlation and backward from the old position, no prediction.
void klt(benchmark::State& state) {
  const Input& in = Input::get();
  Pyramid a(kWidth, kHeight, 4), b(kWidth, kHeight, 4);
  a.build(view_of(in.images[0]));
  b.build(view_of(in.images[1]));
  std::vector<KltTrack> tracks;
  std::vector<KltTemplate> patches(in.corners.size());
  for (auto _ : state) {
    tracks.clear();
    for (const auto& c : in.corners) {
      tracks.push_back({.x = c.x, .y = c.y, .found_x = c.x, .found_y = c.y, .patch = &patches[tracks.size()]});
    }
    track_klt({}, a.view(), b.view(), tracks.data(), static_cast<int>(tracks.size()));
  }
  state.counters["tracks"] = static_cast<double>(tracks.size());
  state.counters["found"] = static_cast<double>(
      std::count_if(tracks.begin(), tracks.end(), [](const KltTrack& t) { return t.end == KltEnd::kFound; }));
}
BENCHMARK(klt)->Unit(benchmark::kMicrosecond);

void klt_opencv(benchmark::State& state) {
  const Input& in = Input::get();
  std::vector<cv::Mat> a, b;
  cv::buildOpticalFlowPyramid(in.images[0], a, {21, 21}, 3);
  cv::buildOpticalFlowPyramid(in.images[1], b, {21, 21}, 3);
  std::vector<cv::Point2f> found, back;
  std::vector<std::uint8_t> status;
  std::vector<float> error;
  for (auto _ : state) {
    cv::calcOpticalFlowPyrLK(a, b, in.corners, found, status, error, {21, 21}, 3);
    back = in.corners;
    cv::calcOpticalFlowPyrLK(b, a, found, back, status, error, {21, 21}, 1, {3, 30, 0.01},
                             cv::OPTFLOW_USE_INITIAL_FLOW);
  }
}
BENCHMARK(klt_opencv)->Unit(benchmark::kMicrosecond);

// All cells of an image without tracks: the worst case, and what OpenCV does in every image.
void detect_all(benchmark::State& state) {
  const Input& in = Input::get();
  Detector detector(kWidth, kHeight, {});
  auto tracks = std::make_unique<TrackTable>();
  for (auto _ : state) {
    tracks->size = 0;
    detector.detect(view_of(in.images[0]), {}, kFeatures, *tracks);
  }
}
BENCHMARK(detect_all)->Unit(benchmark::kMicrosecond);

void detect_all_opencv(benchmark::State& state) {
  const Input& in = Input::get();
  std::vector<cv::Point2f> corners;
  for (auto _ : state) cv::goodFeaturesToTrack(in.images[0], corners, kFeatures, 0.01, 25);
}
BENCHMARK(detect_all_opencv)->Unit(benchmark::kMicrosecond);

void detect_all_opencv_fast(benchmark::State& state) {
  const Input& in = Input::get();
  std::vector<cv::KeyPoint> corners;
  for (auto _ : state) cv::FAST(in.images[0], corners, 20, true);
}
BENCHMARK(detect_all_opencv_fast)->Unit(benchmark::kMicrosecond);

void two_point(benchmark::State& state) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit(-0.5f, 0.5f);
  auto pairs = std::make_unique<BearingPairs>();
  pairs->size = kFeatures;
  for (int i = 0; i < kFeatures; ++i) {
    pairs->before_x[i] = unit(random), pairs->before_y[i] = unit(random), pairs->before_z[i] = 1;
    pairs->now_x[i] = pairs->before_x[i] + 0.02f * unit(random), pairs->now_y[i] = pairs->before_y[i],
    pairs->now_z[i] = 1;
  }
  std::array<bool, BearingPairs::kCapacity> inlier;
  for (auto _ : state) find_inliers(*pairs, {.limit_rad = 0.002f}, inlier);
}
BENCHMARK(two_point)->Unit(benchmark::kMicrosecond);

// Everything, image after image, without a gyroscope's help.
void tracker_step(benchmark::State& state) {
  const Input& in = Input::get();
  CameraParameters parameters;
  parameters.width = kWidth;
  parameters.height = kHeight;
  parameters.intrinsics = {458.654, 457.296, 367.215, 248.375};
  parameters.distortion = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0};
  Tracker tracker(Camera(parameters), {});
  auto out = std::make_unique<TrackedFrame>();
  std::int64_t number = 0;
  for (auto _ : state) {
    const std::int64_t phase = number % (2 * kLoop - 2);
    const cv::Mat& m = in.images[static_cast<std::size_t>(phase < kLoop ? phase : 2 * kLoop - 2 - phase)];
    tracker.step({HostStamp{++number * 50'000'000}, 0, m.data, m.cols, m.rows, static_cast<int>(m.step)},
                 Mat3::Identity(), *out);
  }
  state.counters["tracked"] = static_cast<double>(tracker.stats().tracked) /
                              static_cast<double>(std::max<std::uint64_t>(tracker.stats().tried, 1));
  in.describe(state);
}
BENCHMARK(tracker_step)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace epiline
