#pragma once
#include <cstddef>
#include <string>

namespace epiline {

/// A progress bar on a terminal; prints nothing elsewhere. Call it with the amount done and the total.
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
