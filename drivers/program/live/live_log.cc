#include "drivers/program/live/live_log.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <map>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

/// The older half goes when the list is full: no element is moved more than once on average.
template <class T>
std::size_t make_room(std::vector<T>& list, std::size_t most) {
  if (list.size() < most) return 0;
  list.erase(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(most / 2));
  return most / 2;
}

}  // namespace

std::filesystem::path make_flight_folder(const std::filesystem::path& folder, std::size_t keep) {
  namespace fs = std::filesystem;
  std::map<unsigned long long, fs::path> flights;
  std::error_code failed;
  for (fs::directory_iterator it(folder, failed), end; !failed && it != end; it.increment(failed)) {
    unsigned long long number = 0;
    if (std::sscanf(it->path().filename().c_str(), "flight-%llu", &number) == 1) flights.emplace(number, it->path());
  }
  const auto number = flights.empty() ? 1 : flights.rbegin()->first + 1;
  for (auto it = flights.begin(); keep > 0 && flights.size() >= keep; it = flights.erase(it))
    fs::remove_all(it->second, failed);
  const fs::path made = folder / fmt::format("flight-{:03}", number);
  return fs::create_directories(made, failed) ? made : fs::path();
}

LiveLog::LiveLog(const std::filesystem::path& folder, bool keeps) : keeps_(keeps) {
  if (folder.empty()) return;
  trajectory_ = std::make_unique<OutputFile>(folder / "trajectory.tum");
  event_lines_ = std::make_unique<OutputFile>(folder / "events.txt");
  syncing_ = std::thread([this, folder] { sync_each_second(folder); });
}

/// In a thread of its own, for a disk may take seconds. drain() has handed all lines to the kernel by then.
void LiveLog::sync_each_second(const std::filesystem::path& folder) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  sync_folder(folder);
  const auto stops = [this] { return stops_.load(std::memory_order_acquire); };
  while (!pause_.wait_until(monotonic_ns() + kSecond_ns, stops)) {
    for (const char* name : {"trajectory.tum", "events.txt"}) {
      const int fd = ::open((folder / name).c_str(), O_RDONLY | O_CLOEXEC);
      if (fd < 0) continue;
      ::fdatasync(fd);
      ::close(fd);
    }
    syncs_.fetch_add(1, std::memory_order_relaxed);
  }
}

void LiveLog::stop_syncing() {
  stops_.store(true, std::memory_order_release);
  pause_.notify();
  if (syncing_.joinable()) syncing_.join();
}

void LiveLog::drain(FlightRecord& record) {
  take_outcomes(record);
  take_publications(record);
  take_events(record);
  if (trajectory_) trajectory_->flush();
  if (event_lines_) event_lines_->flush();
}

void LiveLog::take_outcomes(FlightRecord& record) {
  Trajectory poses;
  for (const FrameOutcome* outcome = outcomes_.front(); outcome != nullptr; outcome = outcomes_.front()) {
    const ImageRecord image = image_record(*outcome);
    if (image.has_pose) poses.poses.push_back(image.pose);
    if (keeps_) {
      first_serial_ += make_room(record.images, kMostImages);
      if (record.images.empty()) first_serial_ = outcome->serial;
      record.images.push_back(image);
    }
    outcomes_.pop();
  }
  if (trajectory_) trajectory_->append(tum_text(poses));
}

void LiveLog::take_publications(FlightRecord& record) {
  for (Publication p; publications_.pop(p);) {
    // an outcome that found no room has left a gap: then later latencies would go to wrong images
    const std::uint64_t index = p.serial - first_serial_;
    if (outcomes_.dropped() == 0 && index < record.images.size())
      record.images[index].latency_ms = 1e-6 * static_cast<double>(p.latency_ns);
  }
}

void LiveLog::take_events(FlightRecord& record) {
  for (Event event; events_.pop(event);) {
    record.events_lost += make_room(record.events, keeps_ ? kMostEvents : kFewEvents);
    record.events.push_back(event);
    char line[256];
    if (event_lines_) event_lines_->append(std::string(line, format_event(event, line)) + "\n");
  }
}

Status LiveLog::close(FlightRecord& record) {
  stop_syncing();
  record.events_lost += events_.dropped();
  Status first = Done{};
  for (OutputFile* file : {trajectory_.get(), event_lines_.get()}) {
    const Status s = file != nullptr ? file->close() : Status(Done{});
    if (first) first = s;
  }
  return first;
}

}  // namespace epiline
