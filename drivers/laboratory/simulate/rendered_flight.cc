#include "drivers/laboratory/simulate/rendered_flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/laboratory/render/renderer.h"
#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"

namespace epiline {
namespace {

enum Stream : std::uint64_t { kFlightStream = 700, kImuStream, kDropStream, kImuErrorStream };
constexpr std::uint64_t kOtherCameraSeed = 0x5eed'0000'0000;  ///< times the number: their noise is not the first one's

/// The camera's places over the whole motion.
std::vector<Vec3> camera_path(const FlightToRender& flight) {
  constexpr double kStep_s = 0.1;
  std::vector<Vec3> path;
  for (double t = 0; t <= flight.motion->duration_s(); t += kStep_s) {
    const Motion m = flight.motion->at(t);
    path.push_back(m.p_WB + m.R_WB * flight.tables.camera.p_BC);
  }
  return path;
}

/// Which image of the renderer becomes which row of the list.
struct ImageTask {
  std::size_t image;
  HostStamp stamp;
};

std::vector<ImageTask> tasks_of(const FlightToRender& flight, const std::vector<double>& times_s,
                                const RenderChoice& choice) {
  Random random(choice.seed, kDropStream);
  const Span shift = Span::from_seconds(flight.tables.camera.time_offset_s);
  std::vector<ImageTask> tasks;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    if (random.chance(choice.effects.dropped_share)) continue;
    tasks.push_back({i, flight.begin + Span::from_seconds(times_s[i]) - shift});
  }
  return tasks;
}

std::string file_name(HostStamp stamp) { return std::to_string(stamp.ns) + ".png"; }

/// What the threads share.
struct Progress {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::condition_variable changed;
  std::size_t done = 0, working = 0;
  std::optional<Error> error;
};

void work(const Renderer& renderer, int width, int height, const std::vector<ImageTask>& tasks,
          const std::filesystem::path& folder, Progress& progress) {
  GreyImage image;
  image.resize(width, height);
  for (std::size_t i = 0; !EndRequest::is_made() && (i = progress.next++) < tasks.size();) {
    renderer.render(tasks[i].image, image.pixels.data());
    const Status written =
        write_text(folder / file_name(tasks[i].stamp), png_of(GreyPixels{image.pixels.data(), width, height, width}));
    const std::lock_guard lock(progress.mutex);
    ++progress.done;
    if (!written) {
      progress.error = written.error();
      progress.next = tasks.size();
    }
    progress.changed.notify_one();
  }
  const std::lock_guard lock(progress.mutex);
  --progress.working;
  progress.changed.notify_one();
}

/// Renders into `camera`/data as PNG, with `jobs` threads, and writes the list `camera`/data.csv. `progress` is called
/// from the calling thread with images done and images in all. Fails if and only if a file cannot be written whole.
Status write_images(const Renderer& renderer, int width, int height, const std::vector<ImageTask>& tasks, int jobs,
                    const std::filesystem::path& camera,
                    const std::function<void(std::size_t, std::size_t)>& progress) {
  Progress shared;
  shared.working = static_cast<std::size_t>(std::max(1, jobs));
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < std::max(1, jobs); ++i)
      threads.emplace_back([&] { work(renderer, width, height, tasks, camera / "data", shared); });
    std::unique_lock lock(shared.mutex);
    while (shared.working > 0) {
      shared.changed.wait(lock);
      progress(shared.done, tasks.size());
    }
    lock.unlock();
  }
  if (shared.error) return *shared.error;
  std::vector<ImageRow> rows;
  for (std::size_t i = 0; i < shared.done; ++i) rows.push_back({tasks[i].stamp, file_name(tasks[i].stamp)});
  return write_image_list(rows, camera);
}

void add_range(const FlightToRender& flight, const World& world, const RenderChoice& choice,
               std::vector<HeightSample>& samples) {
  const GroundDistance ground = [&](const Vec3& from, const Vec3& along) -> std::optional<double> {
    const auto hit = cast_ray(world, from, along);
    return hit ? std::optional(hit->distance_m) : std::nullopt;
  };
  const auto range = simulate_range(*flight.motion, flight.begin, ground, *choice.range, choice.seed);
  samples.insert(samples.end(), range.begin(), range.end());
}

}  // namespace

FlightToRender built_in_flight(FlightKind kind, const ImuEffects& imu_effects, const CameraCalibration& camera,
                               double rate_hz, std::uint64_t seed, double height_m) {
  const ImuModel imu = imu_model_with(imu_effects, ImuNoise{}, ImuModel{}.rate_hz, Random(seed, kImuErrorStream));
  Random random(seed, kFlightStream);
  const Flight flight = make_flight(kind, random, height_m);
  FlightToRender result;
  result.begin = kFlightBegin;
  // The IMU runs a little before the first and after the last image.
  result.from_s = 0.1;
  result.to_s = flight.duration_s() - 0.1;
  FlightTables& tables = result.tables;
  tables.comment = fmt::format("rendered, flight {}, seed {}", to_string(kind), seed);
  tables.camera = camera;
  tables.camera.R_BC = simulated_camera_axes(kind);
  tables.camera.p_BC = TrackSimulation{}.p_BC;
  tables.image_rate_hz = rate_hz;
  tables.imu.noise = ImuNoise{};  // what its data sheet would say
  ImuSimulator simulator(imu, Random(seed, kImuStream));
  const int samples = static_cast<int>(flight.duration_s() * imu.rate_hz) + 1;
  for (int k = 0; k < samples; ++k) {
    const double t = k / imu.rate_hz;
    const Motion m = flight.at(t);
    const HostStamp stamp = kFlightBegin + Span::from_seconds(t);
    tables.truth.push_back(
        {stamp, {m.p_WB, m.v_WB, m.R_WB, simulator.accelerometer_bias(), simulator.gyroscope_bias()}});
    tables.imu_samples.push_back(simulator.read(stamp, m));
  }
  result.motion = std::make_unique<Flight>(flight);
  return result;
}

WorldKind usual_world(FlightKind kind) {
  switch (kind) {
    case FlightKind::kHall:
    case FlightKind::kStraight:
      return WorldKind::kHall;
    case FlightKind::kCorridor:
      return WorldKind::kCorridor;
    case FlightKind::kRover:
      return WorldKind::kOutdoor;
    case FlightKind::kSurvey:
      return WorldKind::kFields;
    case FlightKind::kAgile:
    case FlightKind::kHover:
    case FlightKind::kStill:
    case FlightKind::kPureRotation:
    case FlightKind::kStandstill:
      return WorldKind::kRoom;
  }
  return WorldKind::kRoom;
}

CameraCalibration beside(const CameraCalibration& first, const CameraCalibration& rig_first,
                         const CameraCalibration& rig_other) {
  CameraCalibration other = rig_other;
  const Mat3 turn = first.R_BC * rig_first.R_BC.transpose();
  other.R_BC = turn * rig_other.R_BC;
  other.p_BC = first.p_BC + turn * (rig_other.p_BC - rig_first.p_BC);
  return other;
}

CameraCalibration to_the_right(const CameraCalibration& first, double baseline_m) {
  CameraCalibration other = first;
  other.p_BC = first.p_BC + baseline_m * first.R_BC.col(0);
  return other;
}

Status render_flight(const FlightToRender& flight, const RenderChoice& choice, const std::filesystem::path& folder,
                     const std::function<void(std::size_t, std::size_t)>& progress) {
  FlightTables tables = flight.tables;
  const auto set_readout = [&](CameraParameters& p) {
    p.readout_s = choice.effects.camera.row_time_s * (p.height - 1);
  };
  set_readout(tables.camera.parameters);
  for (CameraCalibration& other : tables.other_cameras) set_readout(other.parameters);
  const World world = make_world(choice.world, camera_path(flight), choice.effects.movers, choice.seed);
  if (choice.range) add_range(flight, world, choice, tables.height_samples);
  const TextureAtlas atlas(choice.seed);
  const int images = static_cast<int>((flight.to_s - flight.from_s) * flight.tables.image_rate_hz) + 1;
  const std::size_t cameras = 1 + tables.other_cameras.size();
  std::size_t rendered = 0;
  progress(0, cameras * static_cast<std::size_t>(images));
  auto made = make_asl_folder(folder, tables.other_cameras.size());
  if (!made) return made.error();
  if (Status s = write_tables(tables, made->root()); !s) return s;
  const auto render = [&](const CameraCalibration& camera, std::size_t number) {
    const double later_s = number == 0 ? 0 : choice.later_s;
    const std::uint64_t seed = choice.seed ^ (number * kOtherCameraSeed);
    std::vector<double> times_s;
    for (int i = 0; i < images; ++i) times_s.push_back(flight.from_s + later_s + i / flight.tables.image_rate_hz);
    const std::vector<ImageTask> tasks = tasks_of(flight, times_s, choice);
    const RenderSettings settings{camera.parameters, camera.R_BC, camera.p_BC, choice.effects.camera, seed};
    const Renderer renderer(world, atlas, *flight.motion, settings, times_s);
    return write_images(renderer, camera.parameters.width, camera.parameters.height, tasks, choice.jobs,
                        made->root() / ("cam" + std::to_string(number)), [&](std::size_t done, std::size_t all) {
                          rendered = number * all + done;
                          progress(rendered, cameras * all);
                        });
  };
  if (Status s = render(tables.camera, 0); !s) return s;
  for (std::size_t c = 1; c < cameras; ++c)
    if (Status s = render(tables.other_cameras[c - 1], c); !s) return s;
  return rendered == 0 && EndRequest::is_made() ? Status(Done{}) : made->finish();
}

}  // namespace epiline
