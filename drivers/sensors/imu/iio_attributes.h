#pragma once
// A device's folder in sysfs: small text files. No heap and no exceptions, because a device is also set up in flight.
#include <array>
#include <cstddef>

#include "platform/memory/fixed_vector.h"

namespace epiline {

/// A short text in place. What does not fit is cut.
template <std::size_t N>
struct ShortText {
  std::array<char, N> data{};
  const char* c_str() const noexcept { return data.data(); }
  bool empty() const noexcept { return data[0] == '\0'; }
};

/// Calls `use(name)` for each entry of a folder until that returns false. Returns errno, 0 if the folder could be read.
int for_each_entry(const char* folder, bool (*use)(void* context, const char* name), void* context) noexcept;
template <class Use>
int for_each_entry(const char* folder, Use&& use) noexcept {
  return for_each_entry(
      folder, [](void* context, const char* name) { return (*static_cast<Use*>(context))(name); },
      const_cast<void*>(static_cast<const void*>(&use)));
}

/// Reads and sets a device's attributes, and puts back those it has changed.
class IioAttributes {
 public:
  using Text = ShortText<256>;
  using Path = ShortText<224>;

  /// The attributes are files below `folder`; what has been changed before is forgotten.
  void set_folder(const char* folder) noexcept;
  const char* folder() const noexcept { return folder_.c_str(); }

  /// The first line. 0 or errno.
  int read(const char* name, Text& value) const noexcept;
  int read(const char* name, double& number) const noexcept;  ///< EINVAL: not a finite number
  /// 0 or errno. The value before is kept for restore(), if there is one and it is another.
  int write(const char* name, const char* value) noexcept;
  int write_for_good(const char* name, const char* value) const noexcept;  ///< not kept
  /// The newest change first. What fails now, fails: the device may be gone.
  void restore() noexcept;

 private:
  struct Change {
    ShortText<64> name, before;
  };
  static constexpr std::size_t kMostChanges = 64;

  int open_file(const char* name, int flags) const noexcept;

  Path folder_;
  FixedVector<Change, kMostChanges> changes_;
};

}  // namespace epiline
