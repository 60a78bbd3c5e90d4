#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "platform/error/result.h"

namespace epiline {

/// Where the live view listens.
struct ViewAddress {
  std::string host = "127.0.0.1";  ///< a numeric address, IPv4 or IPv6
  std::uint16_t port = 0;          ///< 0: any that is free
  std::string token = {};          ///< that a browser must show; empty: none
  bool is_loopback() const;
};

/// Reads `PORT`, `ADDRESS:PORT` or `[IPV6]:PORT`; `localhost` is 127.0.0.1. Fails if and only if the port is no number
/// from 0 to 65535 or the address is none.
Result<ViewAddress> parse_view_address(std::string_view text);

/// A token that nobody guesses: 32 hexadecimal digits of the system's random numbers.
std::string new_token();
/// Whether both are the same, in a time that does not depend on where they differ.
bool is_token(std::string_view shown, std::string_view token);

/// `http://ADDRESS:PORT/`, with the token; of an address that stands for all (0.0.0.0, [::]) the one to be used on this
/// computer.
std::string url_of(const ViewAddress& address);

/// May a request with this header `Host` be answered? Web pages of others can have their own name resolved to this
/// computer (DNS rebinding) and then read what only it may read; their requests carry that name. So: numeric addresses,
/// `localhost`, and, unless only loopback is served, `own_name` and `own_name.local`.
bool is_own_host(std::string_view host, std::string_view own_name, bool loopback_only);

}  // namespace epiline
