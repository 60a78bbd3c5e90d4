// Packed parts of a file come out whole, and damaged ones take no memory to speak of.
#include "drivers/flights/recordings/random_file.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/drivers/program/bag_writers.h"

namespace epiline {
namespace {

struct Kind {
  Packing packing;
  const char* name;
};
constexpr Kind kKinds[] = {{Packing::kBz2, "bz2"}, {Packing::kLz4, "lz4"}, {Packing::kZstd, "zstd"}};

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string noise(std::size_t size) {
  std::string text(size, 0);
  std::uint32_t state = 1;
  for (char& c : text) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  return text;
}

TEST(Unpack, GivesTheBytesThatWerePacked) {
  const std::string contents[] = {
      "", "a", noise(300), noise(200'000), std::string(3'000'000, 'x'), std::string(65'536, 'y') + noise(65'536)};
  for (const Kind& kind : kKinds) {
    for (const std::string& content : contents) {
      const std::string packed = packed_as(kind.name, content);
      for (const std::uint64_t size : {std::uint64_t{content.size()}, kUnknownSize}) {
        Bytes out;
        ASSERT_TRUE(unpack(kind.packing, bytes_of(packed), size, out)) << kind.name << content.size();
        EXPECT_TRUE(std::equal(out.begin(), out.end(), content.begin(), content.end(),
                               [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }))
            << kind.name << content.size();
      }
      Bytes out;
      EXPECT_FALSE(unpack(kind.packing, bytes_of(packed), content.size() + 1, out)) << kind.name;
      if (!content.empty()) {
        EXPECT_FALSE(unpack(kind.packing, bytes_of(packed), content.size() - 1, out)) << kind.name;
        EXPECT_FALSE(unpack(kind.packing, bytes_of(packed.substr(0, packed.size() - 1)), kUnknownSize, out));
      }
    }
  }
}

TEST(Unpack, ReadsFramesThatFollowEachOther) {
  const std::string packed = zstd_of("one ") + zstd_of("") + zstd_of("two");
  Bytes out;
  ASSERT_TRUE(unpack(Packing::kZstd, bytes_of(packed), kUnknownSize, out));
  EXPECT_EQ(std::string(out.begin(), out.end()), "one two");
  EXPECT_FALSE(unpack(Packing::kZstd, bytes_of(packed + "three"), kUnknownSize, out));
}

// The size of a block's literals in zstd, if wrong, made it ask for a gigabyte.
TEST(Unpack, TakesLittleMemoryForADamagedMessage) {
  constexpr std::size_t kALittle = 1 << 20;
  const std::string message = noise(40) + std::string(280, 0);
  for (const Kind& kind : kKinds) {
    const std::string packed = packed_as(kind.name, message);
    for (std::size_t at = 0; at < packed.size(); ++at) {
      for (int bit = 0; bit < 8; ++bit) {
        std::string damaged = packed;
        damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
        Bytes out;
        (void)unpack(kind.packing, bytes_of(damaged), kUnknownSize, out);
        ASSERT_LT(out.capacity(), kALittle) << kind.name << ", bit " << bit << " of byte " << at;
      }
    }
  }
}

}  // namespace
}  // namespace epiline
