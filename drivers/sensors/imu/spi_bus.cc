#include "drivers/sensors/imu/spi_bus.h"

#include <fcntl.h>
#include <linux/spi/spidev.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "drivers/sensors/imu/iio_attributes.h"

namespace epiline {

namespace {

constexpr std::size_t kMostParts = 4;

/// SPI_IOC_MESSAGE for a number that is not known when compiling.
constexpr unsigned long message_request(std::size_t parts) noexcept {
  return _IOC(_IOC_WRITE, SPI_IOC_MAGIC, 0, SPI_MSGSIZE(parts));
}
static_assert(message_request(1) == SPI_IOC_MESSAGE(1) && message_request(kMostParts) == SPI_IOC_MESSAGE(4));

/// Lists the existing spidev files for the error message, as many as fit.
void list_spidevs(std::span<char> text) noexcept {
  int used = std::snprintf(text.data(), text.size(), "one of the existing devices:");
  bool any = false;
  for_each_entry("/dev", [&](const char* entry) {
    if (std::strncmp(entry, "spidev", 6) != 0) return true;
    const std::size_t rest = text.size() - static_cast<std::size_t>(used);
    const int more = std::snprintf(text.data() + used, rest, " /dev/%.32s", entry);
    if (more < 0 || static_cast<std::size_t>(more) >= rest) return false;
    used += more;
    any = true;
    return true;
  });
  if (!any)
    std::snprintf(text.data(), text.size(),
                  "a spidev device; there is none, so SPI is off (Raspberry Pi: dtparam=spi=on)");
}

DeviceTrouble trouble_of(const char* step, int error) noexcept {
  const bool is_refused = error == EACCES || error == EPERM;
  DeviceTrouble trouble = device_refusal(step, error,
                                         is_refused        ? "permission: join the group that owns the file (often spi)"
                                         : error == ENOTTY ? "an SPI device, /dev/spidevB.C"
                                                           : "");
  if (error == ENOENT || error == ENODEV || error == ENXIO) list_spidevs(trouble.expected);
  return trouble;
}

}  // namespace

int SpiBus::read_bytes(std::uint8_t address, std::span<std::uint8_t> bytes, std::size_t dummies) noexcept {
  const std::uint8_t command[] = {static_cast<std::uint8_t>(address | kReadBit), 0};
  const SpiPart parts[] = {{.send = command, .size = 1 + dummies}, {.receive = bytes.data(), .size = bytes.size()}};
  return transfer(parts);
}

int SpiBus::write_byte(std::uint8_t address, std::uint8_t value) noexcept {
  const std::uint8_t bytes[] = {address, value};
  const SpiPart part{.send = bytes, .size = 2};
  return transfer({&part, 1});
}

DeviceTrouble SpidevBus::open(int mode, int hz) noexcept {
  close();
  fd_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
  if (fd_ < 0) return trouble_of("open", errno);
  std::uint8_t spi_mode = static_cast<std::uint8_t>(mode), bits = 8;
  std::uint32_t speed = static_cast<std::uint32_t>(hz);
  DeviceTrouble trouble;
  if (::ioctl(fd_, SPI_IOC_WR_MODE, &spi_mode) < 0) {
    trouble = trouble_of("SPI mode", errno);
  } else if (::ioctl(fd_, SPI_IOC_WR_BITS_PER_WORD, &bits) < 0) {
    trouble = trouble_of("8 bits per word", errno);
  } else if (::ioctl(fd_, SPI_IOC_WR_MAX_SPEED_HZ, &speed) < 0) {
    trouble = trouble_of("SPI clock", errno);
  }
  if (trouble) close();
  return trouble;
}

void SpidevBus::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

int SpidevBus::transfer(std::span<const SpiPart> parts) noexcept {
  if (fd_ < 0) return EBADF;
  if (parts.empty() || parts.size() > kMostParts) return EINVAL;
  std::array<spi_ioc_transfer, kMostParts> messages{};
  int bytes = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const SpiPart& part = parts[i];
    spi_ioc_transfer& message = messages[i];
    message.tx_buf = reinterpret_cast<std::uintptr_t>(part.send);
    message.rx_buf = reinterpret_cast<std::uintptr_t>(part.receive);
    message.len = static_cast<std::uint32_t>(part.size);
    message.speed_hz = static_cast<std::uint32_t>(part.hz);
    bytes += static_cast<int>(part.size);
  }
  int done = -1;
  do {
    done = ::ioctl(fd_, message_request(parts.size()), messages.data());
  } while (done < 0 && errno == EINTR);
  if (done < 0) return errno;
  return done == bytes ? 0 : EIO;
}

}  // namespace epiline
