#pragma once
// An HTTP server for a few clients, in bounded memory and one thread: libmicrohttpd, driven by the caller of step(). No
// connection can block another. Limits: docs/live-view.md.
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

/// A GET or, where the server takes them, a POST without a body. HEAD is asked as GET, the body is then left out.
class HttpRequest {
 public:
  explicit HttpRequest(void* connection, std::string_view path, bool is_post = false)
      : connection_(connection), path_(path), is_post_(is_post) {}
  std::string_view path() const { return path_; }
  bool is_post() const { return is_post_; }
  /// `?name=` of the address; empty where it is missing.
  std::string_view text(const char* name) const;
  /// A header's value; empty where it is missing. Pages of other sites cannot send headers of our own making.
  std::string_view header(const char* name) const;
  /// `?name=` of the address as a number from 0; `fallback` where it is missing or none.
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

  /// Listens. Fails if and only if the address is in use, not this computer's, or not permitted. Beyond this computer
  /// each request must show a token, a new one if the address has none.
  static Result<std::unique_ptr<HttpServer>> listen(const ViewAddress& address, Handler handler,
                                                    HttpPosts posts = HttpPosts::kRefused);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// With the port that was really taken, and the token.
  const ViewAddress& address() const;
  /// Waits for something to do, `at_most` so long, and does it. By one thread.
  void step(Span at_most);
  /// Open now. Same thread as step().
  int connections() const;

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
