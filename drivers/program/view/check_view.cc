#include "drivers/program/view/check_view.h"

#include <chrono>
#include <string_view>

#include "drivers/program/view/view_address.h"
#include "drivers/program/view/view_page.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kCheckPoll = Span::from_milliseconds(25);
constexpr const char* kKeyHeader = "X-Epiline-Key";

}  // namespace

CheckView::CheckView(CheckSubject subject, Accept accept)
    : accept_(std::move(accept)), key_(new_token()), model_(std::move(subject)) {}

Result<std::unique_ptr<CheckView>> CheckView::open(const ViewAddress& address, CheckSubject subject, Accept accept) {
  subject.may_accept = address.is_loopback() && accept != nullptr;
  const HttpPosts posts = address.is_loopback() ? HttpPosts::kWithoutBody : HttpPosts::kRefused;
  std::unique_ptr<CheckView> view(new CheckView(std::move(subject), std::move(accept)));
  auto server = HttpServer::listen(
      address, [v = view.get()](const HttpRequest& request) { return v->answer(request); }, posts);
  if (!server) return server.error();
  view->server_ = std::move(*server);
  view->feed_.expect_images(true);
  view->thread_ = std::thread([v = view.get()] { v->serve(); });
  return view;
}

CheckView::~CheckView() {
  {
    const std::lock_guard lock(mutex_);
    model_.finish();
  }
  closing_ = true;
  if (thread_.joinable()) thread_.join();
}

void CheckView::serve() {
  constexpr std::int64_t kToSayTheEnd_ns = 1'000'000'000;
  std::int64_t closing_since_ns = 0;
  while (closing_since_ns == 0 || (server_->connections() > 0 && monotonic_ns() - closing_since_ns < kToSayTheEnd_ns)) {
    if (closing_ && closing_since_ns == 0) closing_since_ns = monotonic_ns();
    server_->step(kCheckPoll);
  }
}

void CheckView::image(const Frame& frame, const TrackedFrame& tracked, double edge_px) {
  LoggedTracks tracks;
  tracks.sequence = frame.sequence;
  tracks.stamp = frame.stamp;
  for (const TrackedFeature& f : tracked.features) tracks.points.push_back({f.id, f.age, f.pixel[0], f.pixel[1]});
  feed_.tracks(tracks);
  feed_.image(frame, {});
  const std::lock_guard lock(mutex_);
  model_.take(frame, tracked, edge_px);
}

void CheckView::reading(const ImuSample& sample) {
  const std::lock_guard lock(mutex_);
  model_.take(sample);
}

void CheckView::findings(double seconds, const Findings& findings) {
  const std::lock_guard lock(mutex_);
  model_.take(seconds, findings);
}

HttpResponse CheckView::answer(const HttpRequest& request) {
  if (request.is_post()) return post(request);
  if (request.path() == "/") {
    HttpResponse page = page_answer(kCheckPage);
    const std::string_view mark = "@KEY@";
    if (const std::size_t at = page.body.find(mark); at != std::string::npos) page.body.replace(at, mark.size(), key_);
    return page;
  }
  image_.refresh();
  if (request.path() == "/frame") return image_.frame();
  if (request.path() == "/image") return image_.jpeg();
  if (request.path() == "/state") {
    feed_.note_viewer(monotonic_ns());
    const std::lock_guard lock(mutex_);
    model_.set_newest_image(image_.next_sequence());
    return {200, "application/json", model_.state_json(), ""};
  }
  return {404, "text/plain", "there are /, /state, /image and /frame\n", ""};
}

HttpResponse CheckView::post(const HttpRequest& request) {
  if (request.header(kKeyHeader) != key_) return {403, "text/plain", "only the page itself may ask for that\n", ""};
  if (request.path() == "/accept") return accept(request.text("setting"));
  if (request.path() == "/again") {
    const std::lock_guard lock(mutex_);
    model_.forget();
    new_start_ = true;
    return {200, "text/plain", "begun anew\n", ""};
  }
  return {404, "text/plain", "there are /accept and /again\n", ""};
}

/// By its name: findings may have moved since the page was drawn.
HttpResponse CheckView::accept(std::string_view setting) {
  const std::lock_guard lock(mutex_);
  for (const Finding& f : model_.findings()) {
    if (f.hint.key.empty() || name_of(f.hint) != setting) continue;
    const Status status = accept_(f.hint);
    model_.note_accepted(f.hint, status);
    return {status ? 200 : 500, "text/plain", status ? "set\n" : status.error().text() + "\n", ""};
  }
  return {404, "text/plain", "no finding would set that\n", ""};
}

}  // namespace epiline
