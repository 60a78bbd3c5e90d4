#include "drivers/sensors/camera/control_requests.h"

#include <algorithm>
#include <utility>

namespace epiline {

void ControlRequests::stop() noexcept {
  transfers_.stop();
  again_.reset();
}

DeviceTrouble ControlRequests::begin_stream(V4l2Device& device) noexcept {
  for (const ControlChange& change : changes_)
    if (const DeviceTrouble trouble = device.controls().write(change.name.data(), change.value)) return trouble;
  ++stream_;
  return {};
}

bool ControlRequests::request(std::string_view name, std::int64_t value) noexcept {
  ControlChange change;
  if (name.size() >= change.name.size()) return false;
  std::copy(name.begin(), name.end(), change.name.begin());
  change.value = value;
  return requests_.push(change);
}

void ControlRequests::begin_next(const V4l2Device& device) noexcept {
  if (!transfers_.is_idle() || !device.is_open()) return;
  ControlJob job;
  ControlChange change;
  if (again_) {
    job = *std::exchange(again_, std::nullopt);
  } else if (requests_.pop(change)) {
    job.is_request = true;
    job.entries[job.count++] = {.name = change.name, .facts = {}, .wanted = change.value};
  } else if (!exposure_.next_change(job)) {
    return;
  }
  job.stream = stream_;
  if (transfers_.begin(device.controls(), job)) return;
  job.is_request ? answer(job) : exposure_.ended(job);
}

void ControlRequests::look() noexcept {
  ControlJob job;
  if (!transfers_.take(job)) return;
  const bool is_of_this_stream = job.stream == stream_;
  if (!job.is_request) {
    if (is_of_this_stream) exposure_.ended(job);
  } else if (is_of_this_stream) {
    answer(job);
  } else {  // the device that is back was set up without it
    again_ = job;
    again_->entries[0].facts = {};
  }
}

void ControlRequests::answer(const ControlJob& job) noexcept {
  const ControlJob::Entry& entry = job.entries[0];
  answers_.push({entry.name, entry.value, job.is_set});
  if (!job.is_set) return;
  exposure_.changed(entry.facts.id, entry.value, job.at);
  // set again to what was asked for: a device may answer with something else
  const ControlChange wanted{entry.name, entry.wanted, true};
  ControlChange* known =
      std::find_if(changes_.begin(), changes_.end(), [&](const ControlChange& c) { return c.name == wanted.name; });
  if (known != changes_.end())
    *known = wanted;
  else
    changes_.push_back(wanted);
}

}  // namespace epiline
