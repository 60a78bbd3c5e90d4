// Any bytes as a bag: a ROS 1 bag, an MCAP file or a ROS 2 bag in SQLite, known by their first bytes; other bytes as
// the list in the folder of a ROS 2 bag. Read or refused, as messages and as a flight; each message can be read again
// and is the same; no more memory is taken than the bytes account for.
#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

#include "drivers/flights/recordings/bag.h"
#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/flights/recordings/flight_plan.h"
#include "drivers/flights/recordings/image_source.h"
#include "tests/fuzz/scratch_folder.h"

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kCalibration =
    "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [64, 48]\ncamera_model: pinhole\n"
    "intrinsics: [40, 40, 32, 24]\ndistortion_model: none\ngyroscope_noise_density: 1e-4\ngyroscope_random_walk: 1e-5\n"
    "accelerometer_noise_density: 2e-3\naccelerometer_random_walk: 3e-3\n";

/// Whether there are any.
bool read_messages(const fs::path& path, bool is_sqlite) {
  auto bag = epiline::Bag::open(path);
  if (!bag) {
    expect(!bag.error().file.empty() && !bag.error().found.empty());
    return false;
  }
  struct Seen {
    epiline::BagPlace place;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<Seen> seen;
  (void)(*bag)->scan([&](const epiline::BagMessage& message) {
    expect(message.topic < (*bag)->topics().size());
    if (seen.size() < 64) seen.push_back({message.place, {message.bytes.begin(), message.bytes.end()}});
  });
  for (const Seen& message : seen) {
    const auto again = (*bag)->read(message.place);
    expect(!again || is_sqlite || std::equal(again->begin(), again->end(), message.bytes.begin(), message.bytes.end()));
  }
  return !seen.empty();
}

void read_flight(const fs::path& path, const fs::path& calibration) {
  const auto flight = epiline::open_bag_dataset(path, {}, "cam0", calibration, calibration);
  if (!flight) return expect(!flight.error().found.empty());
  expect(!flight->imu_samples.empty() && !flight->images.empty());
  const epiline::FlightPlan plan = epiline::plan_flight(*flight, {});
  epiline::GreyImage grey;
  for (std::size_t i = 0; i < std::min<std::size_t>(plan.images.size(), 8); ++i)
    (void)flight->image_source->read(plan.images[i].index, grey);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("bag_fuzz");
  static const fs::path calibration = folder.write("calibration.yaml", kCalibration);
  fs::path path = folder.write("any.bag", text_of(data, size));
  if (!epiline::looks_like_bag(path)) {
    fs::create_directory(folder.path() / "list");
    path = folder.write("list/metadata.yaml", text_of(data, size)).parent_path();
  }
  if (read_messages(path, size > 0 && data[0] == 'S')) read_flight(path, calibration);
  return 0;
}
