#pragma once
// What a camera saw of a calibration board: its corners, image by image. T is the board's frame, in metres.
#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "estimator/geometry/types.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Places of a board's corners, by id; all in one plane.
using Target = std::map<std::uint32_t, Vec3>;

struct BoardCorner {
  std::uint32_t id = 0;
  Vec3 p_T = Vec3::Zero();  ///< m
  Vec2 px = Vec2::Zero();   ///< raw pixels
};

struct CornerView {
  HostStamp stamp;
  std::vector<BoardCorner> corners;
};

/// `target.csv`: id, x, y, z in metres. Fails if and only if it cannot be read, a line does not parse, an id is doubled
/// or no integer, there are fewer than four corners, or they do not lie in the plane z = 0.
Result<Target> read_target(const std::filesystem::path& path);

/// The recorded tracks as views; a track's id is its corner's. Points of other ids are left out. Stamps rise: an image
/// out of order is left out.
std::vector<CornerView> views_of(const AslDataset& dataset, const Target& target);

}  // namespace epiline
