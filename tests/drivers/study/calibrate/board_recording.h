#pragma once
// A recording of a waved board, as `epiline record` leaves it: pictures, samples, lists, and the board's description.
#include <algorithm>
#include <filesystem>
#include <string>

#include "drivers/flights/motion/random.h"
#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/photographer.h"
#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {

/// Where WavedRig looks, too.
inline CharucoBoard waved_charuco() { return {6, 6, 0.075, 0.056}; }

/// A camera's noise: two grey levels.
inline void add_noise(GreyImage& image, Random& random) {
  for (std::uint8_t& pixel : image.pixels)
    pixel = static_cast<std::uint8_t>(std::lround(std::clamp(pixel + 2 * random.normal(), 0.0, 255.0)));
}

/// Into an empty folder. Fails if and only if a file cannot be written, or there is no libapriltag to draw tags with.
inline Status write_board_recording(const WavedRig& rig, const std::filesystem::path& folder,
                                    const Board& board = waved_grid()) {
  const auto boxes = black_boxes(board);
  if (!boxes) return boxes.error();
  const std::filesystem::path camera = folder / "mav0" / "cam0", inertial = folder / "mav0" / "imu0";
  std::filesystem::create_directories(camera / "data");
  std::filesystem::create_directories(inertial);
  std::string imu = kAslImuHeader, list = kAslImagesHeader;
  for (const ImuSample& sample : rig.readings()) append_asl_imu(imu, sample);
  const Photographer photographer(board, *boxes, Camera(rig.lens));
  Random noise(rig.seed, 9);
  for (double t = 0.3; t < rig.seconds - 0.3; t += 1 / rig.image_rate_hz) {
    const HostStamp stamp = WavedRig::kBegin + Span::from_seconds(t - rig.time_offset_s);
    const std::string name = std::to_string(stamp.ns) + ".pgm";
    const WavedRig::Pose at = rig.pose(t);
    GreyImage image = photographer.take(at.R_TB * rig.R_BC, at.p_TB + at.R_TB * rig.p_BC);
    add_noise(image, noise);
    append_asl_image(list, stamp, name);
    const std::string pgm = "P5\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n255\n" +
                            std::string(image.pixels.begin(), image.pixels.end());
    if (const Status s = write_text(camera / "data" / name, pgm); !s) return s;
  }
  if (const Status s = write_text(inertial / "data.csv", imu); !s) return s;
  if (const Status s = write_text(camera / "data.csv", list); !s) return s;
  return write_text(folder / "board.yaml", board_yaml(board));
}

}  // namespace epiline
