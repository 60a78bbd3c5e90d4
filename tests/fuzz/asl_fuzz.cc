// Any bytes as the tables of a recorded flight: the list of images or the tracks, the IMU's readings, the truth, the
// wheels' speeds and the barometer's heights, in that order, behind one byte (bit 0: tracks) and divided by bytes 0x1e;
// what is left out is sound or absent. Read and planned, or refused with the file's name.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/flight_plan.h"
#include "tests/fuzz/scratch_folder.h"

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kCamera =
    "T_BS: {rows: 4, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\nresolution: [64, 48]\n"
    "camera_model: pinhole\nintrinsics: [40, 40, 32, 24]\ndistortion_model: none\n";
constexpr std::string_view kImages = "0,0.png\n", kTracks = "0,1,32,24\n", kImu = "0,0,0,0,0,0,9.81\n";

std::string_view next_part(std::string_view& rest, std::string_view otherwise) {
  if (rest.empty()) return otherwise;
  const std::string_view part = rest.substr(0, rest.find('\x1e'));
  rest.remove_prefix(std::min(rest.size(), part.size() + 1));
  return part;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("asl_fuzz");
  static const fs::path root = [] {
    for (const char* sensor : {"cam0", "imu0", "state_groundtruth_estimate0", "wheel0", "baro0"})
      fs::create_directories(folder.path() / "mav0" / sensor);
    folder.write("mav0/cam0/sensor.yaml", kCamera);
    return folder.path();
  }();
  if (size == 0) return 0;
  const bool tracks = (data[0] & 1) != 0;
  std::string_view rest = text_of(data + 1, size - 1);
  fs::remove(root / "mav0/cam0" / (tracks ? "data.csv" : "tracks.csv"));
  folder.write(tracks ? "mav0/cam0/tracks.csv" : "mav0/cam0/data.csv", next_part(rest, tracks ? kTracks : kImages));
  folder.write("mav0/imu0/data.csv", next_part(rest, kImu));
  for (const char* sensor : {"state_groundtruth_estimate0", "wheel0", "baro0"}) {
    const std::string table = std::string("mav0/") + sensor + "/data.csv";
    fs::remove(root / table);
    if (const std::string_view part = next_part(rest, ""); !part.empty()) folder.write(table, part);
  }

  const auto dataset = epiline::open_asl_dataset(root, "cam0");
  if (!dataset) return expect(dataset.error().text().find(root.string()) != std::string::npos), 0;
  expect(!dataset->imu_samples.empty() && dataset->instants_count() > 0);
  expect(tracks == dataset->images.empty());
  std::size_t points = 0;
  for (const epiline::TrackInstant& instant : dataset->instants) {
    expect(instant.first == points);
    points += instant.count;
  }
  expect(points == dataset->points.size());
  const epiline::FlightPlan plan = epiline::plan_flight(*dataset, {});
  for (std::size_t i = 1; i < plan.images.size(); ++i) expect(plan.images[i].stamp > plan.images[i - 1].stamp);
  return 0;
}
