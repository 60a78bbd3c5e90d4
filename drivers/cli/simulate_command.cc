#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "drivers/cli/commands.h"
#include "drivers/simulate/asl_writer.h"

namespace epiline {

namespace {

struct Options {
  std::string flight = to_string(FlightKind::kHall), out;
  std::uint64_t seed = 1;
  double duration_s = 0;
  TrackSimulation simulation;
};

// The images of the first seconds only; the truth and the IMU samples beyond do no harm.
void shorten(SimulatedFlight& flight, double duration_s) {
  const HostStamp end = flight.images.front().stamp + Span::from_seconds(duration_s);
  const auto beyond = std::partition_point(flight.images.begin(), flight.images.end(),
                                           [&](const SimulatedImage& image) { return image.stamp < end; });
  flight.images.erase(beyond, flight.images.end());
}

int simulate(Options& o) {
  o.simulation.flight = *flight_from(o.flight);
  o.simulation.seed = o.seed;
  SimulatedFlight flight = simulate_tracks(o.simulation);
  if (o.duration_s > 0) shorten(flight, o.duration_s);
  const Status written = write_asl(o.simulation, flight, o.out);
  return written ? kExitDone : report(written.error());
}

}  // namespace

void add_simulate(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<Options>();
  std::vector<std::string> flights;
  for (const FlightKind kind : kAllFlights) flights.emplace_back(to_string(kind));
  CLI::App* command =
      app.add_subcommand("simulate", "A made-up flight as a folder to replay: IMU, tracks and the truth");
  command->add_option("--flight", o->flight, "what is flown")->check(CLI::IsMember(flights))->capture_default_str();
  command->add_option("--seed", o->seed, "of every random number")->capture_default_str();
  command->add_option("--duration", o->duration_s, "ends after that many seconds")->check(CLI::PositiveNumber);
  command->add_option("--pixel-noise", o->simulation.noise.pixel_sigma, "standard deviation, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--out", o->out, "folder to write")->required();
  command->callback([o, &exit_code] { exit_code = simulate(*o); });
}

}  // namespace epiline
