#include "drivers/program/live/receivers.h"

#include <algorithm>

#include "platform/time/monotonic.h"

namespace epiline {

Status Receivers::open_each(bool waits) {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const Status status = try_one(i);
    if (!status && (!waits || status.error().kind == ErrorKind::kUsage)) return status;
  }
  const auto is_open = [](const State& s) { return s.is_open.load(std::memory_order_relaxed); };
  if (!std::all_of(states_.begin(), states_.end(), is_open)) trying_ = std::thread([this] { keep_trying(); });
  return Done{};
}

Status Receivers::try_one(std::size_t i) {
  const Status status = outputs_[i].sink->open();
  if (!status) outputs_[i].sink->close();
  const std::lock_guard lock(mutex_);
  states_[i].trouble = status ? "" : outputs_[i].name + ": " + status.error().text();
  states_[i].is_open.store(static_cast<bool>(status), std::memory_order_release);
  return status;
}

void Receivers::keep_trying() {
  constexpr std::int64_t kBetweenOpenings_ns = 500'000'000;
  const auto stops = [this] { return stops_.load(std::memory_order_acquire); };
  for (bool all = false; !all && !pause_.wait_until(monotonic_ns() + kBetweenOpenings_ns, stops);) {
    all = true;
    for (std::size_t i = 0; i < outputs_.size() && !stops(); ++i)
      if (!states_[i].is_open.load(std::memory_order_relaxed)) all &= static_cast<bool>(try_one(i));
  }
}

void Receivers::close() noexcept {
  stops_.store(true, std::memory_order_release);
  pause_.notify();
  if (trying_.joinable()) trying_.join();
  for (std::size_t i = 0; i < outputs_.size(); ++i)
    if (states_[i].is_open.exchange(false)) outputs_[i].sink->close();
}

bool Receivers::publish(const Odometry& odometry) noexcept {
  newest_.write(odometry);
  bool all = true;
  for (std::size_t i = 0; i < outputs_.size(); ++i)
    if (states_[i].is_open.load(std::memory_order_acquire)) all &= outputs_[i].sink->publish(odometry);
  return all;
}

bool Receivers::publish_image(const Odometry& odometry) noexcept {
  bool all = true;
  for (std::size_t i = 0; i < outputs_.size(); ++i)
    if (states_[i].is_open.load(std::memory_order_acquire)) all &= outputs_[i].sink->publish_image(odometry);
  return all;
}

std::string Receivers::names_of_lost() const {
  std::string names;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const LiveOutput& o = outputs_[i];
    const bool is_open = states_[i].is_open.load(std::memory_order_acquire) && (!o.is_open || o.is_open());
    if (!is_open) names += (names.empty() ? "" : ", ") + o.name;
  }
  return names;
}

std::string Receivers::refusals() const {
  std::string all = waiting_for();
  for (const LiveOutput& o : outputs_) {
    const std::string why = o.refusal ? o.refusal() : "";
    if (!why.empty()) all += (all.empty() ? "" : "; ") + o.name + ": " + why;
  }
  return all;
}

std::vector<std::string> Receivers::notes() const {
  std::vector<std::string> all;
  for (const LiveOutput& o : outputs_) {
    const auto some = o.notes ? o.notes() : std::vector<std::string>();
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

std::string Receivers::waiting_for() const {
  const std::lock_guard lock(mutex_);
  std::string all;
  for (const State& s : states_)
    if (!s.trouble.empty()) all += (all.empty() ? "" : "; ") + s.trouble;
  return all;
}

}  // namespace epiline
