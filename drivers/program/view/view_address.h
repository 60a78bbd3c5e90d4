#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// The address at which the live view listens.
struct ViewAddress {
  std::string host = "127.0.0.1";  ///< a numeric address, IPv4 or IPv6
  std::uint16_t port = 0;          ///< 0: any free port
  std::string token = {};          ///< that a browser must send; empty: none
  bool is_loopback() const;
};

/// Reads `PORT`, `ADDRESS:PORT` or `[IPV6]:PORT`; `localhost` is 127.0.0.1. Fails if and only if the port is no number
/// from 0 to 65535 or the address is none.
Result<ViewAddress> parse_view_address(std::string_view text);

/// A token that cannot be guessed: 32 hexadecimal digits from the system's random numbers.
std::string new_token();
/// True if both are equal. The time taken does not depend on where they differ.
bool is_token(std::string_view shown, std::string_view token);

/// `http://ADDRESS:PORT/`, with the token. For an address that stands for all interfaces (0.0.0.0, [::]) it names the
/// one to use on this computer.
std::string url_of(const ViewAddress& address);
/// The same; for an address that stands for all interfaces one for each address of this computer that others reach.
std::vector<std::string> urls_of(const ViewAddress& address);

/// True if a request with this `Host` header may be answered. A foreign web page can have its own name resolved to this
/// computer (DNS rebinding) and would then read our data, but its requests carry that name. Accepted are numeric
/// addresses, `localhost` and, unless only loopback is served, `own_name` and `own_name.local`.
bool is_own_host(std::string_view host, std::string_view own_name, bool loopback_only);

}  // namespace epiline
