#include "drivers/links/mavlink/signing.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>

#ifdef EPILINE_NETTLE
#include <nettle/sha2.h>
#endif

namespace epiline::mavlink {

namespace {

constexpr std::size_t kHash = 6, kTime = 6;
constexpr std::uint64_t kMinute = 6'000'000;                   // in units of 10 us
constexpr std::int64_t kBegin_ns = 1'420'070'400'000'000'000;  // of 2015
constexpr std::uint8_t kLink = 0;                              // of ours: a program has one
constexpr std::uint64_t kLatest = (std::uint64_t{1} << 48U) - 1;

/// The first bytes of SHA-256 over the key and what is signed: the frame up to the time in its signature.
std::array<std::uint8_t, kHash> hash_of([[maybe_unused]] const SigningKey& key,
                                        [[maybe_unused]] std::span<const std::uint8_t> bytes) noexcept {
  std::array<std::uint8_t, kHash> first{};
#ifdef EPILINE_NETTLE
  sha256_ctx context;
  sha256_init(&context);
  sha256_update(&context, key.size(), key.data());
  sha256_update(&context, bytes.size(), bytes.data());
  sha256_digest(&context, first.size(), first.data());
#endif
  return first;
}

/// 32 bytes, or as many in digits; false: neither.
bool parse_key(std::span<const std::uint8_t> text, SigningKey& key) {
  if (text.size() == key.size()) {
    std::copy(text.begin(), text.end(), key.begin());
    return true;
  }
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text = text.first(text.size() - 1);
  if (text.size() != 2 * key.size()) return false;
  for (std::size_t i = 0; i < key.size(); ++i) {
    const auto* const digits = reinterpret_cast<const char*>(&text[2 * i]);
    if (std::from_chars(digits, digits + 2, key[i], 16).ptr != digits + 2) return false;
  }
  return true;
}

}  // namespace

bool can_sign() noexcept {
#ifdef EPILINE_NETTLE
  return true;
#else
  return false;
#endif
}

Result<SigningKey> read_signing_key(const std::string& path) {
  const auto error = [&](const std::string& found, const char* expected) {
    return Error{ErrorKind::kUsage, path, 0, "mavlink.signing_key_file: " + found, expected};
  };
  if (!can_sign()) return error("this program was built without signing", "a build with nettle-dev installed");
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return error(std::string(std::strerror(errno)) + " [open]", "a file that the user of epiline may read");
  struct stat status {};
  std::array<std::uint8_t, 80> text{};
  const bool is_open_to_all = ::fstat(fd, &status) == 0 && (status.st_mode & S_IROTH) != 0;
  const ssize_t size = ::read(fd, text.data(), text.size());
  ::close(fd);
  if (is_open_to_all) return error("every user may read it", "a file for its group alone: chmod 640");
  SigningKey key{};
  if (size < 0 || !parse_key({text.data(), static_cast<std::size_t>(size)}, key))
    return error("not a key", "32 bytes, or 64 hexadecimal digits");
  return key;
}

std::uint64_t signing_time_of(std::int64_t unix_ns) noexcept {
  return unix_ns <= kBegin_ns ? 0 : static_cast<std::uint64_t>(unix_ns - kBegin_ns) / 10'000;
}

std::uint64_t signing_time_now() noexcept {
  using namespace std::chrono;
  return signing_time_of(duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count());
}

void Signing::sign(FrameBytes& frame, std::uint64_t now) noexcept {
  time_ = std::min(std::max(time_ + 1, now), kLatest);
  frame.data[frame.size++] = kLink;
  for (std::size_t i = 0; i < kTime; ++i) frame.data[frame.size++] = static_cast<std::uint8_t>(time_ >> (8 * i));
  const auto hash = hash_of(key_, frame.bytes());
  std::copy(hash.begin(), hash.end(), frame.data.begin() + static_cast<std::ptrdiff_t>(frame.size));
  frame.size += kHash;
}

Signing::Verdict Signing::check(const RawFrame& frame, std::uint64_t now) noexcept {
  if (!frame.is_signed) return Verdict::kUnsigned;
  const auto shown = frame.bytes.last(kHash);
  const auto hash = hash_of(key_, frame.bytes.first(frame.bytes.size() - kHash));
  unsigned differences = 0;  // in a time that does not tell where
  for (std::size_t i = 0; i < kHash; ++i) differences |= static_cast<unsigned>(hash[i] ^ shown[i]);
  if (differences != 0) return Verdict::kWrong;
  const auto signature = frame.bytes.last(kSignature);
  std::uint64_t sent = 0;
  for (std::size_t i = 0; i < kTime; ++i) sent |= std::uint64_t{signature[1 + i]} << (8 * i);
  const std::uint32_t id =
      std::uint32_t{frame.from.system} << 16U | std::uint32_t{frame.from.component} << 8U | signature[0];
  auto* const known =
      std::find_if(senders_.begin(), senders_.end(), [&](const Sender& sender) { return sender.id == id; });
  if (known != senders_.end()) {
    if (sent <= known->newest) return Verdict::kOld;
    known->newest = sent;
  } else if (sent + kMinute < std::max(time_, now) || !senders_.push_back({id, sent})) {
    return Verdict::kOld;
  }
  time_ = std::max(time_, sent);
  return Verdict::kGood;
}

}  // namespace epiline::mavlink
