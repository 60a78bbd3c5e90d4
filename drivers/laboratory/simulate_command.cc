#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/laboratory/commands.h"
#include "drivers/laboratory/simulate/height_simulator.h"
#include "drivers/laboratory/simulate/hybrid_flight.h"
#include "drivers/laboratory/simulate/wheel_simulator.h"
#include "drivers/program/cli/progress_bar.h"
#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

struct SimulateArguments {
  std::string flight = to_string(FlightKind::kHall), from, imu = "recorded", imu_calibration, world,
              effects = kUsualEffects, camera, out;
  std::vector<std::string> other_cameras;
  bool tracks = false, quiet = false;
  Foreign foreign = Foreign::kRefuse;
  std::uint64_t seed = 1;
  bool wheels = false, has_barometer = false, has_range = false;
  double duration_s = 0, rate_hz = 20, baseline_m = 0, later_s = 0;
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
  if (o.wheels) wheel = simulate_wheel(flight.flight, kFlightBegin, {}, o.seed);
  std::vector<HeightSample> heights;
  if (o.has_barometer) heights = simulate_barometer(flight.flight, kFlightBegin, {}, o.seed);
  if (o.has_range) {
    const GroundDistance ground = flat_ground(flight.flight.room().low.z());
    const auto range = simulate_range(flight.flight, kFlightBegin, ground, {}, o.seed);
    heights.insert(heights.end(), range.begin(), range.end());
  }
  const Status written = write_asl(o.simulation, flight, o.out, wheel, heights);
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

Error without_first_camera(const SimulateArguments& o) {
  return {ErrorKind::kUsage, o.other_cameras.front(), 0, "another camera without a first one",
          "the rig's first camera as well (--camera), or --baseline"};
}

/// Gives the flight its other cameras. `rig_first`: the first camera in the rig of --other-camera.
Status add_other_cameras(const SimulateArguments& o, const CameraCalibration& rig_first, FlightTables& tables) {
  if (o.baseline_m != 0) tables.other_cameras.push_back(to_the_right(tables.camera, o.baseline_m));
  for (const std::string& file : o.other_cameras) {
    const auto rig_other = read_camera_calibration(file, fmt::format("cam{}", tables.other_cameras.size() + 1));
    if (!rig_other) return rig_other.error();
    tables.other_cameras.push_back(beside(tables.camera, rig_first, *rig_other));
  }
  if (o.later_s != 0 && tables.other_cameras.empty())
    return Error{ErrorKind::kUsage, "--later", 0, "without another camera", "--other-camera or --baseline"};
  for (CameraCalibration& other : tables.other_cameras) other.time_offset_s = tables.camera.time_offset_s;
  return Done{};
}

int render(const SimulateArguments& o, const FlightEffects& effects, FlightToRender flight, WorldKind usual_world) {
  if (o.wheels) flight.tables.wheel_samples = simulate_wheel(*flight.motion, flight.begin, {}, o.seed);
  if (o.has_barometer) flight.tables.height_samples = simulate_barometer(*flight.motion, flight.begin, {}, o.seed);
  if (o.duration_s > 0) flight.to_s = std::min(flight.to_s, flight.from_s + o.duration_s);
  RenderChoice choice{o.world.empty() ? usual_world : *world_from(o.world), effects, o.seed, o.jobs, std::nullopt};
  if (o.has_range) choice.range.emplace();
  choice.later_s = o.later_s;
  ProgressBar bar(o.quiet);
  std::size_t rendered = 0, wanted = 0;
  std::optional<EndRequest> request;  // before the first image, a signal ends the program at once
  const Status written = render_flight(flight, choice, o.out, [&](std::size_t done, std::size_t all) {
    if (!request) request.emplace();
    rendered = done;
    wanted = all;
    bar(done, all);
  });
  if (!written) return report(written.error());
  return EndRequest::is_made() ? report_ended(rendered, wanted, "images", o.out) : kExitDone;
}

int render_built_in(const SimulateArguments& o, const FlightEffects& effects) {
  CameraCalibration camera = usual_camera();
  if (!o.camera.empty()) {
    const auto calibration = read_camera_calibration(o.camera, "cam0");
    if (!calibration) return report(calibration.error());
    camera = *calibration;
  }
  if (o.camera.empty() && !o.other_cameras.empty()) return report(without_first_camera(o));
  const FlightKind kind = *flight_from(o.flight);
  FlightToRender flight = built_in_flight(kind, effects.imu, camera, o.rate_hz, o.seed, o.simulation.height_m);
  if (const Status s = add_other_cameras(o, camera, flight.tables); !s) return report(s.error());
  return render(o, effects, std::move(flight), usual_world(kind));
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
  FlightTables& tables = hybrid->flight.tables;
  if (const Status s = add_other_cameras(o, tables.camera, tables); !s) return report(s.error());
  if (!o.quiet) fmt::print("{}", text_of(hybrid->fit));
  const int code = render(o, effects, std::move(hybrid->flight), hybrid->usual_world);
  if (code != kExitDone) return code;
  const Status written = write_text(std::filesystem::path(o.out) / "fit.json", json_of(hybrid->fit));
  return written ? kExitDone : report(written.error());
}

int simulate(SimulateArguments& o) {
  const auto folder = claim(o.out, {"mav0", "fit.json"}, o.foreign);
  if (!folder) return report(folder.error());
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

/// A number in that range; `needs`: another option without which it has no meaning.
CLI::Option* add_number(CLI::App& command, const char* name, double& value, const char* text,
                        const CLI::Validator& range, CLI::Option* needs = nullptr) {
  CLI::Option* option = command.add_option(name, value, text)->check(range);
  return needs != nullptr ? option->needs(needs) : option;
}

void add_other_cameras(CLI::App& command, SimulateArguments& o, CLI::Option* tracks) {
  CLI::Option* files =
      command
          .add_option("--other-camera", o.other_cameras,
                      "calibration (sensor.yaml) of another camera; together with that of --camera it gives the rig; "
                      "may be repeated: cam1, cam2, cam3")
          ->expected(1, static_cast<int>(kMostOthers))
          ->excludes(tracks);
  add_number(command, "--baseline", o.baseline_m,
             "a second camera of the same lens, parallel to the first one, this far to its right, m",
             CLI::Range(-0.4, 0.4))
      ->excludes(tracks, files);
  add_number(
      command, "--later", o.later_s,
      "the other cameras take their images so much after the first one, as if nothing triggered them together, s",
      CLI::Range(-0.05, 0.05))
      ->excludes(tracks);
}

}  // namespace

void add_simulate(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand(
      "simulate", "Simulate a flight, as a folder to replay: images or tracks, IMU samples and ground truth");
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
  add_number(*command, "--rate", o->rate_hz, "images per second", CLI::Range(1.0, 500.0))->capture_default_str();
  command->add_option("--seed", o->seed, "seed of all random numbers")->capture_default_str();
  add_number(*command, "--duration", o->duration_s, "end after this many seconds", CLI::PositiveNumber);
  command->add_option("--jobs", o->jobs, "number of images to render at the same time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  CLI::Option* tracks = command->add_flag("--tracks", o->tracks, "write simulated tracks with noise instead of images")
                            ->excludes(from, "--world", "--effects", "--camera", "--rate");
  add_other_cameras(*command, *o, tracks);
  add_number(*command, "--pixel-noise", o->simulation.noise.pixel_sigma,
             "with --tracks: standard deviation of their noise, px", CLI::NonNegativeNumber, tracks)
      ->capture_default_str();
  add_number(*command, "--height", o->simulation.height_m, "of a survey, m", CLI::Range(5.0, 500.0))
      ->capture_default_str();
  command->add_flag("--wheel", o->wheels, "also write the forward speed that wheels would measure (wheel0)");
  command->add_flag("--barometer", o->has_barometer, "also write the height that a barometer would measure (baro0)");
  command->add_flag("--range", o->has_range,
                    "also write the distance that a range finder would measure, downwards (range0)");
  command->add_option("--out", o->out, "folder to write")->required();
  add_force(*command, o->foreign);
  command->add_flag("--quiet", o->quiet, "print errors only");
  command->callback([o, &exit_code] { exit_code = simulate(*o); });
}

}  // namespace epiline
