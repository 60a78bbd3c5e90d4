#include "drivers/flights/recordings/mask_file.h"

#include <fmt/format.h>

#include <memory>

#include "drivers/flights/recordings/image_codecs.h"
#include "pipeline/text/table.h"
#include "pipeline/vision/mask.h"

namespace epiline {

Status read_mask(std::size_t number, const CameraParameters& camera, Config& config) {
  const std::string& file = config.masks[number];
  if (file.empty()) return Done{};
  const auto refuse = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, file, 0, std::move(found),
                 fmt::format("{} ({}.mask)", expected, number == 0 ? "camera" : kOtherCameraSections[number - 1])};
  };
  const auto bytes = read_text(file);
  if (!bytes) return bytes.error();
  GreyImage picture;
  if (!decode_image(reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size(), picture))
    return refuse("cannot be read as an image", "a complete PNG, JPEG or binary PGM");
  if (picture.width != camera.width || picture.height != camera.height)
    return refuse(fmt::format("{} x {}", picture.width, picture.height),
                  fmt::format("{} x {}, the size of the camera's images", camera.width, camera.height));
  auto mask =
      std::make_shared<const Mask>(ImageView{picture.pixels.data(), picture.width, picture.height, picture.width});
  if (!mask->sees_anything()) return refuse("black everywhere", "white where the camera sees the world");
  config.tracker.masks[number] = std::move(mask);
  return Done{};
}

}  // namespace epiline
