#pragma once
// Times in text files of recordings: in whatever unit they are written, found by the rate of what they are the times
// of.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

struct TimeUnit {
  const char* name;
  int digits;  ///< decimals of the unit in a nanosecond
};
inline constexpr TimeUnit kInNanoseconds{"nanoseconds", 0}, kInMicroseconds{"microseconds", 3},
    kInMilliseconds{"milliseconds", 6}, kInSeconds{"seconds", 9};

/// The largest time, 146 years from zero: no clock shows more, and the difference of two is a Span.
inline constexpr std::int64_t kLargestTime_ns = (std::int64_t{1} << 62) - 1;

/// What the times are of. Of sensors the unit is found.
enum class TimeColumn { kNanoseconds, kSeconds, kSensor, kImu };

/// Decimals (`12.5`, `1.4e9`) to integer nanoseconds; plain decimals exactly. False: no number, or out of range.
bool parse_time(std::string_view field, const TimeUnit& unit, std::int64_t& ns);

/// The unit in which the mean rate of the middle half of the times is below the fastest that such a sensor has, and at
/// most a thousand times slower. Where all are as slow as that, or there are fewer than two times: nanoseconds.
TimeUnit unit_of(std::vector<double> times, TimeColumn column);

/// The times of a file as they are read line by line.
class TimeFields {
 public:
  /// `field` must outlive this.
  void add(std::string_view field, int line) {
    fields_.push_back(field);
    lines_.push_back(line);
  }
  /// In nanoseconds, in the order of the file, whose name is `file`. Appends a remark about an unusual unit to `notes`.
  Result<std::vector<std::int64_t>> parse(TimeColumn column, const std::string& file,
                                          std::vector<std::string>& notes) const;

 private:
  std::vector<std::string_view> fields_;
  std::vector<int> lines_;
};

/// For a list that somebody wrote in another order than that of time: where each element is in that order; and a
/// remark. Empty where less than a fifth of the elements is behind an earlier one: single wrong stamps, which are left
/// out later.
std::vector<std::size_t> order_of_time(const std::vector<std::int64_t>& ns, const std::string& file,
                                       std::vector<std::string>& notes);

}  // namespace epiline
