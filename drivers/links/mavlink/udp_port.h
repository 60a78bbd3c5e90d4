#pragma once
// Datagrams to and from one peer.
#include <netinet/in.h>

#include <cerrno>
#include <string>

#include "drivers/links/mavlink/port.h"
#include "platform/error/result.h"
#include "platform/linux/system_calls.h"

namespace epiline::mavlink {

/// `ADDRESS:PORT`, the address in numbers (IPv4). `key` names the setting in errors.
Result<sockaddr_in> udp_address(const std::string& text, const char* key);

/// A connected socket: the kernel drops datagrams from other senders. Bound to `own`, or to the address that reaches
/// the peer; with a peer on this computer, other computers cannot reach it.
class UdpPort final : public Port {
 public:
  /// `own` with port 0 and address 0: any.
  UdpPort(std::string name, const sockaddr_in& peer, const sockaddr_in& own,
          SystemCalls& system = SystemCalls::of_this_computer());
  ~UdpPort() override { close(); }

  DeviceTrouble open() noexcept override;
  void close() noexcept override;

 private:
  /// A peer that is not there yet is no reason to open anew; nor is a full queue.
  bool is_fatal(int error) const noexcept override { return error != ECONNREFUSED && error != ENOBUFS; }

  sockaddr_in peer_, own_;
};

}  // namespace epiline::mavlink
