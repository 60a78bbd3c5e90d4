#pragma once
// One chip select of an SPI bus, and what chips need of it. docs/imu.md
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "platform/error/device_trouble.h"

namespace epiline {

/// A part of a transfer. All parts of one are sent with the chip selected.
struct SpiPart {
  const std::uint8_t* send = nullptr;  ///< nullptr: zeros
  std::uint8_t* receive = nullptr;     ///< nullptr: thrown away
  std::size_t size = 0;
  int hz = 0;  ///< 0: the speed of open()
};

inline constexpr std::uint8_t kReadBit = 0x80;  ///< of a register's address

/// open() and close() belong to start-up and to getting a lost device back. No heap, no exceptions.
class SpiBus {
 public:
  virtual ~SpiBus() = default;
  /// `mode`: SPI mode 0 to 3. `hz`: the fastest clock.
  virtual DeviceTrouble open(int mode, int hz) noexcept = 0;
  virtual void close() noexcept = 0;
  /// At most 4 parts, at most 4096 bytes together (the usual limit of spidev). 0 or errno.
  virtual int transfer(std::span<const SpiPart> parts) noexcept = 0;
  virtual const char* name() const noexcept = 0;

  /// Registers of one byte, as most chips have them. `dummies`: bytes that the chip sends before the answer, at most 1.
  /// 0 or errno.
  int read_bytes(std::uint8_t address, std::span<std::uint8_t> bytes, std::size_t dummies = 0) noexcept;
  int write_byte(std::uint8_t address, std::uint8_t value) noexcept;
};

/// /dev/spidevB.C of the kernel.
class SpidevBus final : public SpiBus {
 public:
  explicit SpidevBus(std::string path) : path_(std::move(path)) {}
  ~SpidevBus() override { SpidevBus::close(); }
  SpidevBus(const SpidevBus&) = delete;
  SpidevBus& operator=(const SpidevBus&) = delete;

  DeviceTrouble open(int mode, int hz) noexcept override;
  void close() noexcept override;
  int transfer(std::span<const SpiPart> parts) noexcept override;
  const char* name() const noexcept override { return path_.c_str(); }

 private:
  std::string path_;
  int fd_ = -1;
};

}  // namespace epiline
