#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace epiline {

/// A vector of at most `N` trivially copyable elements, stored in place. Never allocates; a full one refuses.
template <class T, std::size_t N>
class FixedVector {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  static constexpr std::size_t capacity() { return N; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == N; }
  /// Returns false, and changes nothing, if and only if the vector is full.
  bool push_back(const T& value) {
    if (full()) return false;
    data_[size_++] = value;
    return true;
  }
  /// Shrinks or, with value-initialised elements, grows; `n` beyond the capacity is cut to it.
  void resize(std::size_t n) {
    if (n > N) n = N;
    for (std::size_t i = size_; i < n; ++i) data_[i] = T{};
    size_ = n;
  }
  void clear() { size_ = 0; }
  /// As an assignment, which would also copy the room for elements that are not there.
  void copy(const FixedVector& other) {
    std::copy_n(other.data(), other.size(), data());
    size_ = other.size_;
  }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }
  T& back() { return data_[size_ - 1]; }
  const T& back() const { return data_[size_ - 1]; }
  T* begin() { return data_.data(); }
  T* end() { return data_.data() + size_; }
  const T* begin() const { return data_.data(); }
  const T* end() const { return data_.data() + size_; }
  T* data() { return data_.data(); }
  const T* data() const { return data_.data(); }

 private:
  std::array<T, N> data_{};
  std::size_t size_ = 0;
};

}  // namespace epiline
