#include "drivers/sensors/camera/v4l2_camera.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr int kRowAlignment = 64;                             // of copies: a cache line
constexpr Span kPeriodAtMost = Span::from_milliseconds(100);  // where the device does not tell its rate

bool is_monotonic(std::uint32_t flags) noexcept {
  return (flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
}

}  // namespace

V4l2Camera::V4l2Camera(V4l2Settings settings, SystemCalls& system)
    : settings_(std::move(settings)), system_(system), stamp_line_(settings_.stamp_line, settings_.stamp_edge) {}

// ---- setting up ----

Status V4l2Camera::open() {
  if (settings_.buffers < 2 || settings_.buffers > static_cast<int>(kMostBuffers))
    return Error{ErrorKind::kUsage, settings_.device, 0, "buffers = " + std::to_string(settings_.buffers), "2 to 16"};
  if (Status line = stamp_line_.open(); !line) return line;
  if (!wake_up_.open()) return Error{ErrorKind::kRun, "eventfd", 0, std::strerror(errno), ""};
  if (!requests_.start()) {
    close();
    return Error{ErrorKind::kRun, settings_.device, 0, "cannot start a thread", "a free thread (ulimit -u)"};
  }
  if (const DeviceTrouble trouble = set_up()) {
    const Error error = error_of(trouble, device_.path());
    close();
    return error;
  }
  identity_ = device_.identity();
  opened_ = true;
  return Done{};
}

DeviceTrouble V4l2Camera::find_again() noexcept {
  bool is_other = false;
  const DeviceTrouble trouble =
      device_.open_again(settings_.device.c_str(), settings_.sensor.c_str(), identity_, is_other);
  if (is_other) ++counts_.other_camera;
  return trouble;
}

/// Called again for a lost device, which must come back with the same image: readers know its size.
DeviceTrouble V4l2Camera::set_up() noexcept {
  const char* const sensor = settings_.sensor.c_str();
  if (const DeviceTrouble trouble = opened_ ? find_again() : device_.open(settings_.device.c_str(), sensor))
    return trouble;
  if (const DeviceTrouble trouble = device_.set_graph(sensor)) return trouble;
  DeviceFormat format;
  if (const DeviceTrouble trouble = device_.set_format(settings_, format)) return trouble;
  const bool is_lent = is_grey_in_place(format.format) && !device_.is_loopback();
  if (is_lent && !opened_)
    if (const DeviceTrouble trouble = measure_reading(device_, system_, format, reading_)) return trouble;
  const bool copies = !is_lent || reading_.is_slow();
  if (!opened_) {
    copies_ = copies;
    if (copies_) {
      const int stride = (format.grey_width() + kRowAlignment - 1) / kRowAlignment * kRowAlignment;
      const std::size_t bytes = static_cast<std::size_t>(stride) * static_cast<std::size_t>(format.grey_height());
      copies_memory_.resize(bytes * static_cast<std::size_t>(settings_.buffers));
      for (std::size_t i = 0; i < static_cast<std::size_t>(settings_.buffers); ++i)
        slots_[i].memory = {copies_memory_.data() + i * bytes, bytes};
      grey_copies_.set_format(format);
    }
  } else if (format.grey_width() != format_.grey_width() || format.grey_height() != format_.grey_height() ||
             copies != copies_ || !grey_copies_.can_copy(format)) {
    return device_refusal("the camera returned with another image size or format", 0);
  }
  format_ = format;
  device_.hold_focus();  // before camera.controls, which may want otherwise
  if (const DeviceTrouble trouble = device_.set_controls(settings_)) return trouble;
  focus_.store(device_.focus(), std::memory_order_relaxed);
  if (const DeviceTrouble trouble = requests_.begin_stream(device_)) return trouble;
  if (const DeviceTrouble trouble = exposure_.set_up(device_)) return trouble;
  // first: uvcvideo sets no format of metadata once the camera has buffers
  if (const DeviceTrouble trouble = clock_.open(device_)) return trouble;
  const HostStamp prepared{system_.now_ns()};
  if (const DeviceTrouble trouble = map_buffers()) return trouble;
  const HostStamp begun{system_.now_ns()};
  if (const DeviceTrouble trouble = device_.start()) return trouble;
  driver_stamps_.restart(!settings_.trust_stamps, prepared, begun);
  stamp_line_.restart();
  last_image_ns_ = system_.now_ns();
  streaming_.store(true, std::memory_order_relaxed);
  return {};
}

// ---- buffers ----

DeviceTrouble V4l2Camera::map_buffers() noexcept {
  unsigned count = copies_ ? kBuffersWhenCopying : static_cast<unsigned>(settings_.buffers);
  if (const DeviceTrouble trouble = device_.request_buffers(count)) return trouble;
  buffer_count_ = 0;
  for (unsigned i = 0; i < std::min<unsigned>(count, kMostBuffers); ++i) {
    const int slot = copies_ ? 0 : free_slot();
    if (slot < 0) break;  // images of the stream before are still lent: fewer buffers for this one
    DriverMemory memory;
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
    if (memory.length < image_bytes(format_.format, format_.width, format_.height, format_.stride))
      return device_refusal("the driver's buffers are smaller than an image", 0);
    if (const DeviceTrouble trouble = device_.queue(i)) return trouble;
  }
  if (buffer_count_ < 2) return device_refusal("the driver has fewer than 2 buffers", 0);
  if (is_monotonic(stamp_flags_) || settings_.trust_stamps) return {};
  return device_refusal("its driver does not declare monotonic timestamps", 0,
                        "monotonic timestamps; camera.trust_stamps = true if they are");
}

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
  ++counts_.disconnected;
  counts_.last_error = error;
  retry_.begin(system_.now_ns());
}

bool V4l2Camera::reopen() noexcept {
  collect_returned();
  const DeviceTrouble trouble = set_up();
  if (!trouble) return true;
  tear_down();
  ++counts_.retries;
  counts_.last_error = trouble.error;
  retry_.failed(system_.now_ns());
  return false;
}

void V4l2Camera::close() noexcept {
  stamp_line_.close();
  requests_.stop();
  if (!wake_up_.is_open()) return;
  for (Slot& slot : slots_)
    if (slot.state.load(std::memory_order_acquire) == SlotState::kLent)
      slot.state.store(SlotState::kReturned, std::memory_order_relaxed);
  tear_down();
  wake_up_.close();
  opened_ = false;
  reading_ = {};
  copies_memory_ = {};
  grey_copies_.clear();
  for (Slot& slot : slots_) slot.memory = {};
}

// ---- images ----

ReadOutcome V4l2Camera::read(Frame& frame, Span timeout) noexcept {
  EPILINE_EXPECTS(opened_, "open() before read()");
  const ReadOutcome outcome = read_until(system_.now_ns() + timeout.ns, frame);
  counts_.without_clock = clock_.without_clock();
  counts_.bad_metadata = clock_.bad_metadata();
  shown_counts_.write(counts_);
  return outcome;
}

ReadOutcome V4l2Camera::read_until(std::int64_t deadline_ns, Frame& frame) noexcept {
  if (!is_streaming()) {
    const std::int64_t now_ns = system_.now_ns();
    if (now_ns < retry_.due_ns()) {
      wait({std::min(retry_.due_ns(), deadline_ns) - now_ns});
      if (system_.now_ns() < retry_.due_ns()) return ReadOutcome::kFailed;
    }
    if (!reopen()) return ReadOutcome::kFailed;
  }
  requests_.look();
  requests_.begin_next(device_);
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
      ++counts_.overwritten;
      continue;
    }
    requests_.look();
    counts_.lost += driver_stamps_.count(buffer.sequence);
    frame.sequence = driver_stamps_.sequence();
    const bool is_good = is_sound(buffer) && stamp(frame, buffer) && fill(frame, buffer);
    if (is_good && lending != nullptr) {
      lending->state.store(SlotState::kLent, std::memory_order_relaxed);  // whoever gets it is told by this thread
    } else if (const DeviceTrouble trouble = device_.queue(buffer.index)) {
      lose(trouble.error);
      if (!is_good) return ReadOutcome::kFailed;
    }
    if (!is_good) continue;
    exposure_.look(frame);
    if (follower_ != nullptr) follower_->exposure_.follow(exposure_.setting());
    ++counts_.frames;
    return ReadOutcome::kSample;
  }
}

bool V4l2Camera::is_sound(const v4l2_buffer& buffer) noexcept {
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) {
    ++counts_.damaged;
    return false;
  }
  if (buffer.bytesused < image_bytes(format_.format, format_.width, format_.height, format_.stride)) {
    ++counts_.incomplete;
    return false;
  }
  return true;
}

bool V4l2Camera::stamp(Frame& frame, const v4l2_buffer& buffer) noexcept {
  const HostStamp given{static_cast<std::int64_t>(buffer.timestamp.tv_sec) * 1'000'000'000 +
                        static_cast<std::int64_t>(buffer.timestamp.tv_usec) * 1'000};
  if (driver_stamps_.is_from_before(given)) return false;  // not counted: the stream lacks nothing
  frame.arrival = HostStamp{system_.now_ns()};
  const std::int64_t age_ns = (frame.arrival - given).ns;
  const bool is_recent = settings_.trust_stamps || std::abs(age_ns) < settings_.stamp_age_most.ns;
  const Span period = format_.rate_hz > 0 ? Span::from_seconds(1 / format_.rate_hz) : kPeriodAtMost;
  HostStamp taken = given;
  if ((!is_monotonic(buffer.flags) && !settings_.trust_stamps) || !is_recent ||
      !driver_stamps_.is_credible(given, frame.arrival, period) || !clock_.stamp(buffer.sequence, taken)) {
    ++counts_.bad_stamps;
    return false;
  }
  const bool is_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  const StampPoint declared = is_start                     ? StampPoint::kStartOfExposure
                              : device_.stamps_first_row() ? StampPoint::kFirstRow
                                                           : StampPoint::kEndOfFrame;
  const Span exposure = exposure_.time_of(given, frame.sequence);
  HostStamp start = taken + to_start_of_exposure(settings_.stamp_point.value_or(declared), exposure, settings_.readout);
  if (!stamp_line_.stamp(frame.sequence, start)) {
    ++counts_.no_edge;
    return false;
  }
  frame.stamp = start + to_mid_exposure(StampPoint::kStartOfExposure, settings_.shutter, exposure, settings_.readout);
  return true;
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
    ++counts_.no_slot;
    return false;
  }
  Slot& s = slots_[static_cast<std::size_t>(slot)];
  frame.slot = slot;
  frame.stride = static_cast<int>(s.memory.length / static_cast<std::size_t>(frame.height));
  if (!grey_copies_.copy(format_, buffers_[buffer.index], buffer.bytesused, s.memory.data, frame.stride)) {
    ++counts_.damaged;
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

}  // namespace epiline
