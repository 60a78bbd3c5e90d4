#pragma once
// Raw images of ROS messages as 8-bit grey: of 16 bits the upper eight of those used, of colours the luma of ITU-R
// BT.601.
#include <optional>
#include <string>

#include "drivers/flights/recordings/grey_image.h"
#include "drivers/flights/recordings/ros_message.h"

namespace epiline {

struct ImageFault {
  std::string found, expected;
};

/// Fails if and only if the encoding is none that is read, or rows are shorter than their pixels. Mosaics of colour
/// (Bayer) keep their size, as ROS calibrates them: each pixel is the weighted mean of its 3x3 neighbours, which holds
/// all colours in the same shares everywhere.
std::optional<ImageFault> to_grey(const RosImage& image, GreyImage& grey);

/// The encoding is one of distances, which only look like an image.
bool is_depth(const std::string& encoding);

}  // namespace epiline
