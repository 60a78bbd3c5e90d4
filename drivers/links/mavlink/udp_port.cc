#include "drivers/links/mavlink/udp_port.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <charconv>
#include <utility>

namespace epiline::mavlink {

namespace {

const sockaddr* plain(const sockaddr_in& address) noexcept {
  return reinterpret_cast<const sockaddr*>(&address);  // NOLINT: the interface of sockets
}

}  // namespace

Result<sockaddr_in> udp_address(const std::string& text, const char* key) {
  const Error error{ErrorKind::kUsage, key, 0, "'" + text + "'", "ADDRESS:PORT in numbers, e.g. 192.168.1.10:14580"};
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) return error;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  unsigned port = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, trouble] = std::from_chars(text.data() + colon + 1, end, port);
  if (trouble != std::errc{} || rest != end || port == 0 || port > 65535) return error;
  if (::inet_pton(AF_INET, text.substr(0, colon).c_str(), &address.sin_addr) != 1) return error;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

UdpPort::UdpPort(std::string name, const sockaddr_in& peer, const sockaddr_in& own, SystemCalls& system)
    : Port(std::move(name), system), peer_(peer), own_(own) {}

DeviceTrouble UdpPort::open() noexcept {
  close();
  fd_ = system_.socket(AF_INET, SOCK_DGRAM, 0);
  if (fd_ < 0) return device_refusal("socket", errno);
  DeviceTrouble trouble;
  if (own_.sin_port != 0 && system_.bind(fd_, plain(own_), sizeof own_) != 0)
    trouble = device_refusal("bind to mavlink.udp_listen", errno, "an address of this computer, and a free port");
  else if (system_.connect(fd_, plain(peer_), sizeof peer_) != 0)
    trouble = device_refusal("connect", errno, "an address that this computer can reach");
  if (trouble) close();
  // what came from others between bind and connect is still there
  std::uint8_t byte = 0;
  for (int i = 0; i < 10'000 && fd_ >= 0 && system_.read(fd_, &byte, 1) >= 0; ++i) {
  }
  return trouble;
}

void UdpPort::close() noexcept {
  if (fd_ >= 0) system_.close(fd_);
  fd_ = -1;
}

}  // namespace epiline::mavlink
