#include "drivers/program/live/live_log.h"

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

LiveLog::LiveLog(const std::filesystem::path& folder) {
  if (folder.empty()) return;
  trajectory_ = std::make_unique<OutputFile>(folder / "trajectory.tum");
  event_lines_ = std::make_unique<OutputFile>(folder / "events.txt");
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
    first_serial_ += make_room(record.images, kMostImages);
    if (record.images.empty()) first_serial_ = outcome->serial;
    record.images.push_back(image_record(*outcome));
    if (record.images.back().has_pose) poses.poses.push_back(record.images.back().pose);
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
    record.events_lost += make_room(record.events, kMostEvents);
    record.events.push_back(event);
    char line[256];
    if (event_lines_) event_lines_->append(std::string(line, format_event(event, line)) + "\n");
  }
}

Status LiveLog::close(FlightRecord& record) {
  record.events_lost += events_.dropped();
  for (OutputFile* file : {trajectory_.get(), event_lines_.get()}) {
    if (file == nullptr) continue;
    if (const Status s = file->close(); !s) return s.error();
  }
  return Done{};
}

}  // namespace epiline
