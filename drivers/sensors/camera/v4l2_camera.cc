#include "drivers/sensors/camera/v4l2_camera.h"

#include <linux/dma-buf.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "platform/concurrency/counter.h"
#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr int kRowAlignment = 64;                             // of copies: a cache line
constexpr int kBelieved = 5;                                  // doubtful stamps in a row
constexpr Span kPeriodAtMost = Span::from_milliseconds(100);  // where the device does not tell its rate

}  // namespace

V4l2Camera::V4l2Camera(V4l2Settings settings, SystemCalls& system)
    : settings_(std::move(settings)), system_(system), stamp_line_(settings_.stamp_line, settings_.stamp_edge) {}

// ---- setting up ----

Status V4l2Camera::open() {
  if (settings_.buffers < 2 || settings_.buffers > static_cast<int>(kMostBuffers))
    return Error{ErrorKind::kUsage, settings_.device, 0, "camera.buffers = " + std::to_string(settings_.buffers),
                 "2 to 16"};
  if (Status line = stamp_line_.open(); !line) return line;
  if (!wake_up_.open()) return Error{ErrorKind::kRun, "eventfd", 0, std::strerror(errno), ""};
  if (!transfers_.start()) {
    close();
    return Error{ErrorKind::kRun, settings_.device, 0, "cannot start a thread", "a free thread (ulimit -u)"};
  }
  if (const DeviceTrouble trouble = set_up()) {
    const Error error = error_of(trouble);
    close();
    return error;
  }
  identity_ = device_.identity();
  opened_ = true;
  return Done{};
}

/// The camera that was lost, and no other. It may have another number now: plugged in while images of before are lent,
/// what was /dev/video0 comes back as another file.
DeviceTrouble V4l2Camera::find_again() noexcept {
  const DeviceTrouble trouble = device_.open(settings_.device.c_str());
  // a path made of the serial number tells more than the place it is plugged in at
  const bool is_known_by_path = settings_.device.rfind("/dev/v4l/by-id/", 0) == 0;
  if (!trouble && (is_known_by_path ? device_.identity().card == identity_.card : device_.identity() == identity_))
    return {};
  const DeviceTrouble absent = device_.open(identity_);
  if (!absent || trouble) return absent ? trouble : absent;
  bump(other_camera_);
  return absent;
}

/// Called again for a lost device, which must come back with the same image: readers know its size.
DeviceTrouble V4l2Camera::set_up() noexcept {
  if (const DeviceTrouble trouble = opened_ ? find_again() : device_.open(settings_.device.c_str())) return trouble;
  if (const DeviceTrouble trouble = device_.set_graph(settings_.sensor.c_str())) return trouble;
  DeviceFormat format;
  if (const DeviceTrouble trouble = device_.set_format(settings_, format)) return trouble;
  const bool is_lent = is_grey_in_place(format.format) && !device_.is_loopback();
  if (is_lent && !opened_)
    if (const DeviceTrouble trouble = measure_reading(format)) return trouble;
  const bool copies = !is_lent || reading_.is_slow();
  if (!opened_) {
    copies_ = copies;
    if (copies_) {
      const int stride = (format.grey_width() + kRowAlignment - 1) / kRowAlignment * kRowAlignment;
      const std::size_t bytes = static_cast<std::size_t>(stride) * static_cast<std::size_t>(format.grey_height());
      copies_memory_.resize(bytes * static_cast<std::size_t>(settings_.buffers));
      for (std::size_t i = 0; i < static_cast<std::size_t>(settings_.buffers); ++i)
        slots_[i].memory = {copies_memory_.data() + i * bytes, bytes};
      if (format.format == PixelFormat::kMjpeg) jpeg_ = std::make_unique<JpegDecoder>(format.width, format.height);
    }
  } else if (format.grey_width() != format_.grey_width() || format.grey_height() != format_.grey_height() ||
             copies != copies_ || (format.format == PixelFormat::kMjpeg) != (jpeg_ != nullptr)) {
    DeviceTrouble trouble;
    trouble.step = "the camera returned with another image size or format";
    return trouble;
  }
  format_ = format;
  if (const DeviceTrouble trouble = device_.set_controls(settings_)) return trouble;
  if (const DeviceTrouble trouble = repeat_changes()) return trouble;
  if (const DeviceTrouble trouble = exposure_.set_up(device_)) return trouble;
  // first: uvcvideo sets no format of metadata once the camera has buffers
  if (const DeviceTrouble trouble = clock_.open(device_)) return trouble;
  if (const DeviceTrouble trouble = map_buffers()) return trouble;
  if (const DeviceTrouble trouble = device_.start()) return trouble;
  ++stream_;
  is_first_of_stream_ = true;
  forget_stamps();
  stamp_line_.restart();
  last_image_ns_ = system_.now_ns();
  streaming_.store(true, std::memory_order_relaxed);
  return {};
}

// ---- controls, while it streams ----

bool V4l2Camera::request_control(std::string_view name, std::int64_t value) noexcept {
  ControlChange change;
  if (name.size() >= change.name.size()) return false;
  std::copy(name.begin(), name.end(), change.name.begin());
  change.value = value;
  return requests_.push(change);
}

/// The next request, or what the exposure controller wants, if none is under way.
void V4l2Camera::begin_transfer() noexcept {
  if (!transfers_.is_idle() || !device_.is_open()) return;
  ControlJob job;
  ControlChange change;
  if (again_) {
    job = *std::exchange(again_, std::nullopt);
  } else if (requests_.pop(change)) {
    job.is_request = true;
    job.entries[job.count++] = {.name = change.name, .facts = {}, .wanted = change.value};
  } else if (!exposure_.next_change(job)) {
    return;
  }
  job.stream = stream_;
  if (transfers_.begin(device_.controls(), job)) return;
  job.is_request ? answer(job) : exposure_.ended(job);
}

void V4l2Camera::end_transfer() noexcept {
  ControlJob job;
  if (!transfers_.take(job)) return;
  const bool is_of_this_stream = job.stream == stream_;
  if (!job.is_request) {
    if (is_of_this_stream) exposure_.ended(job);
  } else if (is_of_this_stream) {
    answer(job);
  } else {  // the device that is back was set up without it
    again_ = job;
    again_->entries[0].facts = {};
  }
}

void V4l2Camera::answer(const ControlJob& job) noexcept {
  const ControlJob::Entry& entry = job.entries[0];
  answers_.push({entry.name, entry.value, job.is_set});
  if (!job.is_set) return;
  exposure_.changed(entry.facts.id, entry.value, job.at);
  // set again to what was asked for: a device may answer with something else
  const ControlChange wanted{entry.name, entry.wanted, true};
  ControlChange* known =
      std::find_if(changes_.begin(), changes_.end(), [&](const ControlChange& c) { return c.name == wanted.name; });
  if (known != changes_.end())
    *known = wanted;
  else
    changes_.push_back(wanted);
}

DeviceTrouble V4l2Camera::repeat_changes() noexcept {
  for (const ControlChange& change : changes_) {
    ControlFacts facts;
    if (const DeviceTrouble trouble = device_.controls().find(change.name.data(), facts)) return trouble;
    const ControlValue one{&facts, change.name.data(), change.value};
    if (const DeviceTrouble trouble = device_.controls().write({&one, 1})) return trouble;
  }
  return {};
}

// ---- buffers ----

DeviceTrouble V4l2Camera::measure_reading(const DeviceFormat& format) {
  unsigned count = 1;
  if (const DeviceTrouble trouble = device_.request_buffers(count)) return trouble;
  Memory memory;
  if (const DeviceTrouble trouble = device_.map(0, memory.data, memory.length, stamp_flags_)) return trouble;
  const std::size_t bytes =
      std::min(memory.length, image_bytes(format.format, format.width, format.height, format.stride));
  const std::vector<std::uint8_t> ordinary(bytes, 1);
  reading_.in_place = system_.read_time(memory.data, bytes);
  reading_.ordinary = system_.read_time(ordinary.data(), bytes);
  system_.unmap(memory.data, memory.length);
  count = 0;
  return device_.request_buffers(count);
}

DeviceTrouble V4l2Camera::map_buffers() noexcept {
  unsigned count = copies_ ? kBuffersWhenCopying : static_cast<unsigned>(settings_.buffers);
  if (const DeviceTrouble trouble = device_.request_buffers(count)) return trouble;
  buffer_count_ = 0;
  for (unsigned i = 0; i < std::min<unsigned>(count, kMostBuffers); ++i) {
    const int slot = copies_ ? 0 : free_slot();
    if (slot < 0) break;  // images of the stream before are still lent: fewer buffers for this one
    Memory memory;
    if (const DeviceTrouble trouble = device_.map(i, memory.data, memory.length, stamp_flags_)) return trouble;
    buffer_count_ = i + 1;
    if (copies_) {
      if (reading_.is_slow()) memory.file = device_.export_buffer(i);
      buffers_[i] = memory;
    } else {
      slot_of_[i] = slot;
      Slot& s = slots_[static_cast<std::size_t>(slot)];
      s.memory = memory;
      s.buffer = i;
      s.is_stale = false;
      s.state.store(SlotState::kWithDriver, std::memory_order_relaxed);
    }
    if (memory.length < image_bytes(format_.format, format_.width, format_.height, format_.stride)) {
      DeviceTrouble trouble;
      trouble.step = "the driver's buffers are smaller than an image";
      return trouble;
    }
    if (const DeviceTrouble trouble = device_.queue(i)) return trouble;
  }
  DeviceTrouble trouble;
  if (buffer_count_ < 2) {
    trouble.step = "the driver has fewer than 2 buffers";
  } else if ((stamp_flags_ & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC &&
             !settings_.trust_stamps) {
    trouble.step = "its driver does not declare monotonic timestamps";
    std::snprintf(trouble.expected, sizeof(trouble.expected),
                  "monotonic timestamps; camera.trust_stamps = true if they are");
  }
  return trouble;
}

Error V4l2Camera::error_of(const DeviceTrouble& trouble) const { return epiline::error_of(trouble, device_.path()); }

// ---- losing it, and getting it back ----

/// Ends the stream. Images that are lent stay mapped until they are given back.
void V4l2Camera::tear_down() noexcept {
  streaming_.store(false, std::memory_order_relaxed);
  if (device_.is_open()) device_.stop();
  clock_.close();
  for (std::size_t i = 0; i < buffer_count_ && copies_; ++i) {
    if (buffers_[i].data != nullptr) system_.unmap(buffers_[i].data, buffers_[i].length);
    if (buffers_[i].file >= 0) system_.close(buffers_[i].file);
    buffers_[i] = {};
  }
  for (Slot& slot : slots_) {
    if (copies_ || slot.memory.data == nullptr) continue;
    slot.is_stale = true;
    if (slot.state.load(std::memory_order_relaxed) == SlotState::kWithDriver)
      slot.state.store(SlotState::kReturned, std::memory_order_relaxed);
  }
  collect_returned();
  buffer_count_ = 0;
  device_.close();
}

void V4l2Camera::lose(int error) noexcept {
  tear_down();
  bump(disconnected_);
  last_error_.store(error, std::memory_order_relaxed);
  retry_.begin(system_.now_ns());
}

bool V4l2Camera::reopen() noexcept {
  collect_returned();
  const DeviceTrouble trouble = set_up();
  if (!trouble) return true;
  tear_down();
  bump(retries_);
  last_error_.store(trouble.error, std::memory_order_relaxed);
  retry_.failed(system_.now_ns());
  return false;
}

void V4l2Camera::close() noexcept {
  stamp_line_.close();
  transfers_.stop();
  again_.reset();
  if (!wake_up_.is_open()) return;
  for (Slot& slot : slots_)
    if (slot.state.load(std::memory_order_acquire) == SlotState::kLent)
      slot.state.store(SlotState::kReturned, std::memory_order_relaxed);
  tear_down();
  wake_up_.close();
  opened_ = false;
  reading_ = {};
  copies_memory_ = {};
  jpeg_.reset();
  for (Slot& slot : slots_) slot.memory = {};
}

// ---- images ----

ReadOutcome V4l2Camera::read(Frame& frame, Span timeout) noexcept {
  EPILINE_EXPECTS(opened_, "open() before read()");
  const std::int64_t deadline_ns = system_.now_ns() + timeout.ns;
  if (!is_streaming()) {
    const std::int64_t now_ns = system_.now_ns();
    if (now_ns < retry_.due_ns()) {
      wait({std::min(retry_.due_ns(), deadline_ns) - now_ns});
      if (system_.now_ns() < retry_.due_ns()) return ReadOutcome::kFailed;
    }
    if (!reopen()) return ReadOutcome::kFailed;
  }
  end_transfer();
  begin_transfer();
  for (bool is_well = true;;) {
    const ReadOutcome outcome = collect_returned() ? take(frame) : ReadOutcome::kFailed;
    const std::int64_t now_ns = system_.now_ns();
    if (outcome == ReadOutcome::kTimeout && (!is_well || is_silent(now_ns))) {
      lose(is_well ? 0 : EIO);
      return ReadOutcome::kFailed;
    }
    if (outcome != ReadOutcome::kTimeout || now_ns >= deadline_ns) return outcome;
    is_well = wait({deadline_ns - now_ns});
  }
}

bool V4l2Camera::is_silent(std::int64_t now_ns) const noexcept {
  return settings_.silence_most.ns > 0 && now_ns - last_image_ns_ > settings_.silence_most.ns;
}

/// Until an image is ready, one was given back, or the time is over. False: the device reports an error, which the next
/// take() will name.
bool V4l2Camera::wait(Span at_most) noexcept {
  std::size_t with_driver = copies_ ? buffer_count_ : 0;
  for (const Slot& slot : slots_)
    with_driver += slot.state.load(std::memory_order_relaxed) == SlotState::kWithDriver ? 1 : 0;
  // without a buffer the driver reports an error that is none
  const bool asks_device = device_.is_open() && with_driver > 0;
  std::array<pollfd, 2> files{{{wake_up_.fd(), POLLIN, 0}, {device_.fd(), POLLIN, 0}}};
  system_.wait({files.data(), asks_device ? 2U : 1U}, at_most);
  if (files[0].revents != 0) wake_up_.clear();
  return (files[1].revents & (POLLERR | POLLHUP | POLLNVAL)) == 0;
}

void V4l2Camera::give_back(const Frame& frame) noexcept {
  EPILINE_EXPECTS(frame.slot >= 0 && frame.slot < static_cast<int>(kSlots), "an image of this camera");
  Slot& slot = slots_[static_cast<std::size_t>(frame.slot)];
  // release, pairs with the acquire in collect_returned(): the last look at the pixels comes before the driver writes
  const SlotState before = slot.state.exchange(SlotState::kReturned, std::memory_order_release);
  EPILINE_EXPECTS(before == SlotState::kLent, "an image is given back once");
  wake_up_.notify();
}

/// False: the device is lost.
bool V4l2Camera::collect_returned() noexcept {
  for (Slot& slot : slots_) {
    if (slot.state.load(std::memory_order_acquire) != SlotState::kReturned) continue;  // pairs with give_back()
    if (copies_) {
      slot.state.store(SlotState::kFree, std::memory_order_relaxed);
    } else if (slot.is_stale) {
      system_.unmap(slot.memory.data, slot.memory.length);
      slot.memory = {};
      slot.state.store(SlotState::kFree, std::memory_order_relaxed);
    } else {
      slot.state.store(SlotState::kWithDriver, std::memory_order_relaxed);
      if (const DeviceTrouble trouble = device_.queue(slot.buffer)) {
        lose(trouble.error);
        return false;
      }
    }
  }
  return true;
}

ReadOutcome V4l2Camera::take(Frame& frame) noexcept {
  exposure_.note_changes(device_);
  // a bad image is as long on the way as a good one: the next is not there yet, so this ends
  for (;;) {
    v4l2_buffer buffer;
    const int error = device_.dequeue(buffer);
    if (error == EAGAIN) return ReadOutcome::kTimeout;
    if (error != 0 || buffer.index >= buffer_count_) {
      lose(error);
      return ReadOutcome::kFailed;
    }
    last_image_ns_ = system_.now_ns();
    Slot* lending = copies_ ? nullptr : &slots_[static_cast<std::size_t>(slot_of_[buffer.index])];
    if (lending != nullptr && lending->state.load(std::memory_order_relaxed) != SlotState::kWithDriver) {
      bump(overwritten_);
      continue;
    }
    end_transfer();
    number(frame, buffer.sequence);
    const bool is_good = is_sound(buffer) && stamp(frame, buffer) && fill(frame, buffer);
    if (is_good && lending != nullptr) {
      lending->state.store(SlotState::kLent, std::memory_order_relaxed);  // whoever gets it is told by this thread
    } else if (const DeviceTrouble trouble = device_.queue(buffer.index)) {
      lose(trouble.error);
      if (!is_good) return ReadOutcome::kFailed;
    }
    if (!is_good) continue;
    exposure_.look(frame);
    bump(frames_);
    return ReadOutcome::kSample;
  }
}

bool V4l2Camera::is_sound(const v4l2_buffer& buffer) noexcept {
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) {
    bump(damaged_);
    return false;
  }
  if (buffer.bytesused < image_bytes(format_.format, format_.width, format_.height, format_.stride)) {
    bump(incomplete_);
    return false;
  }
  return true;
}

bool V4l2Camera::stamp(Frame& frame, const v4l2_buffer& buffer) noexcept {
  const bool is_monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  const HostStamp given{static_cast<std::int64_t>(buffer.timestamp.tv_sec) * 1'000'000'000 +
                        static_cast<std::int64_t>(buffer.timestamp.tv_usec) * 1'000};
  frame.arrival = HostStamp{system_.now_ns()};
  const std::int64_t age_ns = (frame.arrival - given).ns;
  const bool is_recent = settings_.trust_stamps || std::abs(age_ns) < settings_.stamp_age_most.ns;
  if ((!is_monotonic && !settings_.trust_stamps) || !is_recent || !is_credible(given, frame.arrival)) {
    bump(bad_stamps_);
    return false;
  }
  HostStamp taken = given;
  if (!clock_.stamp(buffer.sequence, taken)) {
    bump(bad_stamps_);
    return false;
  }
  const bool is_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  const StampPoint declared = is_start                     ? StampPoint::kStartOfExposure
                              : device_.stamps_first_row() ? StampPoint::kFirstRow
                                                           : StampPoint::kEndOfFrame;
  const Span exposure = exposure_.time_of(given, frame.sequence);
  HostStamp start = taken + to_start_of_exposure(settings_.stamp_point.value_or(declared), exposure, settings_.readout);
  if (!stamp_line_.stamp(frame.sequence, start)) {
    bump(no_edge_);
    return false;
  }
  frame.stamp = start + to_mid_exposure(StampPoint::kStartOfExposure, settings_.shutter, exposure, settings_.readout);
  return true;
}

/// Later than the one before, and not earlier on its way than any by more than a period: drivers compute the end of a
/// frame, and hand the image out before it. One stamp that is not so is wrong. Of several in a row, each later than the
/// one before, it is the clock that was set.
bool V4l2Camera::is_credible(HostStamp given, HostStamp arrival) noexcept {
  const Span delay = arrival - given;
  const Span period = format_.rate_hz > 0 ? Span::from_seconds(1 / format_.rate_hz) : kPeriodAtMost;
  const bool is_ahead = least_delay_ && delay < *least_delay_ - period;
  if (given > last_stamp_ && !is_ahead) {
    least_delay_ = least_delay_ ? std::min(*least_delay_, delay) : delay;
  } else {
    doubted_ = doubted_ > 0 && given > last_doubted_ ? doubted_ + 1 : 1;
    last_doubted_ = given;
    if (doubted_ < kBelieved) return false;
    least_delay_ = delay;
  }
  doubted_ = 0;
  last_stamp_ = given;
  return true;
}

void V4l2Camera::forget_stamps() noexcept {
  last_stamp_ = {std::numeric_limits<std::int64_t>::min()};
  doubted_ = 0;
  // the kernel's clock is ours; of another one the first image tells
  least_delay_ = settings_.trust_stamps ? std::nullopt : std::optional(Span{});
}

/// The driver's number counts 32 bits, begins anew with each stream, and with some drivers does not move at all.
void V4l2Camera::number(Frame& frame, std::uint32_t sequence) noexcept {
  std::uint64_t step = 1;
  if (is_first_of_stream_) {
    step = frames_.load(std::memory_order_relaxed) > 0 ? 2 : 0;  // nobody knows how many were lost between
    is_first_of_stream_ = false;
  } else {
    const std::uint32_t passed = sequence - driver_sequence_;
    if (passed > 1 && passed < 0x80000000u) {
      step = passed;
      bump(lost_, passed - 1);
    }
  }
  driver_sequence_ = sequence;
  sequence_ += step;
  frame.sequence = sequence_;
}

/// Where caches must be brought up to date for reading, the kernel does it then.
void V4l2Camera::announce_reading(const Memory& buffer, bool begins) const noexcept {
  if (buffer.file < 0) return;
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ;
  sync.flags |= begins ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END;
  call_device(system_, buffer.file, DMA_BUF_IOCTL_SYNC, &sync);
}

bool V4l2Camera::fill(Frame& frame, const v4l2_buffer& buffer) noexcept {
  frame.width = format_.grey_width();
  frame.height = format_.grey_height();
  if (!copies_) {
    frame.slot = slot_of_[buffer.index];
    frame.data = slots_[static_cast<std::size_t>(frame.slot)].memory.data;
    frame.stride = format_.stride;
    return true;
  }
  const int slot = free_slot();
  if (slot < 0) {
    bump(no_slot_);
    return false;
  }
  Slot& s = slots_[static_cast<std::size_t>(slot)];
  frame.slot = slot;
  frame.stride = static_cast<int>(s.memory.length / static_cast<std::size_t>(frame.height));
  const std::uint8_t* const from = buffers_[buffer.index].data;
  if (!jpeg_) {
    announce_reading(buffers_[buffer.index], true);
    to_grey(format_.format, from, format_.stride, format_.width, format_.height, s.memory.data, frame.stride);
    announce_reading(buffers_[buffer.index], false);
  } else if (!jpeg_->decode(from, std::min<std::size_t>(buffer.bytesused, buffers_[buffer.index].length), s.memory.data,
                            frame.stride)) {
    bump(damaged_);
    return false;
  }
  frame.data = s.memory.data;
  s.state.store(SlotState::kLent, std::memory_order_relaxed);
  return true;
}

int V4l2Camera::free_slot() const noexcept {
  const std::size_t count = copies_ ? static_cast<std::size_t>(settings_.buffers) : kSlots;
  for (std::size_t i = 0; i < count; ++i)
    if (slots_[i].state.load(std::memory_order_relaxed) == SlotState::kFree) return static_cast<int>(i);
  return -1;
}

CameraCounts V4l2Camera::counts() const noexcept {
  const auto value = [](const Counter& counter) { return counter.load(std::memory_order_relaxed); };
  CameraCounts counts;
  counts.frames = value(frames_);
  counts.lost = value(lost_);
  counts.damaged = value(damaged_);
  counts.incomplete = value(incomplete_);
  counts.bad_stamps = value(bad_stamps_);
  counts.no_edge = value(no_edge_);
  counts.without_clock = clock_.without_clock();
  counts.bad_metadata = clock_.bad_metadata();
  counts.no_slot = value(no_slot_);
  counts.overwritten = value(overwritten_);
  counts.disconnected = value(disconnected_);
  counts.retries = value(retries_);
  counts.other_camera = value(other_camera_);
  counts.last_error = last_error_.load(std::memory_order_relaxed);
  return counts;
}

}  // namespace epiline
