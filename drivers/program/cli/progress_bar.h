#pragma once
#include <cstddef>
#include <string>

namespace epiline {

/// A bar on a terminal, nothing elsewhere: long work calls it with what is done and what is to do.
class ProgressBar {
 public:
  /// `unit` names what is counted, for instance "images".
  explicit ProgressBar(bool quiet, std::string unit = "images");
  void operator()(std::size_t done, std::size_t all);

 private:
  bool shown_;
  std::string unit_;
  std::size_t last_bars_ = 0;
};

}  // namespace epiline
