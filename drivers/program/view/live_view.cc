#include "drivers/program/view/live_view.h"

#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <random>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/program/view/view_page.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kPoll = Span::from_milliseconds(25);
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr int kNiceness = 10;  // where the flight has no priority either, it still goes before its picture

/// A number that no page of others can know, so that only our own script runs in ours.
std::string nonce() {
  std::random_device random;
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%08x%08x%08x%08x", random(), random(), random(), random());
  return text.data();
}

void append_u32(std::string& bytes, std::size_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>(value >> shift & 0xff));
}

}  // namespace

Result<std::unique_ptr<LiveView>> LiveView::open(const ViewAddress& address) {
  std::unique_ptr<LiveView> view(new LiveView);
  auto server =
      HttpServer::listen(address, [v = view.get()](const HttpRequest& request) { return v->answer(request); });
  if (!server) return server.error();
  view->server_ = std::move(*server);
  return view;
}

LiveView::~LiveView() {
  finish();
  closing_.store(true, std::memory_order_relaxed);  // nothing to be seen with it
  thread_.join();
}

bool LiveView::start(ViewSubject subject) {
  feed_.expect_images(subject.images);
  model_ = std::make_unique<ViewModel>(std::move(subject));
  last_asked_ns_ = monotonic_ns() - 1'000'000 * kMillisecond;
  return thread_.start({.name = "view", .stack_bytes = 512 * 1024}, serve, this);
}

void LiveView::serve(void* self) {
  LiveView& view = *static_cast<LiveView*>(self);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
  while (!view.closing_.load(std::memory_order_relaxed) || !view.may_close()) {
    view.server_->step(kPoll);
    view.fold();
  }
}

/// Takes in what the log thread has handed over.
void LiveView::fold() {
  const bool over = finished_.load(std::memory_order_acquire);  // before the look: all that came is found
  for (ViewedOutcome o; feed_.next(o);) model_->take(o);
  for (ViewedLatency l; feed_.next(l);) model_->take(l);
  for (Event e; feed_.next(e);) model_->take(e);
  model_->set_left_out(feed_.left_out());
  if (const ViewedImage* const image = feed_.newest_image()) {
    image_ = image;
    encoded_ = false;
    model_->set_newest_image(image->sequence + 1);
  }
  if (over) model_->finish();
  if (closing_since_ns_ == 0 && closing_.load(std::memory_order_relaxed)) closing_since_ns_ = monotonic_ns();
}

/// Nobody looks, or who does has been told the end.
bool LiveView::may_close() const {
  if (closing_since_ns_ == 0) return false;
  const std::int64_t now_ns = monotonic_ns();
  if (now_ns - last_asked_ns_ > 2000 * kMillisecond || now_ns - closing_since_ns_ > 1500 * kMillisecond) return true;
  return told_end_ns_ != 0 && now_ns - told_end_ns_ > 300 * kMillisecond;  // the last image too
}

HttpResponse LiveView::answer(const HttpRequest& request) {
  if (request.path() == "/") return page();
  if (request.path() == "/state") return state(request);
  if (request.path() == "/frame") return frame();
  if (request.path() == "/image") {
    fold();
    if (image_ == nullptr || image_->width == 0) return {404, "text/plain", "no image yet\n", ""};
    encode(*image_);
    return {200, "image/jpeg", jpeg_, ""};
  }
  return {404, "text/plain", "there are /, /state, /image and /frame\n", ""};
}

HttpResponse LiveView::page() const {
  const std::string key = nonce();
  std::string html(kViewPage);
  for (std::size_t at = 0; (at = html.find("@NONCE@", at)) != std::string::npos;) html.replace(at, 7, key);
  return {200, "text/html; charset=utf-8", std::move(html),
          "default-src 'none'; script-src 'nonce-" + key + "'; style-src 'nonce-" + key +
              "'; connect-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors "
              "'none'"};
}

HttpResponse LiveView::state(const HttpRequest& request) {
  last_asked_ns_ = monotonic_ns();
  feed_.note_viewer(last_asked_ns_);
  fold();
  if (model_->finished() && told_end_ns_ == 0) told_end_ns_ = last_asked_ns_;
  return {200, "application/json",
          model_->state_json({request.number("generation", 0), request.number("path", 0), request.number("sample", 0),
                              request.number("event", 0)}),
          ""};
}

/// Length of the header (32 bit, least byte first), header in JSON, JPEG.
HttpResponse LiveView::frame() {
  fold();
  if (image_ == nullptr) return {404, "text/plain", "no image yet\n", ""};
  encode(*image_);
  std::string body;
  append_u32(body, tracks_.size());
  body += tracks_;
  body += jpeg_;
  return {200, "application/octet-stream", std::move(body), ""};
}

/// Once an image, however many look.
void LiveView::encode(const ViewedImage& image) {
  if (encoded_) return;
  encoded_ = true;
  tracks_ = tracks_json(image);
  jpeg_.clear();
  if (image.width == 0) return;
  jpeg_ = jpeg_of({image.pixels.data(), image.width, image.height, image.width}, 80);
}

}  // namespace epiline
