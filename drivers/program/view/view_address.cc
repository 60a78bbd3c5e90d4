#include "drivers/program/view/view_address.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <random>

namespace epiline {

namespace {

bool is_numeric(int family, std::string_view host) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(family, std::string(host).c_str(), bytes.data()) == 1;
}

bool equal_names(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

bool parse_port(std::string_view text, std::uint16_t& port) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc{} && end == text.data() + text.size();
}

/// Splits `host`, `host:port`, `[v6]` and `[v6]:port`; false if brackets or port are wrong. No port: empty.
bool split(std::string_view text, std::string_view& host, std::string_view& port, bool& brackets) {
  brackets = !text.empty() && text.front() == '[';
  const std::size_t end = brackets ? text.find(']') : text.rfind(':');
  if (brackets && end == std::string_view::npos) return false;
  host = text.substr(brackets ? 1 : 0, brackets ? end - 1 : end);
  port = {};
  const std::size_t colon = brackets ? end + 1 : end;
  if (colon >= text.size()) return true;
  if (text[colon] != ':') return false;
  port = text.substr(colon + 1);
  return true;
}

}  // namespace

bool ViewAddress::is_loopback() const { return host.starts_with("127.") || host == "::1"; }

Result<ViewAddress> parse_view_address(std::string_view text) {
  const auto wrong = [&](const char* what, const char* expected) {
    return Error{ErrorKind::kUsage, "", 0, "--view " + std::string(text) + ": " + what, expected};
  };
  ViewAddress address;
  std::string_view host, port = text;
  bool brackets = false;
  if (text.find(':') != std::string_view::npos) {
    if (!split(text, host, port, brackets)) return wrong("not an address and a port", "[ADDRESS:]PORT, or [IPV6]:PORT");
    address.host = equal_names(host, "localhost") ? "127.0.0.1" : std::string(host);
    if (!is_numeric(brackets ? AF_INET6 : AF_INET, address.host)) {
      return wrong("not a numeric address", "an address of this computer, or 0.0.0.0 for all; IPv6 in brackets");
    }
  }
  if (!parse_port(port, address.port)) return wrong("not a port", "a number from 1 to 65535, or 0 for any free port");
  return address;
}

std::string url_of(const ViewAddress& address) {
  std::string host = address.host;
  if (host == "0.0.0.0") host = "127.0.0.1";
  if (host == "::") host = "::1";
  const bool v6 = host.find(':') != std::string::npos;
  return "http://" + (v6 ? "[" + host + "]" : host) + ":" + std::to_string(address.port) + "/" +
         (address.token.empty() ? "" : "?token=" + address.token);
}

std::vector<std::string> urls_of(const ViewAddress& address) {
  const bool is_all4 = address.host == "0.0.0.0", is_all6 = address.host == "::";
  std::vector<std::string> urls;
  ifaddrs* all = nullptr;
  if ((is_all4 || is_all6) && ::getifaddrs(&all) == 0) {
    for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
      const bool is_reached = (one->ifa_flags & IFF_UP) != 0 && (one->ifa_flags & IFF_LOOPBACK) == 0;
      if (!is_reached || one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
      char host[INET_ADDRSTRLEN] = {};
      ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr, host, sizeof host);
      urls.push_back(url_of({host, address.port, address.token}));
    }
    ::freeifaddrs(all);
  }
  if (urls.empty()) urls.push_back(url_of(address));
  return urls;
}

std::string new_token() {
  std::random_device random;
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%08x%08x%08x%08x", random(), random(), random(), random());
  return text.data();
}

bool is_token(std::string_view shown, std::string_view token) {
  unsigned differences = shown.size() == token.size() ? 0 : 1;
  for (std::size_t i = 0; i < token.size(); ++i)
    differences |= static_cast<unsigned char>(token[i] ^ (i < shown.size() ? shown[i] : '\0'));
  return differences == 0;
}

bool is_own_host(std::string_view text, std::string_view own_name, bool loopback_only) {
  std::string_view host, port;
  bool brackets = false;
  std::uint16_t number = 0;
  if (!split(text, host, port, brackets) || (!port.empty() && !parse_port(port, number))) return false;
  if (is_numeric(brackets ? AF_INET6 : AF_INET, host) || equal_names(host, "localhost")) return true;
  return !loopback_only && !own_name.empty() &&
         (equal_names(host, own_name) || equal_names(host, std::string(own_name) + ".local"));
}

}  // namespace epiline
