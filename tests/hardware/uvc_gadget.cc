#include "tests/hardware/uvc_gadget.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/usb/gadgetfs.h>
#include <poll.h>
#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <vector>

#include "tests/hardware/support.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

const std::string kFolder = "/dev/gadget";
constexpr std::uint32_t kImageSize = UvcGadget::kWidth * UvcGadget::kHeight, kPayload = 4096, kHeader = 12;
constexpr std::uint8_t kFrameId = 0x01, kEnd = 0x02, kImageTime = 0x04, kClock = 0x08, kHeaderEnds = 0x80;

void put(Bytes& to, std::uint64_t number, int size) {
  for (int i = 0; i < size; ++i) to.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
}
void put(Bytes& to, std::initializer_list<int> bytes) {
  for (const int byte : bytes) to.push_back(static_cast<std::uint8_t>(byte));
}

Bytes endpoint(std::uint16_t packet) {
  Bytes d;
  put(d, {7, 5, 0x81, 2});  // bulk, to the host
  put(d, packet, 2);
  put(d, {0});
  return d;
}

/// One interface of control with a camera and the way out of it, one of images: grey, one size, one rate.
Bytes configuration(std::uint16_t packet) {
  Bytes d;
  put(d, {9, 2, 0, 0, 2, 1, 0, 0x80, 50});
  put(d, {8, 11, 0, 2, 14, 3, 0, 0});
  put(d, {9, 4, 0, 0, 0, 14, 1, 0, 0});
  put(d, {13, 0x24, 1, 0x10, 1, 37, 0});
  put(d, UvcGadget::kClock_hz, 4);
  put(d, {1, 1});
  put(d, {15, 0x24, 2, 1, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  put(d, {9, 0x24, 3, 2, 1, 1, 0, 1, 0});
  put(d, {9, 4, 1, 0, 1, 14, 2, 0, 0});
  put(d, {14, 0x24, 1, 1, 71, 0, 0x81, 0, 2, 0, 0, 0, 1, 0});
  put(d,
      {27, 0x24, 4, 1, 1, 'Y', '8', '0', '0', 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71, 8, 1, 0, 0, 0, 0});
  put(d, {30, 0x24, 5, 1, 0});
  put(d, UvcGadget::kWidth, 2);
  put(d, UvcGadget::kHeight, 2);
  const std::uint32_t bits_per_s = kImageSize * 8 * 10, interval = UvcGadget::kPeriod_ns / 100;
  put(d, bits_per_s, 4);
  put(d, bits_per_s, 4);
  put(d, kImageSize, 4);
  put(d, interval, 4);
  put(d, {1});
  put(d, interval, 4);
  const Bytes end = endpoint(packet);
  d.insert(d.end(), end.begin(), end.end());
  d[2] = static_cast<std::uint8_t>(d.size());
  return d;
}

/// Descriptors in the order of gadgetfs: configuration at full speed, configuration at high speed, device.
Bytes description() {
  Bytes d;
  put(d, 0, 4);
  for (const std::uint16_t packet : {std::uint16_t{64}, std::uint16_t{512}}) {
    const Bytes one = configuration(packet);
    d.insert(d.end(), one.begin(), one.end());
  }
  put(d, {18, 1, 0, 2, 0xef, 2, 1, 64, 0x09, 0x12, 2, 0, 0, 1, 0, 0, 0, 1});
  return d;
}

/// The only stream there is, which the host may agree to.
Bytes offered_stream() {
  Bytes d;
  put(d, {0, 0, 1, 1});
  put(d, UvcGadget::kPeriod_ns / 100, 4);
  put(d, 0, 8);
  put(d, 0, 2);
  put(d, kImageSize, 4);
  put(d, kPayload, 4);
  put(d, UvcGadget::kClock_hz, 4);
  put(d, {3, 1, 1, 1});
  return d;
}

std::uint32_t number_of(const std::uint8_t* first_row) {
  std::uint32_t number = 0;
  std::memcpy(&number, first_row, sizeof(number));
  return number;
}

}  // namespace

bool UvcGadget::can_be_had() {
  return fs::exists("/sys/bus/usb/drivers/uvcvideo") && fs::exists("/sys/module/gadgetfs") &&
         fs::exists("/sys/class/udc/dummy_udc.0");
}

UvcGadget::UvcGadget() : begin_ns_(monotonic_ns()) {
  fs::create_directories(kFolder);
  EXPECT_EQ(::mount("gadgetfs", kFolder.c_str(), "gadgetfs", 0, nullptr), 0) << std::strerror(errno);
  for (const auto& entry : fs::directory_iterator(kFolder))
    control_ = ::open(entry.path().c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  const Bytes all = description();
  EXPECT_EQ(::write(control_, all.data(), all.size()), static_cast<ssize_t>(all.size())) << std::strerror(errno);
  answers_ = std::thread([this] { answer(); });
  streams_ = std::thread([this] { stream(); });
}

UvcGadget::~UvcGadget() {
  ends_ = true;
  answers_.join();
  ::close(control_);  // unplugged: what waits at the endpoint fails
  streams_.join();
  if (images_ >= 0) ::close(images_);
  ::umount2(kFolder.c_str(), 0);
}

std::string UvcGadget::node() {
  for (int i = 0; i < 64; ++i) {
    const std::string name = "video" + std::to_string(i), folder = "/sys/class/video4linux/" + name;
    std::ifstream file(folder + "/index");
    int index = -1;
    if (file >> index && index == 0 && fs::exists(folder + "/device/driver") &&
        fs::canonical(folder + "/device/driver").filename() == "uvcvideo" && fs::exists("/dev/" + name))
      return "/dev/" + name;
  }
  return "";
}

HostStamp UvcGadget::taken(const std::uint8_t* first_row) const { return HostStamp{taken_ns(number_of(first_row))}; }

HostStamp UvcGadget::left(const std::uint8_t* first_row) const {
  return HostStamp{left_ns_.at(number_of(first_row) % kMostImages)};
}

std::uint32_t UvcGadget::ticks(std::int64_t host_ns) {
  const double seconds = static_cast<double>(host_ns) * 1e-9 * (1 + 50e-6);
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(seconds * kClock_hz) + 0xffffffff);
}

void UvcGadget::answer() {
  while (!ends_) {
    pollfd ready{control_, POLLIN, 0};
    if (::poll(&ready, 1, 20) >= 0) take_request();
  }
}

void UvcGadget::take_request() {
  usb_gadgetfs_event event{};
  if (::read(control_, &event, sizeof(event)) != sizeof(event)) return;
  if (event.type == GADGETFS_DISCONNECT) is_streaming_ = false;
  if (event.type == GADGETFS_SETUP) answer_host(reinterpret_cast<const std::uint8_t*>(&event.u.setup));
}

void UvcGadget::answer_host(const std::uint8_t* request) {
  usb_ctrlrequest r{};
  std::memcpy(&r, request, sizeof(r));
  const bool is_answer = (r.bRequestType & USB_DIR_IN) != 0;
  const bool is_video = (r.bRequestType & USB_TYPE_MASK) == USB_TYPE_CLASS && (r.wIndex & 0xff) == 1;
  if (!is_answer && r.bRequest == USB_REQ_SET_CONFIGURATION && r.bRequestType == 0) {
    EXPECT_TRUE(begin_stream());
    ::read(control_, nullptr, 0);
  } else if (!is_answer && r.bRequest == USB_REQ_SET_INTERFACE && r.bRequestType == 1) {
    ::read(control_, nullptr, 0);
  } else if (is_video && is_answer) {
    Bytes stream = offered_stream();
    if (r.bRequest == 0x86) stream = {3};  // GET_INFO: can be asked for and set
    ::write(control_, stream.data(), std::min<std::size_t>(stream.size(), r.wLength));
  } else if (is_video) {
    std::array<std::uint8_t, 64> wish{};
    while (::read(control_, wish.data(), wish.size()) < 0 && errno == EAGAIN && !ends_) ::usleep(1000);
    if (r.wValue >> 8 == 2) is_streaming_ = true;  // it has agreed
  } else if (is_answer) {
    ::read(control_, nullptr, 0);  // refused
  } else {
    ::write(control_, nullptr, 0);
  }
}

bool UvcGadget::begin_stream() {
  if (images_ >= 0) ::close(images_);
  images_ = ::open((kFolder + "/ep1in-bulk").c_str(), O_RDWR | O_CLOEXEC);
  Bytes setting;
  put(setting, 1, 4);
  for (const std::uint16_t packet : {std::uint16_t{64}, std::uint16_t{512}}) {
    const Bytes one = endpoint(packet);
    setting.insert(setting.end(), one.begin(), one.end());
  }
  return ::write(images_, setting.data(), setting.size()) == static_cast<ssize_t>(setting.size());
}

/// Takes images all the time, as cameras do, and sends those that are asked for.
void UvcGadget::stream() {
  go_before_programs();
  bool is_odd = false;
  for (std::uint32_t number = 0; !ends_;) {
    number = std::max(number, static_cast<std::uint32_t>((monotonic_ns() - begin_ns_) / kPeriod_ns)) + 1;
    const std::int64_t leaves_ns = taken_ns(number) + kDelays_ns[number % std::size(kDelays_ns)];
    std::this_thread::sleep_until(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(leaves_ns)));
    if (!is_streaming_ || ends_) continue;
    send_image(number, is_odd);
    is_odd = !is_odd;
  }
}

void UvcGadget::send_image(std::uint32_t number, bool is_odd) {
  Bytes image(kImageSize, 100);
  std::memcpy(image.data(), &number, sizeof(number));
  left_ns_.at(number % kMostImages) = monotonic_ns();
  for (std::size_t at = 0; at < image.size();) {
    const std::size_t size = std::min<std::size_t>(image.size() - at, kPayload - kHeader);
    const bool is_last = at + size == image.size();
    Bytes payload;
    put(payload, {kHeader, kHeaderEnds | kClock | kImageTime | (is_last ? kEnd : 0) | (is_odd ? kFrameId : 0)});
    put(payload, ticks(taken_ns(number)), 4);
    const std::int64_t now_ns = monotonic_ns();
    put(payload, ticks(now_ns), 4);
    put(payload, static_cast<std::uint64_t>(now_ns / 1'000'000) & 0x7ff, 2);
    payload.insert(payload.end(), image.begin() + static_cast<std::ptrdiff_t>(at),
                   image.begin() + static_cast<std::ptrdiff_t>(at + size));
    if (::write(images_, payload.data(), payload.size()) != static_cast<ssize_t>(payload.size())) return;
    at += size;
  }
}

}  // namespace epiline
