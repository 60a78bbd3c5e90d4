#pragma once
// The images of a flight as files.
#include <filesystem>
#include <functional>
#include <vector>

#include "drivers/laboratory/render/renderer.h"
#include "drivers/laboratory/simulate/asl_writer.h"

namespace epiline {

/// Which image of the renderer becomes which row of the list.
struct ImageTask {
  std::size_t image;
  HostStamp stamp;
};

/// Renders into `camera`/data as PNG, with `jobs` threads, and writes the list `camera`/data.csv. `progress` is called
/// from the calling thread with images done and images in all. Fails if and only if a file cannot be written whole.
Status write_images(const Renderer& renderer, int width, int height, const std::vector<ImageTask>& tasks, int jobs,
                    const std::filesystem::path& camera, const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
