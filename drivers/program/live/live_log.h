#pragma once
// Results of a live flight: files that grow during the flight, and the last hour for the report.
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "drivers/study/report/flight_record.h"
#include "pipeline/realtime/flight_log.h"
#include "pipeline/text/output_files.h"
#include "platform/concurrency/parking.h"
#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// Makes FOLDER/flight-NNN, numbered on from those that are there, and removes the oldest but `keep` (0: none). Empty:
/// it cannot be made; the flight goes on without.
std::filesystem::path make_flight_folder(const std::filesystem::path& folder, std::size_t keep);

/// The log thread only fills rings; the caller of drain(), a thread without priority, does the rest.
class LiveLog final : public FlightObserver {
 public:
  /// `folder`: gets trajectory.tum and events.txt, which a thread syncs to the disk each second; empty: no files.
  /// `keeps`: the record gets all images; else nothing but the newest events, because nobody reads more.
  LiveLog(const std::filesystem::path& folder, bool keeps);
  ~LiveLog() override { stop_syncing(); }

  void take(const FrameOutcome& outcome) noexcept override { outcomes_.push(outcome); }
  void published(std::uint64_t serial, std::int64_t latency_ns) noexcept override {
    publications_.push({serial, latency_ns});
  }
  void event(const Event& event) noexcept override { events_.push(event); }
  void pass(HostStamp /*now*/) noexcept override { passes_.fetch_add(1, std::memory_order_relaxed); }
  std::uint64_t passes() const noexcept { return passes_.load(std::memory_order_relaxed); }

  /// Moves everything from the rings to the record and, one line each, to the files. One thread; call it at least twice
  /// a second.
  void drain(FlightRecord& record);
  /// After the last drain(). Fails if and only if something could not be written.
  Status close(FlightRecord& record);
  std::uint64_t syncs() const noexcept { return syncs_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kMostImages = 1 << 17, kMostEvents = 1 << 16;  // more than an hour at 30 Hz
  static constexpr std::size_t kFewEvents = 1 << 12;  // half of it is more than one drain() can bring
  void take_outcomes(FlightRecord& record);
  void take_publications(FlightRecord& record);
  void take_events(FlightRecord& record);
  void sync_each_second(const std::filesystem::path& folder);
  void stop_syncing();

  SpscRing<FrameOutcome, 256> outcomes_;
  SpscRing<Publication, 256> publications_;
  SpscRing<Event, 1024> events_;
  std::atomic<std::uint64_t> passes_{0};

  // Used by the thread of drain() only.
  std::unique_ptr<OutputFile> trajectory_, event_lines_;
  std::uint64_t first_serial_ = 0;  ///< of the record's images
  bool keeps_;

  std::atomic<std::uint64_t> syncs_{0};
  std::atomic<bool> stops_{false};
  Parking pause_;
  std::thread syncing_;
};

}  // namespace epiline
