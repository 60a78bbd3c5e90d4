#include "drivers/laboratory/render/image_writer.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/flights/recordings/image_codecs.h"
#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"

namespace epiline {
namespace {

std::string file_name(HostStamp stamp) { return std::to_string(stamp.ns) + ".png"; }

/// What the threads share.
struct Progress {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::condition_variable changed;
  std::size_t done = 0, working = 0;
  std::optional<Error> error;
};

void work(const Renderer& renderer, int width, int height, const std::vector<ImageTask>& tasks,
          const std::filesystem::path& folder, Progress& progress) {
  GreyImage image;
  image.resize(width, height);
  for (std::size_t i = 0; !EndRequest::is_made() && (i = progress.next++) < tasks.size();) {
    renderer.render(tasks[i].image, image.pixels.data());
    const Status written =
        write_text(folder / file_name(tasks[i].stamp), png_of(GreyPixels{image.pixels.data(), width, height, width}));
    const std::lock_guard lock(progress.mutex);
    ++progress.done;
    if (!written) {
      progress.error = written.error();
      progress.next = tasks.size();
    }
    progress.changed.notify_one();
  }
  const std::lock_guard lock(progress.mutex);
  --progress.working;
  progress.changed.notify_one();
}

}  // namespace

Status write_images(const Renderer& renderer, int width, int height, const std::vector<ImageTask>& tasks, int jobs,
                    const std::filesystem::path& camera,
                    const std::function<void(std::size_t, std::size_t)>& progress) {
  Progress shared;
  shared.working = static_cast<std::size_t>(std::max(1, jobs));
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < std::max(1, jobs); ++i)
      threads.emplace_back([&] { work(renderer, width, height, tasks, camera / "data", shared); });
    std::unique_lock lock(shared.mutex);
    while (shared.working > 0) {
      shared.changed.wait(lock);
      progress(shared.done, tasks.size());
    }
    lock.unlock();
  }
  if (shared.error) return *shared.error;
  std::vector<ImageRow> rows;
  for (std::size_t i = 0; i < shared.done; ++i) rows.push_back({tasks[i].stamp, file_name(tasks[i].stamp)});
  return write_image_list(rows, camera);
}

}  // namespace epiline
