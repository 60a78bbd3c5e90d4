#include "drivers/program/live/service.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace epiline {

namespace {

/// The number in a variable of the environment; `missing` without it; 0 if it is none.
std::int64_t number_in(const char* name, std::int64_t missing) {
  const char* const text = std::getenv(name);
  if (text == nullptr) return missing;
  std::int64_t number = 0;
  std::from_chars(text, text + std::strlen(text), number);
  return number;
}

}  // namespace

ServiceManager::ServiceManager() {
  const char* const name = std::getenv("NOTIFY_SOCKET");
  if (name == nullptr || (name[0] != '/' && name[0] != '@') || std::strlen(name) >= sizeof(sockaddr_un::sun_path))
    return;
  address_ = name;
  if (address_[0] == '@') address_[0] = '\0';  // an abstract socket
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  constexpr std::int64_t kDay_us = 86'400'000'000;
  if (number_in("WATCHDOG_PID", ::getpid()) != ::getpid()) return;  // meant for a parent that started us
  watchdog_ = Span{std::clamp<std::int64_t>(number_in("WATCHDOG_USEC", 0), 0, kDay_us) * 1000};
}

ServiceManager::~ServiceManager() {
  if (socket_ >= 0) ::close(socket_);
}

void ServiceManager::status(const std::string& line) {
  if (line == status_) return;
  status_ = line;
  send("STATUS=" + line);
}

void ServiceManager::send(std::string_view text) {
  if (socket_ < 0) return;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  // a manager that does not listen is no reason to stop flying
  (void)::sendto(socket_, text.data(), text.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to), length);
}

bool Liveness::moved(const Counters& now) noexcept {
  const auto did = [](std::uint64_t done, std::uint64_t before, std::uint64_t given, std::uint64_t given_before) {
    return done != before || given <= given_before + kQueue;
  };
  const bool all = now.passes != last_.passes &&
                   did(now.images_out, last_.images_out, now.images_taken, last_.images_taken) &&
                   did(now.published, last_.published, now.images_out, last_.images_out);
  if (all) last_ = now;
  return all;
}

}  // namespace epiline
