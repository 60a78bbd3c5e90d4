#pragma once
#include <cstddef>
#include <map>
#include <string>

#include "drivers/flights/recordings/grey_image.h"
#include "platform/error/result.h"

namespace epiline {

/// The images of a recorded flight, read one at a time when they are needed.
class ImageSource {
 public:
  ImageSource() = default;
  virtual ~ImageSource() = default;
  ImageSource(const ImageSource&) = delete;
  ImageSource& operator=(const ImageSource&) = delete;

  /// Image `index` in the recording's order as 8-bit grey: of 16 bits the upper eight of those that the recording uses.
  /// Fails if and only if it cannot be read whole.
  Status read(std::size_t index, GreyImage& grey);
  /// An error about that image, which names its file or message, with `found` and `expected`.
  virtual Error complaint(std::size_t index, std::string found, std::string expected) const = 0;

 private:
  virtual std::size_t count() const = 0;
  /// With the `used_bits` of `grey`, and its `highest`.
  virtual Status decode(std::size_t index, GreyImage& grey) = 0;
  int find_used_bits();

  int used_bits_ = 0;  ///< of 16; 0: not known yet
};

/// Images that could not be read, by what was expected of them: a file that exists is one kind, a whole one another.
class UnreadableImages {
 public:
  void add(const Error& error) { ++kinds_.try_emplace(error.expected, Kind{error, 0}).first->second.count; }
  void add(const UnreadableImages& more) {
    for (const auto& [expected, kind] : more.kinds_)
      kinds_.try_emplace(expected, Kind{kind.first, 0}).first->second.count += kind.count;
  }
  std::size_t count() const {
    std::size_t sum = 0;
    for (const auto& [expected, kind] : kinds_) sum += kind.count;
    return sum;
  }
  struct Kind {
    Error first;
    std::size_t count;
  };
  const std::map<std::string, Kind>& kinds() const { return kinds_; }

 private:
  std::map<std::string, Kind> kinds_;
};

}  // namespace epiline
