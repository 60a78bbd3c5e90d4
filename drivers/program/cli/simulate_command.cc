#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/flights/simulate/hybrid_flight.h"
#include "drivers/flights/simulate/wheel_simulator.h"
#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

struct SimulateArguments {
  std::string flight = to_string(FlightKind::kHall), from, imu = "recorded", imu_calibration, world,
              effects = kUsualEffects, camera, out;
  bool tracks = false, quiet = false;
  std::uint64_t seed = 1;
  bool wheels = false;
  WheelSimulation wheel;
  double duration_s = 0, rate_hz = 20;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  TrackSimulation simulation;
};

// The images of the first seconds only; the truth and the IMU samples beyond do no harm.
void shorten(SimulatedFlight& flight, double duration_s) {
  const HostStamp end = flight.images.front().stamp + Span::from_seconds(duration_s);
  const auto beyond = std::partition_point(flight.images.begin(), flight.images.end(),
                                           [&](const SimulatedImage& image) { return image.stamp < end; });
  flight.images.erase(beyond, flight.images.end());
}

int simulate_track_flight(SimulateArguments& o) {
  o.simulation.flight = *flight_from(o.flight);
  o.simulation.seed = o.seed;
  SimulatedFlight flight = simulate_tracks(o.simulation);
  if (o.duration_s > 0) shorten(flight, o.duration_s);
  std::vector<WheelSample> wheel;
  if (o.wheels) wheel = simulate_wheel(flight.flight, kFlightBegin, o.wheel, o.seed);
  const Status written = write_asl(o.simulation, flight, o.out, wheel);
  return written ? kExitDone : report(written.error());
}

/// A global-shutter camera like those of EuRoC.
CameraCalibration usual_camera() {
  CameraCalibration c;
  c.parameters = {.model = CameraModel::kPinholeRadialTangential,
                  .width = 752,
                  .height = 480,
                  .intrinsics = {458, 458, 375.5, 239.5},
                  .distortion = {-0.28, 0.07, 0.0002, 0, 0}};
  return c;
}

int render(const SimulateArguments& o, const FlightEffects& effects, FlightToRender flight, WorldKind usual_world) {
  if (o.wheels) flight.tables.wheel_samples = simulate_wheel(*flight.motion, flight.begin, o.wheel, o.seed);
  if (o.duration_s > 0) flight.to_s = std::min(flight.to_s, flight.from_s + o.duration_s);
  const RenderChoice choice{o.world.empty() ? usual_world : *world_from(o.world), effects, o.seed, o.jobs};
  ProgressBar bar(o.quiet);
  const Status written =
      render_flight(flight, choice, o.out, [&](std::size_t done, std::size_t all) { bar(done, all); });
  return written ? kExitDone : report(written.error());
}

int render_built_in(const SimulateArguments& o, const FlightEffects& effects) {
  CameraCalibration camera = usual_camera();
  if (!o.camera.empty()) {
    const auto calibration = read_camera_calibration(o.camera, "cam0");
    if (!calibration) return report(calibration.error());
    camera = *calibration;
  }
  const FlightKind kind = *flight_from(o.flight);
  return render(o, effects, built_in_flight(kind, effects.imu, camera, o.rate_hz, o.seed), usual_world(kind));
}

int render_recorded(const SimulateArguments& o, const FlightEffects& effects) {
  auto hybrid = hybrid_flight({.dataset = o.from,
                               .camera_file = o.camera,
                               .imu_calibration = o.imu_calibration,
                               .simulated_imu = o.imu == "simulated",
                               .imu_effects = effects.imu,
                               .image_rate_hz = o.rate_hz,
                               .seed = o.seed});
  if (!hybrid) return report(hybrid.error());
  if (!o.quiet) fmt::print("{}", text_of(hybrid->fit));
  const int code = render(o, effects, std::move(hybrid->flight), hybrid->usual_world);
  if (code != kExitDone) return code;
  const Status written = write_text(std::filesystem::path(o.out) / "fit.json", json_of(hybrid->fit));
  return written ? kExitDone : report(written.error());
}

int simulate(SimulateArguments& o) {
  if (o.tracks) return simulate_track_flight(o);
  const auto effects = parse_effects(o.effects);
  if (!effects) return report(effects.error());
  return o.from.empty() ? render_built_in(o, *effects) : render_recorded(o, *effects);
}

template <class All>
std::vector<std::string> names(const All& all) {
  std::vector<std::string> list;
  for (const auto kind : all) list.emplace_back(to_string(kind));
  return list;
}

}  // namespace

void add_simulate(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand(
      "simulate", "Simulate a flight, as a folder to replay: images or tracks, IMU samples and ground truth");
  command->group(kStudy);
  command->add_option("--flight", o->flight, "built-in flight")
      ->check(CLI::IsMember(names(kAllFlights)))
      ->capture_default_str();
  CLI::Option* from =
      command->add_option("--from", o->from, "render along the ground truth of this recorded flight (ASL folder)")
          ->excludes("--flight");
  command->add_option("--imu", o->imu, "with --from: its recorded IMU samples, or simulated ones")
      ->check(CLI::IsMember({"recorded", "simulated"}))
      ->needs(from)
      ->capture_default_str();
  command
      ->add_option("--imu-calibration", o->imu_calibration,
                   "with --from: calibration file with the noise of the IMU, instead of its own")
      ->needs(from);
  command->add_option("--world", o->world, "scene to render (default: one that fits the flight)")
      ->check(CLI::IsMember(names(kAllWorlds)));
  command
      ->add_option("--effects", o->effects,
                   "imperfections of camera and simulated IMU, separated by commas: " + effects_help())
      ->capture_default_str();
  command->add_option("--camera", o->camera,
                      "calibration (sensor.yaml) of the rendered camera; without --from, only its lens is used");
  command->add_option("--rate", o->rate_hz, "images per second")->check(CLI::Range(1.0, 500.0))->capture_default_str();
  command->add_option("--seed", o->seed, "seed of all random numbers")->capture_default_str();
  command->add_option("--duration", o->duration_s, "end after this many seconds")->check(CLI::PositiveNumber);
  command->add_option("--jobs", o->jobs, "number of images to render at the same time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  CLI::Option* tracks =
      command->add_flag("--tracks", o->tracks, "write simulated tracks with noise instead of images")->excludes(from);
  command
      ->add_option("--pixel-noise", o->simulation.noise.pixel_sigma,
                   "with --tracks: standard deviation of their noise, px")
      ->check(CLI::NonNegativeNumber)
      ->needs(tracks)
      ->capture_default_str();
  command
      ->add_option("--readout", o->simulation.readout_s,
                   "with --tracks: rolling shutter, exposure of the last row minus that of the first, s")
      ->check(CLI::Range(-0.1, 0.1))
      ->needs(tracks);
  CLI::Option* wheels =
      command->add_flag("--wheel", o->wheels, "also write the forward speed that wheels would measure (wheel0)");
  command->add_option("--wheel-noise", o->wheel.sigma_m_s, "with --wheel: standard deviation of the speed, m/s")
      ->check(CLI::NonNegativeNumber)
      ->needs(wheels)
      ->capture_default_str();
  command
      ->add_option("--wheel-scale-error", o->wheel.scale_error,
                   "with --wheel: scale error of the speed; 0.01 is one per cent too fast")
      ->check(CLI::Range(-0.5, 0.5))
      ->needs(wheels)
      ->capture_default_str();
  command->add_option("--out", o->out, "folder to write")->required();
  command->add_flag("--quiet", o->quiet, "print errors only");
  command->callback([o, &exit_code] { exit_code = simulate(*o); });
}

}  // namespace epiline
