#pragma once
// An HTTP server for a few clients, in bounded memory and one thread: libmicrohttpd, driven by the caller of step(). No
// connection can block another.
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "drivers/program/view/view_address.h"
#include "platform/time/clock.h"

namespace epiline {

struct HttpResponse {
  int status = 200;
  std::string type, body;
  std::string security_policy;  ///< Content-Security-Policy; empty: nothing may be loaded or run
};

/// A GET or, if the server accepts them, a POST without a body. HEAD is handled as GET; the server omits the body.
class HttpRequest {
 public:
  explicit HttpRequest(void* connection, std::string_view path, bool is_post = false)
      : connection_(connection), path_(path), is_post_(is_post) {}
  std::string_view path() const { return path_; }
  bool is_post() const { return is_post_; }
  /// The query parameter `name`; empty if missing.
  std::string_view text(const char* name) const;
  /// A header's value; empty if missing. Browsers do not let other sites' pages send headers with custom names.
  std::string_view header(const char* name) const;
  /// The query parameter `name` as a number from 0; `fallback` if it is missing or no number.
  std::uint64_t number(const char* name, std::uint64_t fallback) const;

 private:
  void* connection_;
  std::string_view path_;
  bool is_post_;
};

/// What a server answers besides GET and HEAD.
enum class HttpPosts : std::uint8_t { kRefused, kWithoutBody };

class HttpServer {
 public:
  using Handler = std::function<HttpResponse(const HttpRequest&)>;

  /// Listens. Fails if and only if the address is in use, not this computer's, or not permitted. Unless the address is
  /// loopback, each request must carry the token; a new one is generated if `address` has none.
  static Result<std::unique_ptr<HttpServer>> listen(const ViewAddress& address, Handler handler,
                                                    HttpPosts posts = HttpPosts::kRefused);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// The address in use, with the actual port and the token.
  const ViewAddress& address() const;
  /// Waits up to `at_most` for requests and answers them. Call from one thread only.
  void step(Span at_most);
  /// Number of open connections. Same thread as step().
  int connections() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
