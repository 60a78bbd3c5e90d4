#pragma once
// A client that shows a server every byte it wants to, also wrong ones.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <string>

namespace epiline {

#ifdef EPILINE_MICROHTTPD
inline constexpr bool kLiveViewBuilt = true;
#else
inline constexpr bool kLiveViewBuilt = false;
#endif
inline constexpr char kWithoutLiveView[] = "built without libmicrohttpd";

class RawClient {
 public:
  explicit RawClient(std::uint16_t port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval patience{30, 0};  // a guard against hanging for ever, nothing that is measured
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~RawClient() { close(socket_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  bool connected() const { return connected_; }
  bool send(const std::string& bytes) const { return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) > 0; }
  /// As much as goes without waiting.
  void send_what_fits(const std::string& bytes) const {
    const auto sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)sent;
  }
  /// Until the server closes.
  std::string read_all() const {
    std::string all;
    char buffer[4096];
    for (ssize_t n = 0; (n = recv(socket_, buffer, sizeof buffer, 0)) > 0;) all.append(buffer, n);
    return all;
  }
  /// Waits until the server closes the connection; false: it has not.
  bool is_closed_by_server() const {
    char byte = 0;
    ssize_t n = 0;
    while ((n = recv(socket_, &byte, 1, 0)) > 0) {
    }
    return n == 0 || errno == ECONNRESET;
  }

 private:
  int socket_;
  bool connected_ = false;
};

struct Answer {
  int status = 0;
  std::string head, body;
};

inline Answer ask(std::uint16_t port, const std::string& request) {
  const RawClient client(port);
  if (!client.send(request)) return {};
  const std::string all = client.read_all();
  const std::size_t end = all.find("\r\n\r\n");
  if (end == std::string::npos || all.rfind("HTTP/1.", 0) != 0) return {};
  return {std::stoi(all.substr(9, 3)), all.substr(0, end), all.substr(end + 4)};
}

inline Answer get(std::uint16_t port, const std::string& path, const std::string& host = "localhost") {
  return ask(port, "GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n");
}

}  // namespace epiline
