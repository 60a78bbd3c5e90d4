#pragma once
// MAVLink 2 message signing: a keyed hash and a time in each frame show that a sender has the key, and that the frame
// is not an old one. Does not allocate, wait or throw, but for reading the key. Page:
// docs/flight-controller.md#signing.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/links/mavlink/packet.h"
#include "platform/error/result.h"
#include "platform/memory/fixed_vector.h"

namespace epiline::mavlink {

using SigningKey = std::array<std::uint8_t, 32>;

/// Whether this program was built with the hash.
bool can_sign() noexcept;
/// The key in a file of 32 bytes, or of 64 hexadecimal digits. Fails if and only if the file cannot be read, holds
/// anything else, or may be read by every user of the computer; or this program was built without the hash.
Result<SigningKey> read_signing_key(const std::string& path);

/// Times of signatures: 10 microseconds since the beginning of 2015 (UTC).
std::uint64_t signing_time_of(std::int64_t unix_ns) noexcept;
/// Of the system's clock now.
std::uint64_t signing_time_now() noexcept;

/// Signs frames, and decides which received ones have the key and are new.
class Signing {
 public:
  enum class Verdict : std::uint8_t {
    kGood,
    kUnsigned,
    kWrong,  ///< another key, or damaged
    kOld,    ///< sent before, or by one sender too many
  };

  explicit Signing(const SigningKey& key) noexcept : key_(key) {}

  /// Signs a frame that frame_of() made to be signed. `now`: signing_time_now(); times rise from frame
  /// to frame, whatever that clock does.
  void sign(FrameBytes& frame, std::uint64_t now) noexcept;
  /// Of a whole frame with its signature, if it has one. `now` as for sign(). The first good frame of a sender is at
  /// most a minute older than anything known; each further one is later than the one before it.
  Verdict check(const RawFrame& frame, std::uint64_t now) noexcept;

 private:
  static constexpr std::size_t kMostSenders = 16;
  /// Each link of each sender counts by itself.
  struct Sender {
    std::uint32_t id = 0;  ///< system, component, link
    std::uint64_t newest = 0;
  };

  SigningKey key_;
  std::uint64_t time_ = 0;  ///< the latest that was sent or received
  FixedVector<Sender, kMostSenders> senders_;
};

}  // namespace epiline::mavlink
