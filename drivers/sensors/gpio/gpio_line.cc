#include "drivers/sensors/gpio/gpio_line.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>
#include <vector>

#include "drivers/sensors/gpio/gpio_request.h"
#include "drivers/sensors/imu/iio_attributes.h"
#include "platform/error/contract.h"
#include "platform/linux/system_calls.h"
#include "platform/time/backoff.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::size_t kNamesShown = 24;

/// Paths of all chips, in the order of their numbers.
std::vector<std::string> chip_paths() {
  std::vector<std::string> paths;
  for_each_entry("/dev", [&](const char* name) {
    if (std::strncmp(name, "gpiochip", 8) == 0) paths.push_back(std::string("/dev/") + name);
    return true;
  });
  std::sort(paths.begin(), paths.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return paths;
}

std::string list_of_names(std::span<const GpioChipFacts> chips) {
  std::string names;
  std::size_t count = 0;
  for (const GpioChipFacts& chip : chips)
    for (const GpioLineFacts& line : chip.lines)
      if (!line.name.empty() && ++count <= kNamesShown) names.append(names.empty() ? "" : ", ").append(line.name);
  if (count > kNamesShown) names.append(", and ").append(std::to_string(count - kNamesShown)).append(" more");
  return names;
}

std::string list_of_chips(std::span<const GpioChipFacts> chips) {
  std::string text;
  for (const GpioChipFacts& chip : chips)
    text += (text.empty() ? "" : ", ") + chip.label + " (" + chip.name + ", 0 to " +
            std::to_string(chip.lines.empty() ? 0 : chip.lines.size() - 1) + ")";
  return text;
}

Error error_at(const std::string& line, std::string found, std::string expected) {
  return {ErrorKind::kRun, "GPIO line " + line, 0, std::move(found), std::move(expected)};
}

Error not_found(std::span<const GpioChipFacts> chips, const std::string& wanted) {
  const std::string names = list_of_names(chips);
  return error_at(
      wanted, "no line has this name",
      (names.empty() ? "" : "one of " + names + "; or ") + "CHIP:OFFSET with one of the chips " + list_of_chips(chips));
}

}  // namespace

/// A line's name first: it may hold a colon. Then a chip's label, and its name, which may change from start to start.
Result<GpioChoice> choose_line(std::span<const GpioChipFacts> chips, const std::string& wanted) {
  std::vector<GpioChoice> found;
  for (const GpioChipFacts& chip : chips)
    for (unsigned offset = 0; offset < chip.lines.size(); ++offset)
      if (!wanted.empty() && chip.lines[offset].name == wanted) found.push_back({&chip, offset});
  const auto colon = wanted.rfind(':');
  if (found.empty() && colon != std::string::npos) {
    const std::string chip_name = wanted.substr(0, colon);
    unsigned offset = 0;
    const char* const end = wanted.data() + wanted.size();
    const auto [stop, error] = std::from_chars(wanted.data() + colon + 1, end, offset);
    if (error != std::errc{} || stop != end) return not_found(chips, wanted);
    for (const bool by_label : {true, false})
      for (const GpioChipFacts& chip : chips)
        if ((by_label ? chip.label : chip.name) == chip_name && (by_label || found.empty()))
          found.push_back({&chip, offset});
    if (!found.empty() && offset >= found.front().chip->lines.size())
      return error_at(wanted, "the chip has " + std::to_string(found.front().chip->lines.size()) + " lines",
                      "an offset less than that");
  }
  if (found.empty()) return not_found(chips, wanted);
  if (found.size() > 1) {
    std::string where;
    for (const GpioChoice& choice : found)
      where += (where.empty() ? "" : ", ") + choice.chip->name + ":" + std::to_string(choice.offset);
    return error_at(wanted, std::to_string(found.size()) + " lines have this name", "one of " + where);
  }
  return found.front();
}

GpioLine::GpioLine(std::string line, Edge edge) : line_(std::move(line)), edge_(edge) {}
GpioLine::~GpioLine() { close(); }

Status GpioLine::open() {
  close();
  if (Status status = connect(); !status) return status;
  if (!keeper_.start({.name = "gpio"}, keep, this)) {
    request_.reset();
    return error_at(line_, "cannot start a thread", "a free thread (ulimit -u)");
  }
  opened_ = true;
  return Done{};
}

Status GpioLine::connect() {
  if (!kGpioBuiltIn)
    return error_at(line_, "this program was built without libgpiod", "a build with libgpiod-dev installed");
  std::vector<GpioChipFacts> chips;
  std::string refused;
  int error = 0;
  for (const std::string& path : chip_paths()) {
    GpioChipFacts chip;
    if (Request::read_chip(path, chip))
      chips.push_back(std::move(chip));
    else
      error = errno, refused = path;
  }
  if (chips.empty() && error == 0)
    return error_at(line_, "this computer has no GPIO chip (/dev/gpiochip*)",
                    "a board or adapter with GPIO, and its driver");
  const Result<GpioChoice> choice = choose_line(chips, line_);
  if (!choice) {
    if (error == 0) return choice.error();
    return Error{
        ErrorKind::kRun, refused, 0, std::strerror(error),
        error == EACCES ? "permission: join the group gpio, or install the udev rules" : choice.error().expected};
  }
  const GpioChipFacts& chip = *choice->chip;
  const GpioLineFacts& line = chip.lines[choice->offset];
  request_ = std::make_unique<Request>();
  if (!request_->open(chip.path, choice->offset, edge_)) {
    const int why = errno;
    request_.reset();
    const std::string user = line.consumer.empty() ? "the kernel or another program" : "'" + line.consumer + "'";
    if (why == EBUSY) return error_at(line_, "in use by " + user, "a line that no other program uses");
    return error_at(line_, std::strerror(why), why == ENXIO || why == EINVAL ? "a line that can raise interrupts" : "");
  }
  last_error_.store(0, std::memory_order_relaxed);
  return Done{};
}

void GpioLine::close() noexcept {
  ends_.store(true, std::memory_order_relaxed);
  keeper_wakes_.notify();
  keeper_.join();
  ends_.store(false, std::memory_order_relaxed);
  is_lost_.store(false, std::memory_order_relaxed);
  request_.reset();
  opened_ = false;
}

// ---- a chip that went away ----

void GpioLine::lose(int error) noexcept {
  last_error_.store(error, std::memory_order_relaxed);
  disconnected_.fetch_add(1, std::memory_order_relaxed);
  is_lost_.store(true, std::memory_order_release);  // pairs with the acquire in keep(): the request is the keeper's now
  keeper_wakes_.notify();
}

/// The keeper's thread: sleeps as long as the line is well.
void GpioLine::keep(void* self) {
  auto& line = *static_cast<GpioLine*>(self);
  Backoff retry(Span::from_milliseconds(50), Span::from_milliseconds(1'000));
  const auto ends = [&line] { return line.ends_.load(std::memory_order_relaxed); };
  constexpr std::int64_t kLong_ns = 3'600'000'000'000;
  while (!ends()) {
    const auto is_wanted = [&] { return ends() || line.is_lost_.load(std::memory_order_acquire); };
    if (!line.keeper_wakes_.wait_until(monotonic_ns() + kLong_ns, is_wanted)) continue;
    for (retry.begin(monotonic_ns()); !line.keeper_wakes_.wait_until(retry.due_ns(), ends);) {
      line.request_.reset();
      if (line.connect()) {
        line.is_lost_.store(false, std::memory_order_release);  // pairs with the acquire in read()
        break;
      }
      retry.failed(monotonic_ns());
    }
  }
}

// ---- edges ----

ReadOutcome GpioLine::read(std::span<HostStamp> edges, std::size_t& count, Span timeout) noexcept {
  EPILINE_EXPECTS(opened_, "open() before read()");
  EPILINE_EXPECTS(!edges.empty(), "room for an edge");
  count = 0;
  if (is_lost_.load(std::memory_order_acquire)) return ReadOutcome::kFailed;
  pollfd line{request_->fd(), POLLIN, 0};
  const int ready = SystemCalls::of_this_computer().wait({&line, 1}, timeout);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return ReadOutcome::kTimeout;
  std::uint64_t lost = 0;
  int got = -1;
  if ((line.revents & POLLIN) != 0)
    got = request_->read(edges.first(std::min(edges.size(), Request::kMostEdges)), lost);
  else
    errno = ENODEV;
  if (got < 0) {
    if (errno == EINTR || errno == EAGAIN) return ReadOutcome::kTimeout;
    lose(errno);
    return ReadOutcome::kFailed;
  }
  count = static_cast<std::size_t>(got);
  edges_.fetch_add(count, std::memory_order_relaxed);
  lost_.fetch_add(lost, std::memory_order_relaxed);
  return count > 0 ? ReadOutcome::kSample : ReadOutcome::kTimeout;
}

GpioCounts GpioLine::counts() const noexcept {
  return {edges_.load(std::memory_order_relaxed), lost_.load(std::memory_order_relaxed),
          disconnected_.load(std::memory_order_relaxed), last_error_.load(std::memory_order_relaxed)};
}

}  // namespace epiline
