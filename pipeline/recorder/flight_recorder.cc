#include "pipeline/recorder/flight_recorder.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <system_error>
#include <thread>
#include <utility>

#include "pipeline/recorder/record.h"
#include "platform/concurrency/parking.h"
#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

// A tape has a quarter more segments than it lends. Recording continues in these while a record is being written.
constexpr std::size_t kSegments = 40, kKept = 32;
constexpr std::size_t kTracksBytes = sizeof(RecordedTracksHeader) + kMaxFeatures * sizeof(RecordedPoint);
/// Enough for an IMU at 1 kHz, wheel speeds and heights at 100 Hz each, and 60 images with 400 tracks a second. Faster
/// samples make a record shorter.
constexpr std::size_t kBytesPerSecond =
    1000 * Tape::bytes_of_record(sizeof(ImuSample)) +
    60 * (Tape::bytes_of_record(kTracksBytes) + Tape::bytes_of_record(sizeof(RecordedState))) +
    100 * (Tape::bytes_of_record(sizeof(Event)) + Tape::bytes_of_record(sizeof(WheelSample)) +
           Tape::bytes_of_record(sizeof(HeightSample)));

std::size_t sample_segment(double seconds) {
  // one segment may have begun just now, and another holds what is a little too old
  const double bytes = seconds * static_cast<double>(kBytesPerSecond) / (kKept - 2);
  return std::max(static_cast<std::size_t>(bytes), 4 * kTracksBytes);
}

std::size_t image_bytes(const CameraParameters& camera) {
  return sizeof(RecordedImageHeader) + static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

/// As many segments as the limit allows, each with room for the image of each camera or more.
std::optional<Tape> image_tape(const RecorderConfig& config, const RecordedRun& run) {
  if (!config.images || run.png == nullptr) return std::nullopt;
  const std::size_t limit = static_cast<std::size_t>(config.image_memory_mib) << 20;
  std::size_t one = Tape::bytes_of_record(image_bytes(run.camera.parameters));
  for (const auto& other : run.others)
    if (other) one += Tape::bytes_of_record(image_bytes(other->parameters));
  const std::size_t segments = std::clamp<std::size_t>(limit / one, 4, kSegments);
  return std::optional<Tape>(std::in_place, segments, segments * kKept / kSegments,
                             std::max(one, limit / segments / one * one));
}

/// The records in the folder by their numbers, and nothing else that may be there.
std::multimap<std::uint64_t, fs::path> records_in(const fs::path& folder) {
  std::multimap<std::uint64_t, fs::path> records;
  std::error_code ignored;
  for (fs::directory_iterator it(folder, ignored), end; !ignored && it != end; it.increment(ignored)) {
    unsigned long long number = 0;
    if (std::sscanf(it->path().filename().c_str(), "record-%llu-", &number) == 1 &&
        it->symlink_status(ignored).type() == fs::file_type::directory)
      records.emplace(number, it->path());
  }
  return records;
}

std::uint64_t highest_number(const fs::path& folder) {
  const auto records = records_in(folder);
  return records.empty() ? 0 : records.rbegin()->first;
}

/// Removes the oldest records but `keep`.
std::uint64_t make_room(const fs::path& folder, std::size_t keep) {
  auto records = records_in(folder);
  std::uint64_t removed = 0;
  for (auto it = records.begin(); records.size() > keep; it = records.erase(it)) {
    std::error_code refused;
    fs::remove_all(it->second, refused);
    if (!refused) ++removed;
  }
  return removed;
}

}  // namespace

struct FlightRecorder::Impl {
  Impl(const RecorderConfig& c, const RecordedRun& r)
      : config(c),
        run(r),
        samples(kSegments, kKept, sample_segment(c.seconds)),
        images(image_tape(c, r)),
        last_number(highest_number(c.folder)) {
    std::error_code later;  // who cannot write finds out when he has to
    fs::create_directories(config.folder, later);
    report.memory_bytes = samples.memory_bytes() + (images ? images->memory_bytes() : 0);
    if (!writer.start(
            {"recorder", 0, -1}, [](void* self) { static_cast<Impl*>(self)->write_all(); }, this))
      throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  }
  ~Impl() { stop(); }

  RecorderConfig config;
  RecordedRun run;
  Tape samples;
  std::optional<Tape> images;
  SpscRing<RecordOrder, 2> orders;
  std::atomic<bool> busy{false};  ///< set with an order, cleared when it is done
  std::atomic<bool> stopping{false};
  EventRing events;
  Parking parking;

  // The log thread's own.
  HostStamp now;
  HealthState state = HealthState::kInitialising;
  std::uint32_t resets = 0;
  std::optional<HostStamp> lost_due;     ///< a record is to be made then
  bool lost_now = false;                 ///< its first part is to be made as soon as possible
  bool lost_begun = false;               ///< ... and was
  std::optional<HostStamp> lost_before;  ///< the last one made for that reason
  int made_for_lost = 0;

  // The writer's own until it has ended.
  std::uint64_t last_number;
  fs::path first_part;  ///< of the newest loss; empty: none on the disk
  std::uint64_t first_number = 0;
  RecorderReport report;

  RealtimeThread writer;

  // Log thread.

  void begin(RecordReason reason, RecordPart part = RecordPart::kWhole) {
    RecordOrder order;
    order.reason = reason;
    order.part = part;
    order.now = now;
    order.from = now - Span::from_seconds(config.seconds);
    order.samples = samples.lend();
    if (images) order.images = images->lend();
    busy.store(true, std::memory_order_relaxed);  // the ring below hands it over
    orders.push(order);
    parking.notify();
  }

  void keep(const Frame& frame, std::size_t camera) {
    const RecordedImageHeader header{frame.stamp, frame.width, frame.height, static_cast<std::int32_t>(camera)};
    const auto width = static_cast<std::size_t>(frame.width), height = static_cast<std::size_t>(frame.height);
    std::byte* at = images->claim(static_cast<std::uint32_t>(RecordKind::kImage), sizeof header + width * height);
    if (at == nullptr) return;
    std::memcpy(at, &header, sizeof header);
    at += sizeof header;
    for (std::size_t y = 0; y < height; ++y)
      std::memcpy(at + y * width, frame.data + y * static_cast<std::size_t>(frame.stride), width);
    images->commit();
  }

  bool may_record_lost(HostStamp stamp) const {
    if (lost_due || made_for_lost >= config.most) return false;
    return !lost_before || stamp - *lost_before >= Span::from_seconds(config.pause_s);
  }

  RecordPart rest_of_lost() const { return lost_begun ? RecordPart::kSecond : RecordPart::kWhole; }

  void stop() {
    stopping.store(true, std::memory_order_release);
    parking.notify();
    writer.join();
  }

  // Writer thread.

  void write_all() {
    setpriority(PRIO_PROCESS, 0, 10);  // of this thread: decoding and logging go first
    for (bool over = false; !over;) {
      bool ends = false;
      parking.wait_until(monotonic_ns() + Span::from_milliseconds(500).ns, [&] {
        ends = stopping.load(std::memory_order_acquire);  // before the look at the ring
        return orders.front() != nullptr || ends;
      });
      over = orders.front() == nullptr && ends;
      for (RecordOrder order; orders.pop(order);) {
        write(order);
        // release, pairs with the acquire in pass(): nothing is lent any more
        busy.store(false, std::memory_order_release);
      }
    }
  }

  void write(const RecordOrder& asked) {
    RecordOrder order = asked;
    order.number = asked.part == RecordPart::kSecond ? first_number : ++last_number;
    const bool is_first = asked.part == RecordPart::kFirst;
    const char* const why = kRecordReasonNames[static_cast<std::size_t>(order.reason)];
    const fs::path name =
        fs::path(config.folder) / fmt::format("record-{:03}-{}{}", order.number, why, is_first ? "-begin" : "");
    int failure = 0;
    const Status written = write_record(order, run, samples, images ? &*images : nullptr, name, failure);
    if (is_first) {
      first_number = order.number;
      first_part = written ? name : fs::path();
      if (written) return;  // the event comes with the whole record
    } else if (asked.part == RecordPart::kSecond && written && !first_part.empty()) {
      std::error_code ignored;
      fs::remove_all(std::exchange(first_part, {}), ignored);
    }
    if (written) {
      events.push(make_event(order.now, EventId::kRecordWritten, order.number, order.reason));
      report.written.push_back(name.string());
      if (config.keep > 0) report.removed += make_room(config.folder, static_cast<std::size_t>(config.keep));
    } else {
      events.push(make_event(order.now, EventId::kRecordFailed, order.number, order.reason, failure));
      report.failed.push_back(written.error().text());
    }
  }
};

FlightRecorder::FlightRecorder(const RecorderConfig& config, const RecordedRun& run)
    : impl_(std::make_unique<Impl>(config, run)) {}
FlightRecorder::~FlightRecorder() = default;

EventRing& FlightRecorder::events() noexcept { return impl_->events; }
const RecorderReport& FlightRecorder::report() const noexcept { return impl_->report; }
bool FlightRecorder::wants_images() const noexcept { return impl_->images.has_value(); }

void FlightRecorder::imu(const ImuSample& sample) noexcept {
  impl_->samples.append(static_cast<std::uint32_t>(RecordKind::kImu), sample);
}

void FlightRecorder::wheel(const WheelSample& sample) noexcept {
  impl_->samples.append(static_cast<std::uint32_t>(RecordKind::kWheel), sample);
}

void FlightRecorder::height(const HeightSample& sample) noexcept {
  impl_->samples.append(static_cast<std::uint32_t>(RecordKind::kHeight), sample);
}

void FlightRecorder::event(const Event& event) noexcept {
  impl_->samples.append(static_cast<std::uint32_t>(RecordKind::kEvent), event);
}

void FlightRecorder::take(const FrameOutcome& outcome) noexcept {
  Impl& m = *impl_;
  m.samples.append(static_cast<std::uint32_t>(RecordKind::kState), recorded_state(outcome));
  // a reset may come without a word of being lost before: what was estimated is thrown away all the same
  const Odometry& o = outcome.odometry;
  const bool reset = std::exchange(m.resets, o.reset_counter) != o.reset_counter;
  const bool was_lost = std::exchange(m.state, o.health.state) == HealthState::kLost;
  if ((reset || (m.state == HealthState::kLost && !was_lost)) && m.may_record_lost(outcome.stamp)) {
    m.lost_due = outcome.stamp + Span::from_seconds(m.config.after_lost_s);
    m.lost_now = m.config.after_lost_s > 0;
    m.lost_begun = false;
  }
}

void FlightRecorder::tracks(const LoggedTracks& t) noexcept {
  const RecordedTracksHeader header{t.stamp, t.points.size()};
  std::byte* at = impl_->samples.claim(static_cast<std::uint32_t>(RecordKind::kTracks),
                                       sizeof header + t.points.size() * sizeof(RecordedPoint));
  if (at == nullptr) return;
  std::memcpy(at, &header, sizeof header);
  at += sizeof header;
  for (const LoggedPoint& p : t.points) {
    const RecordedPoint point{p.id, p.u, p.v};
    std::memcpy(at, &point, sizeof point);
    at += sizeof point;
  }
  impl_->samples.commit();
}

void FlightRecorder::image(const Frame& frame, const OtherFrames& others) noexcept {
  impl_->keep(frame, 0);
  for (std::size_t i = 0; i < others.size(); ++i)
    if (others[i].data != nullptr) impl_->keep(others[i], i + 1);
}

void FlightRecorder::pass(HostStamp now) noexcept {
  Impl& m = *impl_;
  m.now = now;
  if (m.busy.load(std::memory_order_acquire)) return;
  if (m.lost_due && now >= *m.lost_due) {
    m.lost_before = std::exchange(m.lost_due, std::nullopt);
    m.lost_now = false;
    ++m.made_for_lost;
    m.begin(RecordReason::kLost, m.rest_of_lost());
  } else if (std::exchange(m.lost_now, false)) {
    m.lost_begun = true;
    m.begin(RecordReason::kLost, RecordPart::kFirst);
  } else if (requested_.exchange(false, std::memory_order_relaxed)) {
    m.begin(RecordReason::kRequested);
  }
}

void FlightRecorder::finish(bool write_the_end) {
  Impl& m = *impl_;
  while (m.busy.load(std::memory_order_acquire)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const bool requested = requested_.exchange(false, std::memory_order_relaxed);
  if (m.lost_due || requested || write_the_end)
    m.begin(m.lost_due  ? RecordReason::kLost
            : requested ? RecordReason::kRequested
                        : RecordReason::kEnd,
            m.lost_due ? m.rest_of_lost() : RecordPart::kWhole);
  m.stop();
  m.report.lost = m.samples.lost() + (m.images ? m.images->lost() : 0);
}

}  // namespace epiline
