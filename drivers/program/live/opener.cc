#include "drivers/program/live/opener.h"

#include "platform/time/monotonic.h"

namespace epiline {

namespace {
constexpr std::int64_t kBetweenTries_ns = 500'000'000;
constexpr std::int64_t kPatience_ns = 1'000'000'000;  // a device that takes longer to open is reported
}  // namespace

Opener::Opener(std::vector<Part> parts, bool waits)
    : parts_(std::move(parts)), waits_(waits), thread_([this] { run(); }) {}

void Opener::run() {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    at_.store(i, std::memory_order_relaxed);
    const auto error = try_part(parts_[i]);
    note("");
    if (!error) continue;
    const std::lock_guard lock(mutex_);
    error_ = *error;
    break;
  }
  ended_.store(true, std::memory_order_release);
}

/// None: it is open.
std::optional<Error> Opener::try_part(const Part& part) {
  while (true) {
    since_ns_.store(monotonic_ns(), std::memory_order_relaxed);
    const Status status = part.open();
    if (status) return std::nullopt;
    const Error& error = status.error();
    const auto is_over = [&] { return gives_up_.load(std::memory_order_acquire); };
    if (!waits_ || error.kind == ErrorKind::kUsage || is_over()) return error;
    note(part.name + ": " + error.text());
    part.close();
    if (pause_.wait_until(monotonic_ns() + kBetweenTries_ns, is_over)) return error;
  }
}

void Opener::note(const std::string& text) {
  const std::lock_guard lock(mutex_);
  waiting_for_ = text;
}

std::string Opener::waiting_for() const {
  if (has_ended()) return "";
  const std::lock_guard lock(mutex_);
  const std::int64_t since_ns = since_ns_.load(std::memory_order_relaxed);
  const bool is_slow = waiting_for_.empty() && since_ns != 0 && monotonic_ns() - since_ns > kPatience_ns;
  return is_slow ? parts_[at_.load(std::memory_order_relaxed)].name + ": no answer yet" : waiting_for_;
}

void Opener::give_up() {
  gives_up_.store(true, std::memory_order_release);
  pause_.notify();
  if (!has_ended())
    for (const Part& part : parts_) part.give_up();
  if (thread_.joinable()) thread_.join();
}

Status Opener::result() const {
  const std::lock_guard lock(mutex_);
  return error_ ? Status(*error_) : Status(Done{});
}

}  // namespace epiline
