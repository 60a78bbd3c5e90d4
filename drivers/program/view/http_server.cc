#include "drivers/program/view/http_server.h"

#include <charconv>

#ifdef EPILINE_MICROHTTPD
#include <arpa/inet.h>
#include <microhttpd.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <tuple>

#include "platform/time/monotonic.h"
#endif

namespace epiline {

#ifndef EPILINE_MICROHTTPD

struct HttpServer::Impl {
  ViewAddress address;
};

Result<std::unique_ptr<HttpServer>> HttpServer::listen(const ViewAddress&, Handler, HttpPosts) {
  return Error{ErrorKind::kUsage, "", 0, "--view: this program was built without the live view",
               "a build with libmicrohttpd-dev installed"};
}
std::string_view HttpRequest::text(const char*) const { return {}; }
std::string_view HttpRequest::header(const char*) const { return {}; }
void HttpServer::step(Span) {}
int HttpServer::connections() const { return 0; }

#else

namespace {

constexpr unsigned kMostConnections = 128, kSpareConnections = 16;
constexpr std::size_t kMemoryOfConnection = 16 * 1024;  // a request's head must fit
constexpr std::int64_t kSecond = 1'000'000'000;
// A page sends requests many times a second. A connection that is silent for longer, or slower to take a response, is
// closed.
constexpr std::int64_t kPatienceWithNew_ns = 3 * kSecond, kPatience_ns = 10 * kSecond;

/// An open connection.
struct Peer {
  int socket = -1;  ///< -1: not in use
  bool has_asked = false;
  std::int64_t since_ns = 0;  ///< last request, or its beginning
};

Result<int> open_socket(const ViewAddress& address, std::uint16_t& port) {
  const auto failed = [&](const char* what) {
    return Error{ErrorKind::kUsage, "", 0, "--view: " + url_of(address) + ": " + what + ": " + std::strerror(errno),
                 "an address of this computer and a free port"};
  };
  addrinfo hints{}, *found = nullptr;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found) != 0) {
    return failed("not a valid address");
  }
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> info(found, freeaddrinfo);
  const int s = socket(info->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (s < 0) return failed("cannot open a socket");
  const int on = 1;
  setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);  // not while another listens; only after a restart
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (bind(s, info->ai_addr, info->ai_addrlen) != 0 || ::listen(s, 64) != 0 ||
      getsockname(s, reinterpret_cast<sockaddr*>(&bound), &size) != 0) {
    const Error error = failed("cannot listen there");
    close(s);
    return error;
  }
  port = ntohs(bound.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(bound).sin6_port
                                           : reinterpret_cast<sockaddr_in&>(bound).sin_port);
  return s;
}

std::string name_of_this_computer() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace

struct HttpServer::Impl {
  ViewAddress address;
  Handler handler;
  HttpPosts posts = HttpPosts::kRefused;
  std::string own_name = name_of_this_computer();
  MHD_Daemon* daemon = nullptr;
  std::array<Peer, kMostConnections> peers;

  ~Impl() {
    if (daemon != nullptr) MHD_stop_daemon(daemon);  // closes the socket too
  }
  HttpResponse refuse(MHD_Connection* connection, const char* method) const;
  MHD_Result send(MHD_Connection* connection, const HttpResponse& response) const;
  const char* methods() const { return posts == HttpPosts::kRefused ? "GET, HEAD" : "GET, HEAD, POST"; }
  void opened(MHD_Connection* connection, void** context);
  void drop_silent();
  void make_room();

  // libmicrohttpd's callbacks; `self` is the Impl.
  static MHD_Result on_request(void* self, MHD_Connection* connection, const char* path, const char* method,
                               const char*, const char*, std::size_t*, void**);
  static void on_connection(void* self, MHD_Connection* connection, void** context,
                            MHD_ConnectionNotificationCode code);
};

/// Empty if missing.
static std::string_view value_of(void* connection, MHD_ValueKind kind, const char* name) {
  const char* const value = MHD_lookup_connection_value(static_cast<MHD_Connection*>(connection), kind, name);
  return value == nullptr ? std::string_view() : value;
}

std::string_view HttpRequest::text(const char* name) const {
  return value_of(connection_, MHD_GET_ARGUMENT_KIND, name);
}
std::string_view HttpRequest::header(const char* name) const { return value_of(connection_, MHD_HEADER_KIND, name); }

/// What cannot be answered; status 200: it can.
HttpResponse HttpServer::Impl::refuse(MHD_Connection* connection, const char* method) const {
  const auto header = [&](const char* name) { return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name); };
  const auto refusal = [](int status, std::string text) {
    return HttpResponse{status, "text/plain", std::move(text), ""};
  };
  const bool is_post = posts == HttpPosts::kWithoutBody && std::strcmp(method, "POST") == 0;
  if (!is_post && std::strcmp(method, "GET") != 0 && std::strcmp(method, "HEAD") != 0)
    return refusal(405, std::string("only ") + methods() + "\n");
  const char* const length = header("Content-Length");
  if (header("Transfer-Encoding") != nullptr || (length != nullptr && std::strcmp(length, "0") != 0)) {
    return refusal(413, "requests with a body are refused\n");
  }
  const char* const host = header("Host");
  if (host == nullptr || !is_own_host(host, own_name, address.is_loopback())) {
    return refusal(403, "unknown host name; use the numeric address, or localhost\n");
  }
  if (!address.token.empty() && !is_token(value_of(connection, MHD_GET_ARGUMENT_KIND, "token"), address.token))
    return refusal(403, "use the whole address that the program printed, with its token\n");
  return {};
}

MHD_Result HttpServer::Impl::send(MHD_Connection* connection, const HttpResponse& r) const {
  MHD_Response* const response = MHD_create_response_from_buffer(
      r.body.size(), const_cast<char*>(r.body.data()), MHD_RESPMEM_MUST_COPY);  // copied: the cast takes no right
  if (response == nullptr) return MHD_NO;                                       // closes the connection
  const auto add = [&](const char* name, const char* value) { MHD_add_response_header(response, name, value); };
  add("Content-Type", r.type.c_str());
  add("Content-Security-Policy", r.security_policy.empty() ? "default-src 'none'" : r.security_policy.c_str());
  add("Cache-Control", "no-store");
  add("X-Content-Type-Options", "nosniff");
  add("X-Frame-Options", "DENY");
  add("Referrer-Policy", "no-referrer");
  add("Cross-Origin-Resource-Policy", "same-origin");
  add("Cross-Origin-Opener-Policy", "same-origin");
  if (r.status == 405) add("Allow", methods());
  const MHD_Result queued = MHD_queue_response(connection, static_cast<unsigned>(r.status), response);
  MHD_destroy_response(response);  // one reference less; the queue holds its own
  return queued;
}

MHD_Result HttpServer::Impl::on_request(void* self, MHD_Connection* connection, const char* path, const char* method,
                                        const char*, const char*, std::size_t*, void** context) {
  Impl& m = *static_cast<Impl*>(self);
  if (*context ==
      nullptr) {  // the first of two calls: a refusal now, and the connection is closed, its body never read
    *context = self;
    const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    if (info != nullptr && info->socket_context != nullptr) {
      Peer& peer = *static_cast<Peer*>(info->socket_context);
      peer.since_ns = monotonic_ns();
      peer.has_asked = true;
    }
    const HttpResponse refusal = m.refuse(connection, method);
    return refusal.status == 200 ? MHD_YES : m.send(connection, refusal);
  }
  try {
    return m.send(connection, m.handler(HttpRequest(connection, path, std::strcmp(method, "POST") == 0)));
  } catch (const std::exception&) {  // out of memory, at worst; it must not pass through the library's C
    return MHD_NO;
  }
}

void HttpServer::Impl::on_connection(void* self, MHD_Connection* connection, void** context,
                                     MHD_ConnectionNotificationCode code) {
  if (code == MHD_CONNECTION_NOTIFY_STARTED) {
    static_cast<Impl*>(self)->opened(connection, context);
  } else if (*context != nullptr) {
    *static_cast<Peer*>(*context) = {};
  }
}

void HttpServer::Impl::opened(MHD_Connection* connection, void** context) {
  *context = nullptr;
  const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  const auto free = std::find_if(peers.begin(), peers.end(), [](const Peer& p) { return p.socket < 0; });
  if (info == nullptr || free == peers.end()) return;
  *free = {info->connect_fd, false, monotonic_ns()};
  *context = &*free;
  make_room();
}

/// Nearly full: the connection of least use goes. One that has never asked, if there is any; of those the oldest.
void HttpServer::Impl::make_room() {
  const auto is_open = [](const Peer& p) { return p.socket >= 0; };
  if (std::count_if(peers.begin(), peers.end(), is_open) < kMostConnections - kSpareConnections) return;
  const auto least = std::min_element(peers.begin(), peers.end(), [&](const Peer& a, const Peer& b) {
    return std::tuple(!is_open(a), a.has_asked, a.since_ns) < std::tuple(!is_open(b), b.has_asked, b.since_ns);
  });
  shutdown(least->socket, SHUT_RDWR);  // libmicrohttpd finds it ended, and closes it
  least->since_ns = monotonic_ns();    // on its way out: the next to go is another
}

void HttpServer::Impl::drop_silent() {
  const std::int64_t now_ns = monotonic_ns();
  for (const Peer& p : peers) {
    const std::int64_t patience_ns = p.has_asked ? kPatience_ns : kPatienceWithNew_ns;
    if (p.socket >= 0 && now_ns - p.since_ns > patience_ns) shutdown(p.socket, SHUT_RDWR);
  }
}

Result<std::unique_ptr<HttpServer>> HttpServer::listen(const ViewAddress& address, Handler handler, HttpPosts posts) {
  auto impl = std::make_unique<Impl>();
  impl->address = address;
  if (!address.is_loopback() && address.token.empty()) impl->address.token = new_token();
  impl->handler = std::move(handler);
  impl->posts = posts;
  const Result<int> socket = open_socket(address, impl->address.port);
  if (!socket) return socket.error();
  impl->daemon = MHD_start_daemon(MHD_USE_EPOLL, 0, nullptr, nullptr, &Impl::on_request, impl.get(),
                                  MHD_OPTION_LISTEN_SOCKET, *socket,                                //
                                  MHD_OPTION_CONNECTION_LIMIT, kMostConnections,                    //
                                  MHD_OPTION_CONNECTION_MEMORY_LIMIT, kMemoryOfConnection,          //
                                  MHD_OPTION_CONNECTION_TIMEOUT, unsigned{kPatience_ns / kSecond},  //
                                  MHD_OPTION_NOTIFY_CONNECTION, &Impl::on_connection, impl.get(),   //
                                  MHD_OPTION_SIGPIPE_HANDLED_BY_APP, 1,                             //
                                  MHD_OPTION_END);
  if (impl->daemon == nullptr) {
    close(*socket);
    return Error{ErrorKind::kRun, "", 0, "--view: the HTTP server did not start", "a system with epoll"};
  }
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

void HttpServer::step(Span at_most) {
  // A peer that has gone must cost a return value, not a signal; blocked for this thread alone.
  sigset_t pipe;
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
  MHD_run_wait(impl_->daemon, static_cast<std::int32_t>(at_most.ns / 1'000'000));
  impl_->drop_silent();
}

int HttpServer::connections() const {
  return static_cast<int>(
      std::count_if(impl_->peers.begin(), impl_->peers.end(), [](const Peer& p) { return p.socket >= 0; }));
}

#endif

std::uint64_t HttpRequest::number(const char* name, std::uint64_t fallback) const {
  const std::string_view digits = text(name);
  std::uint64_t value = 0;
  const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return error == std::errc{} && stop == digits.data() + digits.size() ? value : fallback;
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;
const ViewAddress& HttpServer::address() const { return impl_->address; }

}  // namespace epiline
