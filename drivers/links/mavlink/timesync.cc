#include "drivers/links/mavlink/timesync.h"

#include <algorithm>

namespace epiline::mavlink {

void TimesyncExchange::receive(const Timesync& message, Address from, bool is_autopilot, std::int64_t now_ns) noexcept {
  if (!is_for(own_, message)) return;
  if (message.tc1 == 0) {
    if (owed_.size() == kOwed || !answers_.take(1, now_ns)) {
      ++refused_questions_;
    } else {
      owed_.push_back({message.ts1, from});
    }
    return;
  }
  const auto asked = std::find(open_.begin(), open_.end(), message.ts1);
  if (!is_autopilot || message.ts1 == 0 || asked == open_.end()) {
    ++refused_answers_;
    return;
  }
  *asked = 0;
  clock_.update(HostStamp{message.ts1}, DeviceStamp{message.tc1}, HostStamp{now_ns});
}

std::optional<Timesync> TimesyncExchange::answer(std::int64_t now_ns) noexcept {
  if (owed_.empty()) return std::nullopt;
  const Owed owed = owed_[0];
  for (std::size_t i = 1; i < owed_.size(); ++i) owed_[i - 1] = owed_[i];
  owed_.resize(owed_.size() - 1);
  return Timesync{now_ns, owed.ts1, owed.to.system, owed.to.component};
}

Timesync TimesyncExchange::question(Address to, std::int64_t now_ns) noexcept {
  open_[next_++ % kOpen] = now_ns;
  return {0, now_ns, to.system, to.component};
}

}  // namespace epiline::mavlink
