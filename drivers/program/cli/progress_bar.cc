#include "drivers/program/cli/progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "drivers/program/cli/say.h"

namespace epiline {

ProgressBar::ProgressBar(bool quiet, std::string unit)
    : shown_(!quiet && isatty(STDERR_FILENO) == 1), unit_(std::move(unit)) {}

void ProgressBar::operator()(std::size_t done, std::size_t all) {
  if (!shown_ || all == 0) return;
  constexpr std::size_t kWidth = 40, kFewSteps = 1000;
  const std::size_t bars = std::min(done, all) * kWidth / all;
  if (bars == last_bars_ && done != all && all > kFewSteps) return;  // drawing a flight's every image would cost time
  last_bars_ = bars;
  say(stderr, "\r[{}{}] {}/{} {}", std::string(bars, '='), std::string(kWidth - bars, ' '), done, all, unit_);
  if (done == all) say(stderr, "\r\033[K");
}

}  // namespace epiline
